"""Straight traces between the nodes of one or more curves, without keeping a polyline.

Where a trace fails there is a gap, which stops nothing here: whether a curve is simple is decided
on the mesh on which it is returned (`noded_curve`).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.sparse import csgraph

from ..geometry import tolerances
from ..geometry.array_types import BoolArray, FloatArray, IntArray
from ..geometry.crossings import overlapping_segments, segments_meet
from ..geometry.surface_points import SurfacePoints, in_faces, joined, weights_at
from ..geometry.tracing import strictly_inside, trace_between
from .curve_nodes import CurveSurface, Nodes, nodes_at

LONG_WAY = 3.0
"""Longest trace, relative to the distance of its ends in space: nodes may be far apart."""

AROUND = 6.0
"""Longest path along edges where a trace fails, relative to the longest distance in space."""


@dataclass(frozen=True)
class TracedSegments:
    """Straight traces between the nodes of some curves, as s segments in faces.

    Attributes
    ----------
    node : (s,) int array
        The node before each segment, ascending.
    face : (s,) int array
    start, end : (s, 2) float array
        Barycentric coordinates in it.
    """

    node: IntArray
    face: IntArray
    start: FloatArray
    end: FloatArray


def traced_segments(surface: CurveSurface, nodes: Nodes) -> TracedSegments:
    """The segments of all traces that succeed."""
    corners = surface.mesh.faces
    node, points = _traces(surface, nodes)
    last = np.append(np.diff(node) > 0, True)
    begins = np.flatnonzero(~last)
    face = points.faces[begins]
    return TracedSegments(
        node[begins],
        face,
        points.barycentric[begins, :2],
        weights_at(
            corners[points.faces[begins + 1]], points.barycentric[begins + 1], corners[face][:, :2]
        ),
    )


def simple_curves(surface: CurveSurface, nodes: Nodes) -> BoolArray:
    """Which curves do not cross themselves, (c,), where traces succeed."""
    simple = np.ones(nodes.curves, dtype=bool)
    simple[crossing_steps(surface, nodes)[:, 0] // (len(nodes.positions) // nodes.curves)] = False
    return simple


def crossing_steps(surface: CurveSurface, nodes: Nodes) -> IntArray:
    """Pairs of nodes of a curve, (p, 2), ascending, whose traces to the next ones cross."""
    segments = traced_segments(surface, nodes)
    size = len(nodes.positions) // nodes.curves
    curve = segments.node // size
    group = curve * len(surface.mesh.faces) + segments.face
    one, other = overlapping_segments(group, segments.start, segments.end)
    apart = np.abs(one - other)
    if nodes.closed:
        first = np.searchsorted(curve, np.arange(nodes.curves + 1))
        apart = np.minimum(apart, np.diff(first)[curve[one]] - apart)
    one, other = one[apart > 1], other[apart > 1]
    meet = segments_meet(segments.start, segments.end, one, other)
    pairs = np.stack([segments.node[one[meet]], segments.node[other[meet]]], axis=1)
    return np.unique(np.sort(pairs, axis=1), axis=0)


def with_midpoints(
    surface: CurveSurface, nodes: Nodes, fixed: BoolArray
) -> tuple[Nodes, BoolArray]:
    """Twice as many nodes: one more halfway along each trace.

    Where a trace fails, it lies halfway along edges.

    Parameters
    ----------
    surface : CurveSurface
    nodes : Nodes
    fixed : (n,) bool array
        Nodes that stay fixed.

    Returns
    -------
    Nodes
        An open curve gets one node less.
    (2 n,) bool array
        The fixed ones of these.
    """
    begins = nodes.with_step
    middle = places_along(surface, nodes, begins, np.full(len(begins), 0.5))
    faces, barycentric = nodes.places.faces.copy(), nodes.places.barycentric.copy()
    faces[begins], barycentric[begins] = middle.faces, middle.barycentric
    both = np.stack([nodes.places.faces, faces], axis=1).ravel()
    weights = np.stack([nodes.places.barycentric, barycentric], axis=1).reshape(-1, 3)
    stays = np.stack([fixed, np.zeros_like(fixed)], axis=1).ravel()
    kept = np.ones(len(both), dtype=bool)
    if not nodes.closed:
        kept[2 * nodes.last + 1] = False
    places = SurfacePoints(both[kept], weights[kept])
    return nodes_at(surface, places, nodes.closed, nodes.curves), stays[kept]


def places_along(
    surface: CurveSurface, nodes: Nodes, node: IntArray, share: FloatArray
) -> SurfacePoints:
    """Points at a share of the traces from some nodes, (q,), to the next ones, inside faces.

    Where a trace fails, as around a thin part, the point lies on the shortest path along edges.
    """
    faces, barycentric = np.zeros(len(node), dtype=np.int64), np.zeros((len(node), 3))
    owner, points = _traces(surface, nodes)
    positions = points.positions(surface.mesh)
    step = np.append(np.linalg.norm(np.diff(positions, axis=0), axis=1), 0.0)
    step[np.append(np.diff(owner) > 0, True)] = 0.0
    arc = np.append(0.0, np.cumsum(step))
    first = np.searchsorted(owner, node)
    last = np.searchsorted(owner, node, side="right") - 1
    traced = np.flatnonzero(last > first)
    lost = np.flatnonzero(last <= first)
    on_edges = _along_edges(surface, nodes, node[lost], share[lost])
    faces[lost], barycentric[lost] = on_edges.faces, on_edges.barycentric
    first, last = first[traced], last[traced]
    at = arc[first] + share[traced] * (arc[last] - arc[first])
    segment = (np.searchsorted(arc, at, side="right") - 1).clip(first, last - 1)
    along = (at - arc[segment]) / np.maximum(step[segment], tolerances.TINY)
    along = along.clip(0.0, 1.0)[:, None]
    faces[traced] = points.faces[segment]
    end = in_faces(surface.mesh, points[segment + 1], faces[traced]).barycentric
    barycentric[traced] = (1.0 - along) * points.barycentric[segment] + along * end
    return SurfacePoints(faces, strictly_inside(barycentric))


def _traces(surface: CurveSurface, nodes: Nodes) -> tuple[IntArray, SurfacePoints]:
    """Points of the traces that succeed, with both ends, and the node before each, ascending."""
    node, following = nodes.with_step, nodes.following
    places = SurfacePoints(nodes.places.faces, strictly_inside(nodes.places.barycentric))
    # On an unoriented mesh, turn both normals to the same side.
    one, other = nodes.normals[node], nodes.normals[following[node]]
    agree = np.where((one * other).sum(axis=1) < 0.0, -1.0, 1.0)[:, None]
    start, end = places[node], places[following[node]]
    traces = trace_between(surface.mesh, start, end, one + agree * other, LONG_WAY, surface.folded)
    reached = np.flatnonzero(traces.reached)
    owner = np.concatenate([reached, traces.pair, reached])
    rank = np.repeat([0, 1, 2], [len(reached), len(traces.pair), len(reached)])
    order = np.lexsort((rank, owner))  # stable, so crossings stay in order
    points = joined([start[reached], traces.crossings, end[reached]])[order]
    return node[owner[order]], points


def _along_edges(
    surface: CurveSurface, nodes: Nodes, node: IntArray, share: FloatArray
) -> SurfacePoints:
    """Points at a share of the shortest paths along edges from some nodes to the next ones.

    Paths run from vertex to vertex; without a path the point stays at its vertex.
    """
    mesh = surface.mesh
    corner = mesh.faces[nodes.places.faces, nodes.places.barycentric.argmax(axis=1)]
    start, end = corner[node], corner[nodes.following[node]]
    low, high, weight = start.copy(), start.copy(), np.zeros(len(node))
    if len(node):
        length, previous = csgraph.dijkstra(
            surface.edge_graph,
            directed=False,
            indices=start,
            limit=AROUND * float(nodes.step_lengths[node].max()),
            return_predecessors=True,
        )
        for number in np.flatnonzero(np.isfinite(length[np.arange(len(node)), end])).tolist():
            here, arc = int(end[number]), length[number]
            wanted = share[number] * arc[here]
            while arc[here] > wanted:
                high[number], here = here, int(previous[number, here])
            low[number] = here
            step = arc[high[number]] - arc[here]
            weight[number] = (wanted - arc[here]) / step if step > 0.0 else 0.0
    around = [
        np.intersect1d(mesh.faces_at(np.array([one])), mesh.faces_at(np.array([other])))[0]
        for one, other in zip(low.tolist(), high.tolist(), strict=True)
    ]
    face = np.array(around, dtype=np.int64)
    corners, weight = mesh.faces[face], weight[:, None]
    at_high = weight * (corners == high[:, None])
    return SurfacePoints(face, (1.0 - weight) * (corners == low[:, None]) + at_high)
