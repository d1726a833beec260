"""Places nodes on a polyline: about equally spaced on each leg, and not inside folds.

Over folded faces a straight trace runs forward, backward and forward again. Nodes inside the fold
would reverse the curve twice. So segments that run backward over folded faces count with negative
length, and a node is placed at the last point of the leg where the net length equals its share.
"""

from __future__ import annotations

import numpy as np

from ..geometry import tolerances
from ..geometry.array_types import BoolArray, FloatArray, IntArray
from ..geometry.surface_points import SurfacePoints
from ..progress import checkpoint
from .curve_nodes import CurveSurface

FEWEST_OF_A_LEG = 6
"""Least number of nodes on a leg, including the control point at its start."""

REACH = 3.0
"""Length of curve on either side over which its direction is measured, in mean edge lengths."""

SHORTEST_TURN = 1.0 / 16.0
"""Upper limit of that length, relative to the length of the curve."""


def arc_lengths(positions: FloatArray, closed: bool) -> FloatArray:
    """Arc lengths at the starts of the s segments of a polyline and at its end, shape (s + 1,)."""
    steps = np.linalg.norm(np.roll(positions, -1, axis=0) - positions, axis=1)
    return np.concatenate([[0.0], np.cumsum(steps if closed else steps[:-1])])


def node_arcs(
    surface: CurveSurface,
    polyline: SurfacePoints,
    arc: FloatArray,
    control_index: IntArray,
    count: int,
    closed: bool,
) -> tuple[FloatArray, IntArray]:
    """Compute the arc lengths at which nodes are placed on a polyline.

    Parameters
    ----------
    surface : CurveSurface
    polyline : SurfacePoints
        Points of the polyline, each in the face of the segment after it.
    arc : (s + 1,) float array
        Arc lengths of the polyline, by `arc_lengths`.
    control_index : (k,) int array
        Indices of the control points in the polyline, ascending.
    count : int
        Approximate number of nodes.
    closed : bool

    Returns
    -------
    (n,) float array
        Arc lengths, ascending.
    (k,) int array
        Indices of the control points among the nodes.
    """
    place = np.append(control_index, len(polyline)) if closed else control_index
    bounds = arc[place]
    legs = np.diff(bounds)
    counts = np.maximum(np.round(count * legs / legs.sum()), FEWEST_OF_A_LEG).astype(np.int64)
    leg = np.repeat(np.arange(len(legs)), counts)
    control_nodes = np.cumsum(counts) - counts
    share = (np.arange(len(leg)) - control_nodes[leg]) / counts[leg]
    at = bounds[leg] + share * legs[leg]
    back = _runs_back(surface, polyline, arc, closed)
    for number in np.unique(np.searchsorted(place, np.flatnonzero(back), side="right") - 1):
        checkpoint()
        part = slice(place[number], place[number + 1] + 1)
        here = slice(control_nodes[number] + 1, control_nodes[number] + counts[number])
        at[here] = _last_arcs(arc[part], back[part][:-1], share[here])
    if not closed:
        at, control_nodes = np.append(at, bounds[-1]), np.append(control_nodes, len(at))
    return at, control_nodes


def _runs_back(
    surface: CurveSurface, polyline: SurfacePoints, arc: FloatArray, closed: bool
) -> BoolArray:
    """Which segments run over folded faces against the direction of the curve, shape (s + 1,).

    The last entry is padding, so that the result can be sliced like the arc lengths.
    """
    mesh = surface.mesh
    back = np.zeros(len(arc), dtype=bool)
    if surface.folded is None:
        return back
    folded = np.flatnonzero(surface.folded[polyline.faces[: len(arc) - 1]])
    positions = polyline.positions(mesh)
    if closed:
        positions = np.concatenate([positions, positions[:1]])
    total = float(arc[-1])
    reach = min(REACH * mesh.mean_edge_length, SHORTEST_TURN * total)
    middle = 0.5 * (arc[folded] + arc[folded + 1])

    def place_at(along: FloatArray) -> FloatArray:
        along = along % total if closed else along.clip(0.0, total)
        return np.stack([np.interp(along, arc, axis) for axis in positions.T], axis=1)

    heading = place_at(middle + reach) - place_at(middle - reach)
    back[folded] = ((positions[folded + 1] - positions[folded]) * heading).sum(axis=1) < 0.0
    return back


def _last_arcs(arc: FloatArray, back: BoolArray, share: FloatArray) -> FloatArray:
    """The last arc lengths on a leg at which given shares of its net length are reached, (n,).

    Parameters
    ----------
    arc : (s + 1,) float array
        Arc lengths at the ends of the s segments of the leg.
    back : (s,) bool array
        Which segments run backward.
    share : (n,) float array
        Shares within (0, 1), ascending.
    """
    steps = np.diff(arc)
    covered = np.concatenate([[0.0], np.cumsum(np.where(back, -steps, steps))])
    if covered[-1] <= 0.0:
        return arc[0] + share * (arc[-1] - arc[0])
    covered = covered.clip(0.0, covered[-1])
    lowest_from_here = np.minimum.accumulate(covered[::-1])[::-1]
    wanted = share * covered[-1]
    segment = np.searchsorted(lowest_from_here, wanted, side="right") - 1
    segment = segment.clip(0, len(steps) - 1)
    rise = np.maximum(covered[segment + 1] - covered[segment], tolerances.TINY)
    along = ((wanted - covered[segment]) / rise).clip(0.0, 1.0)
    return arc[segment] + along * steps[segment]
