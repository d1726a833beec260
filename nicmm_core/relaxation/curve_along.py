"""Moves a polyline near a surface to the nearest places on it, as a start for relaxation."""

from __future__ import annotations

import numpy as np

from ..geometry.array_types import FloatArray, IntArray
from ..geometry.curve import arc_lengths
from ..geometry.surface_points import SurfacePoints, nearest_points
from .curve_nodes import CurveSurface
from .discrete_curve import DiscreteCurve
from .simple_curve import simple_curve
from .warm_start import LONGEST_MOVE

NODES, FEWEST_NODES = 256, 4
"""Approximate number of points of a polyline that are moved, and least number of them on a leg."""


def curve_along(
    surface: CurveSurface,
    points: FloatArray,
    closed: bool,
    control_index: IntArray,
    controls: SurfacePoints | None = None,
) -> DiscreteCurve | None:
    """A simple curve on a surface along a polyline.

    Parameters
    ----------
    surface : CurveSurface
    points : (n, 3) float array
        Points of the polyline. An open one begins and ends at a control point.
    closed : bool
    control_index : (k,) int array
        Index of each control point among them, in the order visited; cyclically ascending.
    controls : SurfacePoints, optional
        The k control points; by default the places of the surface nearest to those of the polyline.

    Returns
    -------
    DiscreteCurve or None
        None if a point is too far away, by `LONGEST_MOVE`, or if there is no way along the surface
        near the polyline.
    """
    positions, control_nodes = _nodes(points, closed, control_index)
    places, away = nearest_points(surface.mesh, positions)
    if away.max() > LONGEST_MOVE * arc_lengths(np.diff(points, axis=0))[-1]:
        return None
    if controls is None:
        controls = places[control_nodes]
    return simple_curve(surface, places, control_nodes, controls, closed)


def _nodes(
    points: FloatArray, closed: bool, control_index: IntArray
) -> tuple[FloatArray, IntArray]:
    """Evenly spaced points of each leg, and the indices of the control points among them."""
    line = np.roll(points, -control_index[0], axis=0) if closed else points
    controls = (control_index - (control_index[0] if closed else 0)) % len(points)
    if closed:
        line, controls = np.concatenate([line, line[:1]]), np.append(controls, len(line))
    arcs = arc_lengths(np.diff(line, axis=0))
    ends = arcs[controls]
    counts = np.rint(NODES * np.diff(ends) / arcs[-1]).astype(int).clip(FEWEST_NODES)
    legs = zip(ends[:-1], ends[1:], counts, strict=True)
    wanted = [np.linspace(low, high, count, endpoint=False) for low, high, count in legs]
    nodes = np.append(0, np.cumsum(counts))
    along = np.concatenate(wanted)
    if closed:
        nodes = nodes[:-1]
    else:
        along = np.append(along, ends[-1])
    positions = np.stack([np.interp(along, arcs, line[:, axis]) for axis in range(3)], axis=1)
    return positions, nodes
