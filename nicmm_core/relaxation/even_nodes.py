"""Spaces the nodes of several curves evenly between their fixed nodes.

Nodes are closer together where the normals turn, as around the edge of a thin part.
"""

from __future__ import annotations

import numpy as np

from ..geometry import tolerances
from ..geometry.array_types import BoolArray, FloatArray, IntArray
from ..geometry.surface_points import SurfacePoints
from ..geometry.vectors import lengths
from .curve_nodes import CurveSurface, Nodes, nodes_at
from .node_traces import NodeTraces, places_along, traces_between_nodes
from .noded_curve import shifted

NODES_PER_RADIAN = 1.0
"""Additional nodes per radian by which the normals turn."""

SHORT_MOVE = 1e-3
"""Move, in mean distances between nodes, below which `evened` leaves a node in place."""

LENGTH_WITHOUT_TRACE = 2.0
"""Assumed length of a step whose trace fails, relative to the distance between its nodes.

The trace fails around a thin part, where the way over the surface is longer.
"""


def evened(surface: CurveSurface, nodes: Nodes, fixed: BoolArray) -> Nodes:
    """Move nodes so that they are evenly spaced along the straight lines between them.

    Parameters
    ----------
    surface : CurveSurface
    nodes : Nodes
        c curves with n / c nodes each.
    fixed : (n,) bool array
        Which nodes stay. The first node of each curve is one of them.
    """
    arc, along = _even_arcs(nodes, nodes.step_lengths, fixed, 1)
    last = np.where(nodes.closed, nodes.first, nodes.last)
    around = np.append(nodes.by_curve(np.arange(len(nodes.positions))), last[:, None], axis=1)
    path = nodes.positions[around.ravel()]
    target = np.stack([np.interp(along, arc, axis) for axis in path.T], axis=1)
    move = target - nodes.positions
    move -= (move * nodes.normals).sum(axis=1, keepdims=True) * nodes.normals
    length = np.linalg.norm(move, axis=1)
    direction = move / np.maximum(length, tolerances.TINY)[:, None]
    mean = nodes.spread(nodes.by_curve(nodes.step_lengths).mean(axis=1))
    length[fixed | (length < SHORT_MOVE * mean)] = 0.0
    return shifted(surface, nodes, direction, length)[0]


def resampled(
    surface: CurveSurface, nodes: Nodes, fixed: BoolArray, times: int
) -> tuple[Nodes, IntArray]:
    """Place new nodes, evenly spaced along the traces between the nodes.

    Around the edge of a thin part, a trace may be several times as long as the distance of its
    nodes, and gets as many more of the new nodes.

    Parameters
    ----------
    surface : CurveSurface
    nodes : Nodes
        c curves with n / c nodes each.
    fixed : (n,) bool array
        Which nodes stay. The first node of each curve is one of them, and the last one of each open
        curve.
    times : int
        Factor of the number of steps of each leg.

    Returns
    -------
    Nodes
        c curves with m nodes altogether.
    (m,) int array
        Index of the former node where a node was fixed, -1 elsewhere.
    """
    traces = traces_between_nodes(surface, nodes)
    node, share = _even_places(surface, nodes, traces, fixed, times)
    size = nodes.per_curve
    former = np.full((nodes.curves, len(node) // nodes.curves), -1)
    former[:, ::times] = np.where(fixed, np.arange(len(fixed)), -1).reshape(nodes.curves, size)
    former = former.ravel()
    stays, moves = np.flatnonzero(former >= 0), np.flatnonzero(former < 0)
    faces, barycentric = np.zeros(len(former), dtype=np.int64), np.zeros((len(former), 3))
    kept = nodes.places[former[stays]]
    faces[stays], barycentric[stays] = kept.faces, kept.barycentric
    new = places_along(surface, nodes, traces, node[moves], share[moves])
    faces[moves], barycentric[moves] = new.faces, new.barycentric
    places = SurfacePoints(faces, barycentric)
    return nodes_at(surface, places, nodes.closed, nodes.curves), former


def _even_places(
    surface: CurveSurface, nodes: Nodes, traces: NodeTraces, fixed: BoolArray, times: int
) -> tuple[IntArray, FloatArray]:
    """Where m new nodes lie: the node before each, (m,), and its share of the trace from there."""
    size = nodes.per_curve
    if surface.folded is not None:
        # Inside a fold a trace runs backward, and nodes spaced along it would change places.
        faces = traces.points.faces
        folded = np.bincount(traces.node[surface.folded[faces]], minlength=len(fixed)) > 0
        fixed = fixed | folded | nodes.before_each(folded)
    parts = np.append(lengths(np.diff(traces.points.positions(surface.mesh).T)), 0.0)
    parts[traces.is_last] = 0.0
    length = np.bincount(traces.node, parts, len(nodes.positions)).astype(np.float64)
    length = np.where(length > 0.0, length, LENGTH_WITHOUT_TRACE * nodes.step_lengths)
    arc, along = _even_arcs(nodes, length, fixed, times)
    curve = np.repeat(np.arange(nodes.curves), len(along) // nodes.curves)
    first = curve * (size + 1)  # in `arc`, which has an additional entry for each curve
    step = (np.searchsorted(arc, along, side="right") - 1).clip(first, first + size - 1)
    share = (along - arc[step]) / np.maximum(arc[step + 1] - arc[step], tolerances.TINY)
    return step - curve, share.clip(0.0, 1.0)


def _even_arcs(
    nodes: Nodes, step_lengths: FloatArray, fixed: BoolArray, times: int
) -> tuple[FloatArray, FloatArray]:
    """Weighted arc lengths of the nodes, and those at which new nodes are evenly spaced.

    All curves are in a row. Each one is extended by a node at its end: the first node again if it
    is closed, the last one if it is open. The first array, (c (n / c + 1),), includes these nodes,
    the second one does not.
    """
    size = nodes.per_curve
    mean = nodes.by_curve(step_lengths).mean(axis=1)
    turning = np.linalg.norm(nodes.after_each(nodes.normals.T).T - nodes.normals, axis=1)
    turning[nodes.step_lengths == 0.0] = 0.0  # at the end of an open curve
    weighted = nodes.by_curve(step_lengths + NODES_PER_RADIAN * nodes.spread(mean) * turning)
    ends = np.ones((nodes.curves, size + 1), dtype=bool)
    ends[:, :-1] = nodes.by_curve(fixed)
    total = weighted.sum(axis=1)
    arcs = np.zeros((nodes.curves, size + 1))
    weighted.cumsum(axis=1, out=arcs[:, 1:])
    arc = (arcs + (total.cumsum() - total)[:, None]).ravel()
    count = times * size if nodes.closed else times * (size - 1) + 1
    wanted = np.arange(nodes.curves)[:, None] * (size + 1) + np.arange(count) / times
    place = ends.ravel().nonzero()[0]
    return arc, np.interp(wanted.ravel(), place, arc[place])
