"""Builds a graph of hops between cells of a surface, in which turning has a cost, and searches it.

Cells are vertices of the surface, spread about evenly. A hop joins two cells that are close to each
other along the surface. A state is a directed hop. Going on from hop (p, q) to hop (q, r) costs

    θ² / h + τ |qr|,

where θ is the turn between the hops in the tangent plane at q, and h is their mean length. This is
the energy of `relaxation.elastic_energy` for a polyline, so a shortest path in the graph is a
discrete elastica (after Ulén, Strandmark and Kahl, "Shortest paths with higher-order
regularization", PAMI 2015). A path may turn by up to 120° at a cell, so that paths around the tips
of limbs are found too.

Control points are additional cells, from which paths start in any direction. A path and its reverse
have the same cost. So paths from both ends of a leg meet in every hop, and together they give the
best path of the leg through that hop.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import nicmm_kernels
import numpy as np

from ..geometry import tolerances
from ..geometry.array_types import BoolArray, FloatArray, IntArray
from ..geometry.numbering import principal_frame
from ..geometry.sampling import CANDIDATES, PACKING, spread_vertices
from ..geometry.surface_points import SurfacePoints, joined
from ..progress import checkpoint
from ..relaxation.curve_nodes import CurveSurface, nodes_at
from ..relaxation.elastic_energy import normal_bending_of_steps
from .hops import (
    Hops,
    bending,
    continuations,
    hops_from,
    in_both_directions,
    joined_hops,
    mean_length,
    turning,
)

SEARCH_CELLS = (700, 500)
"""Numbers of cells per component. Searches with different seeds take them in turn, since each graph
misses other courses. More cells would refine a course, which relaxation does better."""

NORMAL_WEIGHT = 1.2
"""As `geometry.sampling.NORMAL_WEIGHT`, but larger: courses around thin limbs need cells there."""

SHARPEST_TURN = 2.0 * np.pi / 3.0
"""Greatest turn at a cell, in radians.

