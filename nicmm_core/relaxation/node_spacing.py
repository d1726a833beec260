"""Where on a polyline nodes go: at about equal distances on each leg, and not into folds.

Where faces are folded back over their neighbours, a straight way over them runs forth, back and
forth again. Nodes in there would have to turn about twice; so a part of the way that runs back over
folded faces takes as much off the distance that has been covered as any other adds to it, and a
node goes where its distance is covered for good.
"""

from __future__ import annotations

import numpy as np

from ..geometry import tolerances
from ..geometry.array_types import BoolArray, FloatArray, IntArray
from ..geometry.surface_points import SurfacePoints
from ..progress import checkpoint
from .curve_nodes import CurveSurface

FEWEST_OF_A_LEG = 6
"""Nodes of a leg at least, with the control point at its start."""

REACH = 3.0
"""How far before and behind one looks for where a curve is heading, in mean edge lengths."""

SHORTEST_TURN = 1.0 / 16.0
"""The same for a short curve, as a share of it."""


def arc_lengths(positions: FloatArray, closed: bool) -> FloatArray:
    """Lengths of a polyline up to each of its points, and of all of it, shape (s + 1,)."""
    steps = np.linalg.norm(np.roll(positions, -1, axis=0) - positions, axis=1)
    return np.concatenate([[0.0], np.cumsum(steps if closed else steps[:-1])])


def node_arcs(
    surface: CurveSurface,
    polyline: SurfacePoints,
    arc: FloatArray,
    control_place: IntArray,
    count: int,
    closed: bool,
) -> tuple[FloatArray, IntArray]:
    """How far along a polyline its nodes go.

    Parameters
    ----------
    surface : CurveSurface
    polyline : SurfacePoints
        Each point in the face of the segment after it.
    arc : (s + 1,) float array
        Its `arc_lengths`.
    control_place : (k,) int array
        Where in it the control points are, ascending.
    count : int
        About how many nodes.
    closed : bool

    Returns
    -------
    (n,) float array
        Arc lengths, ascending.
    (k,) int array
        Which of the nodes are the control points.
    """
    place = np.append(control_place, len(polyline)) if closed else control_place
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
        at[here] = _covered_for_good(arc[part], back[part][:-1], share[here])
    if not closed:
        at, control_nodes = np.append(at, bounds[-1]), np.append(control_nodes, len(at))
    return at, control_nodes


def _runs_back(
    surface: CurveSurface, polyline: SurfacePoints, arc: FloatArray, closed: bool
) -> BoolArray:
    """Segments over folded faces against the way that the curve is heading, shape (s + 1,).

    With a dummy at the end, so that it can be cut where the arc lengths are.
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


def _covered_for_good(arc: FloatArray, back: BoolArray, share: FloatArray) -> FloatArray:
    """Arc lengths on a leg after which shares of its distance, within (0, 1), are never left.

    Parameters
    ----------
    arc : (s + 1,) float array
        At the ends of its segments.
    back : (s,) bool array
        Segments that run back.
    share : (n,) float array
        Ascending.
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
