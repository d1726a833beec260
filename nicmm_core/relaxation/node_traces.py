"""Computes straight traces between the nodes of curves, without keeping a polyline.

A failed trace leaves a gap, which is not an error here: whether a curve is simple is decided later,
on the mesh on which it is returned (`noded_curve`).
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import nicmm_kernels
import numpy as np
from scipy.sparse import csgraph

from ..geometry import tolerances
from ..geometry.array_types import BoolArray, FloatArray, IntArray
from ..geometry.crossings import meeting_segments
from ..geometry.mesh import Mesh
from ..geometry.surface_points import SurfacePoints, in_faces, joined, weights_at
from ..geometry.tracing import (
    MOST_FACES,
    Traces,
    fold_margin,
    strictly_inside,
    traces_found,
)
from ..geometry.vectors import lengths
from ..progress import checkpoint
from .curve_nodes import CurveSurface, Nodes

DETOUR = 3.0
"""Greatest length of a trace between two nodes, relative to their distance; longer ones fail."""

LONGEST_BYPASS = 6.0
"""Greatest length of a path along edges in place of a failed trace.

It is relative to the greatest distance between two nodes without a trace.
"""

BYPASS_RADII = (0.1, 0.3, 1.0)
"""Radii, relative to the longest bypass, within which paths are searched for, in turn.