A third of all continuations turn by more; two smaller turns cost less there.
"""


@dataclass(frozen=True)
class HopGraph:
    """The graph of a connected surface, without control points.

    Attributes
    ----------
    surface : CurveSurface
    vertex : (n,) int array
        Vertices of the surface that are the n cells.
    cells : SurfacePoints
        The cells as points of faces.
    places : HopPlaces
        The cells as compiled kernels read them.
    spacing : float
        Square root of the area per cell.
    hops : Hops
        The m hops, sorted by their starts.
    reverse : (m,) int array
        Index of the reverse of each hop.
    """

    surface: CurveSurface
    vertex: IntArray
    cells: SurfacePoints
    places: nicmm_kernels.HopPlaces
    spacing: float
    hops: Hops
    reverse: IntArray

    @cached_property
    def first(self) -> IntArray:
        """Index of the first hop from each cell, and m at the end, (n + 1,)."""
        return np.searchsorted(self.hops.start, np.arange(len(self.vertex) + 1))

    @cached_property
    def arcs(self) -> tuple[IntArray, IntArray, FloatArray]:
        """Arcs from each hop to its continuations: `indptr`, `indices` and the bending θ² / h."""
        hops = self.hops
        before, after = continuations(hops.end, self.first)
        turn = turning(hops, before, hops, after)
        kept = np.flatnonzero(turn <= SHARPEST_TURN)
        before, after, turn = before[kept], after[kept], turn[kept]
        indptr = np.searchsorted(before, np.arange(len(hops.start) + 1))
        return indptr, after, turn**2 / mean_length(hops, before, hops, after)


def build_hop_graph(surface: CurveSurface, cells: int = SEARCH_CELLS[0]) -> HopGraph:
    """Build the hop graph of a connected surface with at most a number of cells."""
    mesh = surface.mesh
    areas = np.zeros(len(mesh.vertices))
    np.add.at(areas, mesh.faces, mesh.face_areas[:, None] / 3.0)
    vertex = np.flatnonzero(areas > 0.0)
    spacing = float(np.sqrt(areas.sum() / min(cells, len(vertex))))
    if len(vertex) > cells:
        candidates, distance = CANDIDATES * cells, PACKING * spacing
        frame = principal_frame(mesh.vertices, mesh.faces, mesh.face_areas)
        normals = surface.vertex_normals
        vertex = spread_vertices(mesh, frame, normals, areas, candidates, distance, NORMAL_WEIGHT)
    checkpoint()
    places = nicmm_kernels.HopPlaces(
        len(vertex),
        vertex.repeat(3).reshape(-1, 3),
        mesh.vertices[vertex],
        surface.vertex_normals[vertex],
    )
    faces = mesh.vertex_faces.indices[mesh.vertex_faces.indptr[vertex]]
    at = SurfacePoints(faces, (mesh.faces[faces] == vertex[:, None]).astype(np.float64))
    hops, reverse = in_both_directions(hops_from(surface, at, places, 0, spacing), len(vertex))
    return HopGraph(surface, vertex, at, places, spacing, hops, reverse)


@dataclass(frozen=True)
class CourseGraph:
    """A hop graph with control points, and the least costs of paths from each control point.

    States are the m hops of the graph, then d departures from control points, then d arrivals,
    which are the departures reversed. Cells are the n cells of the graph, then k control points.

    Attributes
    ----------
    graph : HopGraph
    points : SurfacePoints
        k control points.
    corners : (k,) bool array
        At which of them a course may turn freely.
    cells : SurfacePoints
        The n + k cells as points of faces.
    positions, normals : (n + k, 3) float array
        Positions and unit normals of the cells.
    hops : Hops
        The hops of all m + 2 d states.
    reverse : (m + 2 d,) int array
        Index of the reverse of each state.
    weights : (m + 2 d,) float array
        Cost of each state without its turns, in 1/length: τ times the length of its hop times the
        factor there, and w ∫ κ_n² ds along the hop, with the weight w of the normal curvature.
    cost : (k, m + 2 d) float array
        Least cost of a path from each control point that ends with each state; infinite if there is
        no such path.
    previous : (k, m + 2 d) int array
        The state before each state on this path, -1 if it is the first.
    first : (k, m + 2 d) int array
        The first state on this path; the state itself if there is no path.
    """

    graph: HopGraph
    points: SurfacePoints
    corners: BoolArray
    cells: SurfacePoints
    positions: FloatArray
    normals: FloatArray
    hops: Hops
    reverse: IntArray
    weights: FloatArray
    cost: FloatArray
    previous: IntArray
    first: IntArray

    @cached_property
    def for_kernels(self) -> nicmm_kernels.PathArrays:
        """The states and paths as compiled kernels read them."""
        return nicmm_kernels.PathArrays(
            len(self.positions), self.hops.start, self.hops.end, self.reverse, self.cost,
            self.previous, self.first,
        )  # fmt: skip

    @cached_property
    def _by_ends(self) -> tuple[IntArray, IntArray]:
        """The states by their starts and ends, and a number for both, ascending."""
        both = self.hops.start * len(self.positions) + self.hops.end
        order = np.argsort(both, kind="stable")
        return order, both[order]

    def state_between(self, start: IntArray, end: IntArray) -> IntArray:
        """The states of the hops from some cells to others, which there must be."""
        order, both = self._by_ends
        return order[np.searchsorted(both, start * len(self.positions) + end)]

    def last(self, end: int) -> IntArray:
        """The last state on the best path through each state to a control point, (m + 2 d,)."""
        return self.reverse[self.first[end][self.reverse]]


def with_control_points(
    graph: HopGraph,
    points: SurfacePoints,
    corners: BoolArray,
    length: float,
    factor: FloatArray | None,
    tension: float,
    normal_bending: float,
) -> CourseGraph:
    """Add control points to a graph, and find the least costs from them.

    Parameters
    ----------
    graph : HopGraph
    points : SurfacePoints
        k control points on the component of the graph.
    corners : (k,) bool array
        At which of them a course may turn freely.
    length : float
        Length L of the shortest path through the points.
    factor : (V,) float array or None
        Factor of lengths at the vertices; None for no factor.
    tension : float
        τ L².
    normal_bending : float
        Weight of the normal curvature, squared.
    """
    surface, n, k = graph.surface, len(graph.vertex), len(points)
    nodes, before = nodes_at(surface, points, closed=False), graph.places
    positions = np.concatenate([before.positions, nodes.positions])
    normals = np.concatenate([before.normals, nodes.normals])
    corners_of_faces = np.concatenate([before.corners, surface.mesh.faces[points.faces]])
    places = nicmm_kernels.HopPlaces(n, corners_of_faces, positions, normals)
    cells = joined([graph.cells, points])
    departures = hops_from(surface, cells, places, n, graph.spacing)
    arrivals, control = departures.reversed, departures.start - n
    hops = joined_hops([graph.hops, departures, arrivals])
    m, d = len(graph.reverse), len(control)
    reverse = np.concatenate([graph.reverse, np.arange(m + d, m + 2 * d), np.arange(m, m + d)])
    weighted = hops.length
    if factor is not None:
        at_cells = np.concatenate([factor[graph.vertex], _at_points(surface, points, factor)])
        weighted = weighted * 0.5 * (at_cells[hops.start] + at_cells[hops.end])
    weights = tension / max(length, tolerances.TINY) ** 2 * weighted
    if normal_bending:
        start, end = hops.start, hops.end
        weights = weights + normal_bending * normal_bending_of_steps(
            normals[start], normals[end], positions[end] - positions[start], hops.length
        )
    paths = _best_paths(graph, hops, departures, control, weights, k)
    return CourseGraph(
        graph, points, corners, cells, positions, normals, hops, reverse, weights, *paths
    )


def _best_paths(
    graph: HopGraph,
    hops: Hops,
    departures: Hops,
    control: IntArray,
    weights: FloatArray,
    k: int,
) -> tuple[FloatArray, IntArray, IntArray]:
    """Least costs from k control points to all states, and two states on the path to each of them.

    The results are `cost`, `previous` and `first` of `CourseGraph`. The weights are the costs of
    the lengths of all states.
    """
    m, d, n = len(graph.reverse), len(departures.start), len(graph.vertex)
    first = np.append(graph.first, np.full(k, m))  # no hop goes on from a control point
    before, onward = continuations(departures.end, first)
    leaving = bending(departures, before, graph.hops, onward)
    # An arrival continues the states that end at the cell where it starts: the reverses of the hops
    # that start there, and departures.
    by_departure, departure = np.nonzero(departures.end[:, None] == departures.end)
    arrival = np.append(before, by_departure)
    state = np.append(graph.reverse[onward], m + departure)
    kept = departures.start[arrival] != hops.start[state]
    arrival, state = arrival[kept], state[kept]
    ascending = np.lexsort((state, arrival))
    arrival, state = arrival[ascending], state[ascending]
    arriving = bending(hops, state, hops, m + d + arrival)
    each = np.arange(d + 1)
    cost, previous, begins = nicmm_kernels.turning_paths(
        np.searchsorted(control, np.arange(k + 1)),
        weights,
        graph.arcs,
        (np.searchsorted(before, each), onward, leaving),
        (np.searchsorted(arrival, each), state, arriving),
        checkpoint,
    )
    # The reverse of a direct hop between two control points is a whole path in itself.
    direct = np.flatnonzero(departures.end >= n)
    reverse = m + d + direct
    cost[:, reverse], previous[:, reverse], begins[:, reverse] = np.inf, -1, reverse
    cost[departures.end[direct] - n, reverse] = weights[m + direct]
    return cost, previous, begins


def distances_along_edges(surface: CurveSurface, points: SurfacePoints) -> FloatArray:
    """Distances along edges from k points to the vertices and the points, (k, V + k)."""
    mesh = surface.mesh
    corners = mesh.faces[points.faces]
    away = np.linalg.norm(mesh.vertices[corners] - points.positions(mesh)[:, None], axis=2)
    # The bending at a hop without length would be infinite.
    away = np.maximum(away, tolerances.SAME_POSITION * mesh.diagonal)
    to_vertices = nicmm_kernels.distances_along_edges(mesh.edge_graph, corners, away, checkpoint)
    to_points = (to_vertices[:, corners] + away).min(axis=2)
    np.fill_diagonal(to_points, 0.0)
    return np.concatenate([to_vertices, to_points], axis=1)


def _at_points(surface: CurveSurface, points: SurfacePoints, values: FloatArray) -> FloatArray:
    """Values at the vertices, (V,), interpolated at k points, (k,)."""
    corners = values[surface.mesh.faces[points.faces]]
    return np.einsum("kc,kc->k", points.barycentric, corners)
