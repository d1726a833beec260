"""Computes straight traces between the nodes of curves, without keeping a polyline.

A failed trace leaves a gap, which is not an error here: whether a curve is simple is decided later,
on the mesh on which it is returned (`discrete_curve`).
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import nicmm_kernels
import numpy as np

from ..geometry import tolerances
from ..geometry.array_types import FloatArray, IntArray
from ..geometry.mesh import Mesh
from ..geometry.surface_points import SurfacePoints
from ..geometry.tracing import MOST_FACES, fold_margin, strictly_inside
from ..progress import checkpoint
from .curve_nodes import CurveSurface, Nodes

DETOUR = 3.0
"""Greatest length of a trace between two nodes, relative to their distance; longer ones fail."""

LONGEST_BYPASS = 6.0
"""Greatest length of a path along edges in place of a failed trace, relative to the distance of its
nodes. Where all paths have one limit, it is relative to the greatest of these distances."""


@dataclass(frozen=True)
class NodeTraces:
    """Straight traces from n nodes of curves to the next ones, where they succeed.

    Attributes
    ----------
    mesh : Mesh
    begins : (n + 1,) int array
        Index of the first point of the trace from each node, and the number p of points. A trace
        that failed has no points.
    points : SurfacePoints
        The p points of the traces, including both ends, each in the face of the segment after it.
    """

    mesh: Mesh
    begins: IntArray
    points: SurfacePoints

    @cached_property
    def for_kernels(self) -> nicmm_kernels.TraceArrays:
        """The traces as compiled kernels read them, with what they compute from the points."""
        return nicmm_kernels.TraceArrays(
            self.mesh.for_kernels, self.begins, *self.points.for_kernels
        )

    @cached_property
    def node(self) -> IntArray:
        """Index of the node at which the trace of each point begins, (p,), ascending."""
        return np.arange(len(self.begins) - 1).repeat(np.diff(self.begins))

    @property
    def lengths(self) -> FloatArray:
        """Lengths of the traces, (n,); zero where they failed."""
        found = self.begins[1:] > self.begins[:-1]
        result = np.zeros(len(found))
        result[found] = self.for_kernels.arcs[self.begins[1:][found] - 1]
        return result


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


def traced_segments(traces: NodeTraces) -> TracedSegments:
    """Divide traces into their segments."""
    points, node = traces.points, traces.node
    first = np.flatnonzero(node[1:] == node[:-1])
    return TracedSegments(
        node[first],
        points.faces[first],
        points.barycentric[first, :2],
        nicmm_kernels.segment_ends(traces.mesh.faces, *points.for_kernels, first),
    )


def places_along(
    surface: CurveSurface, nodes: Nodes, traces: NodeTraces, node: IntArray, share: FloatArray
) -> SurfacePoints:
    """Points at given shares of the traces from q nodes to the next nodes, strictly inside faces.

    Where a trace fails, as around a thin part, the point lies on the shortest path along edges.
    """
    faces, barycentric, is_lost = nicmm_kernels.places_on_traces(
        traces.for_kernels, node, share, tolerances.INSIDE
    )
    lost = np.flatnonzero(is_lost)
    if len(lost):
        on_edges = _along_edges(surface, nodes, node[lost], share[lost])
        faces[lost], barycentric[lost] = on_edges.faces, strictly_inside(on_edges.barycentric)
    return SurfacePoints(faces, barycentric)


def traces_between_nodes(surface: CurveSurface, nodes: Nodes) -> NodeTraces:
    """Trace from every node to the next one.

    The plane of a trace contains the mean normal of both nodes. Around the edge of a thin part
    these normals may be opposite, and no such plane contains a trace. Where the trace fails, the
    plane contains the mean direction of the curve before and after it instead.
    """
    checkpoint()
    start = nodes.with_step
    counts, faces, barycentric = nicmm_kernels.trace_steps(
        surface.for_kernels,
        nodes.for_kernels,
        SurfacePoints(nodes.places.faces, strictly_inside(nodes.places.barycentric)).for_kernels,
        start,
        nodes.following[start],
        step_limits(surface),
        checkpoint,
    )
    begins = np.zeros(len(nodes.positions) + 1, dtype=np.int64)
    begins[start + 1] = counts
    return NodeTraces(surface.mesh, begins.cumsum(), SurfacePoints(faces, barycentric))


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
    corner = surface.mesh.faces[nodes.places.faces, nodes.places.barycentric.argmax(axis=1)]
    faces, barycentric = nicmm_kernels.points_on_edge_paths(
        surface.mesh.edge_graph,
        corner[node],
        corner[nodes.following[node]],
        share,
        LONGEST_BYPASS * float(nodes.step_lengths[node].max()),
        checkpoint,
    )
    return SurfacePoints(faces, barycentric)