Most paths are far shorter than the longest one.
"""


@dataclass(frozen=True)
class NodeTraces:
    """Straight traces between the nodes of curves, where they succeed.

    Attributes
    ----------
    node : (p,) int array
        Index of the node at which the trace of each point begins, ascending.
    points : SurfacePoints
        Points of the traces, including both ends, each in the face of the segment after it.
    """

    node: IntArray
    points: SurfacePoints

    @cached_property
    def is_last(self) -> BoolArray:
        """Whether each point is the end of its trace, (p,)."""
        return np.append(np.diff(self.node) > 0, True)


@dataclass(frozen=True)
class TracedSegments:
    """Traces as s segments, each in one face.

    Attributes
    ----------
    node : (s,) int array
        Index of the node at which the trace of each segment begins, ascending.
    face : (s,) int array
        The face of each segment.
    start, end : (s, 2) float array
        First two barycentric coordinates of both ends in this face.
    """

    node: IntArray
    face: IntArray
    start: FloatArray
    end: FloatArray


def traced_segments(mesh: Mesh, traces: NodeTraces) -> TracedSegments:
    """Divide traces into their segments."""
    corners, points = mesh.faces, traces.points
    begins = np.flatnonzero(~traces.is_last)
    face, following = points.faces[begins], points[begins + 1]
    end = weights_at(corners[following.faces], following.barycentric, corners[face][:, :2])
    return TracedSegments(traces.node[begins], face, points.barycentric[begins, :2], end)


def crossing_steps(surface: CurveSurface, nodes: Nodes) -> IntArray:
    """Pairs of nodes of a curve, (p, 2), ascending, whose traces to the next nodes cross."""
    segments = traced_segments(surface.mesh, traces_between_nodes(surface, nodes))
    size = nodes.per_curve
    curve = segments.node // size
    group = curve * len(surface.mesh.faces) + segments.face
    one, other = meeting_segments(group, segments.start, segments.end).T
    apart = np.abs(one - other)
    if nodes.closed:
        first = np.searchsorted(curve, np.arange(nodes.curves + 1))
        apart = np.minimum(apart, np.diff(first)[curve[one]] - apart)
    one, other = one[apart > 1], other[apart > 1]
    pairs = np.stack([segments.node[one], segments.node[other]], axis=1)
    return np.unique(np.sort(pairs, axis=1), axis=0)


def places_along(
    surface: CurveSurface, nodes: Nodes, traces: NodeTraces, node: IntArray, share: FloatArray
) -> SurfacePoints:
    """Points at given shares of the traces from q nodes to the next nodes, strictly inside faces.

    Where a trace fails, as around a thin part, the point lies on the shortest path along edges.
    """
    faces, barycentric = np.zeros(len(node), dtype=np.int64), np.zeros((len(node), 3))
    owner, points = traces.node, traces.points
    positions = points.positions(surface.mesh).T
    step = np.append(lengths(np.diff(positions)), 0.0)
    step[traces.is_last] = 0.0
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


def traces_between_nodes(surface: CurveSurface, nodes: Nodes) -> NodeTraces:
    """Trace from every node to the next one."""
    node, following = nodes.with_step, nodes.following
    places = SurfacePoints(nodes.places.faces, strictly_inside(nodes.places.barycentric))
    start, end = places[node], places[following[node]]
    traces = traces_of_steps(surface, nodes, places, node, following[node])
    reached = np.flatnonzero(traces.reached)
    owner = np.concatenate([reached, traces.pair, reached])
    rank = np.repeat([0, 1, 2], [len(reached), len(traces.pair), len(reached)])
    order = np.lexsort((rank, owner))  # stable, so crossings stay in order
    points = joined([start[reached], traces.crossings, end[reached]])[order]
    return NodeTraces(node[owner[order]], points)


def traces_of_steps(
    surface: CurveSurface,
    nodes: Nodes,
    places: SurfacePoints,
    start: IntArray,
    end: IntArray,
) -> Traces:
    """Trace from m nodes to the next or the previous nodes.

    The plane of a trace contains the mean normal of both nodes. Around the edge of a thin part
    these normals may be opposite, and no such plane contains a trace. Where the trace fails, the
    plane contains the mean direction of the curve before and after it instead.

    Parameters
    ----------
    surface : CurveSurface
    nodes : Nodes
    places : SurfacePoints
        Places of all n nodes. Those of the nodes in `start` are strictly inside faces.
    start, end : (m,) int array
        Indices of the nodes at which the traces start and end.
    """
    checkpoint()
    reached, counts, faces, barycentric = nicmm_kernels.trace_steps(
        surface.for_kernels,
        nodes.for_kernels,
        places.for_kernels,
        np.ascontiguousarray(start, np.int64),
        np.ascontiguousarray(end, np.int64),
        step_limits(surface),
        checkpoint,
    )
    return traces_found(reached, counts, SurfacePoints(faces, barycentric))


def step_limits(surface: CurveSurface) -> nicmm_kernels.StepLimits:
    """Limits of the traces between nodes."""
    margin = fold_margin(surface.mesh, surface.folded)
    return nicmm_kernels.StepLimits(DETOUR, margin, MOST_FACES)


def _along_edges(
    surface: CurveSurface, nodes: Nodes, node: IntArray, share: FloatArray
) -> SurfacePoints:
    """Points at given shares of the shortest paths along edges from nodes to the next nodes.

    A path joins the corners with the greatest barycentric coordinates of both nodes. If there is no
    path, the point stays at the first corner.
    """
    mesh = surface.mesh
    corner = mesh.faces[nodes.places.faces, nodes.places.barycentric.argmax(axis=1)]
    start, end = corner[node], corner[nodes.following[node]]
    low, high, weight = start.copy(), start.copy(), np.zeros(len(node))
    left = np.arange(len(node))
    for radius in BYPASS_RADII:
        if not len(left):
            break
        sources, source = np.unique(start[left], return_inverse=True)
        length, previous = csgraph.dijkstra(
            surface.edge_graph,
            directed=False,
            indices=sources,
            limit=radius * LONGEST_BYPASS * float(nodes.step_lengths[node].max()),
            return_predecessors=True,
        )
        found = np.isfinite(length[source, end[left]])
        for number, row in zip(left[found].tolist(), source[found].tolist(), strict=True):
            here, arc = int(end[number]), length[row]
            wanted = share[number] * arc[here]
            high[number] = here
            while arc[here] > wanted:
                high[number], here = here, int(previous[row, here])
            low[number] = here
            step = arc[high[number]] - arc[here]
            weight[number] = (wanted - arc[here]) / step if step > 0.0 else 0.0
        left = left[~found]
    around = [
        mesh.faces_with(np.array([one, other]))[0]
        for one, other in zip(low.tolist(), high.tolist(), strict=True)
    ]
    face = np.array(around, dtype=np.int64)
    corners, weight = mesh.faces[face], weight[:, None]
    at_high = weight * (corners == high[:, None])
    return SurfacePoints(face, (1.0 - weight) * (corners == low[:, None]) + at_high)
