"""Moves a start that leaves the surface of a request to the nearest places on it.

When a curve that is avoided changes, the curves that avoid it may come too close to it. They keep
their courses where a small displacement mends that. Beside a bent line at the clearance, where the
nodes of a curve hardly move, it may remain uneven; then a new curve is fairer.
"""

from __future__ import annotations

import numpy as np

from .geometry.array_types import FloatArray, IntArray
from .geometry.curve import SurfaceCurve, arc_lengths
from .geometry.surface_points import nearest_points
from .relaxation.curve_energies import scaled_bending
from .relaxation.curve_nodes import CurveSurface
from .relaxation.discrete_curve import DiscreteCurve
from .relaxation.simple_curve import simple_curve
from .relaxation.warm_start import LONGEST_MOVE

NODES = 256
"""Number of points of a curve that are moved."""

UNEVEN = 8.0
"""Increase of L ∮ κ_g² ds above which a curve has become uneven, a fifth of the value of a circle.
"""

FEWEST_NODES = 4
"""Least number of them on a leg, without its end."""


def displaced(
    surface: CurveSurface, points: FloatArray, closed: bool, control_index: IntArray
) -> SurfaceCurve | None:
    """Move a polyline to the nearest places of a surface.

    Parameters
    ----------
    surface : CurveSurface
    points : (n, 3) float array
        Points of the polyline.
    closed : bool
    control_index : (k,) int array
        Index of each control point among them, in the order visited.

    Returns
    -------
    SurfaceCurve or None
        None if a point is too far away, by `LONGEST_MOVE`, or if there is no way along the surface
        near the polyline.
    """
    positions, control_nodes = _nodes(points, closed, control_index)
    places, away = nearest_points(surface.mesh, positions)
    length = np.linalg.norm(np.diff(points, axis=0), axis=1).sum()
    if away.max() > LONGEST_MOVE * length:
        return None
    moved = simple_curve(surface, places, control_nodes, places[control_nodes], closed)
    return None if moved is None else moved.surface_curve(surface.mesh)


def is_uneven(before: DiscreteCurve, after: DiscreteCurve) -> bool:
    """Whether a curve bends far more than the one from which it was continued."""
    return scaled_bending(after) - scaled_bending(before) > UNEVEN


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
