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
from scipy import sparse
from scipy.sparse import csgraph

from ..geometry import tolerances
from ..geometry.array_types import BoolArray, FloatArray, IntArray
from ..geometry.sampling import CANDIDATES, PACKING, spread_vertices
from ..geometry.surface_points import SurfacePoints
from ..geometry.vectors import dot
from ..progress import checkpoint
from ..relaxation.curve_nodes import CurveSurface, nodes_at

CELLS = 700
"""Number of cells per component. More cells would refine a course, which relaxation does better."""

NORMAL_WEIGHT = 1.2
"""As `geometry.sampling.NORMAL_WEIGHT`, but larger: courses around thin limbs need cells there."""

HOPS = 16
"""Number of hops from a cell to its nearest cells, before the reverse hops are added."""

REACH = 4.2
"""Greatest length of a hop, in square roots of the area per cell."""

SAME_SHEET = 1.6
"""Greatest length of a hop along edges, relative to its length in space.

Beyond this ratio the two cells lie on different sheets of the surface.
"""

SHARPEST_TURN = 2.0 * np.pi / 3.0
"""Greatest turn at a cell, in radians.

A third of all continuations turn by more; two smaller turns cost less there.
"""

EDGE_DETOUR = 1.07
"""Mean length of the shortest path along edges, relative to the geodesic distance."""


@dataclass(frozen=True)
class Hops:
    """Directed hops.

    Attributes
    ----------
    start, end : (m,) int array
        Cells at the start and at the end of each hop.
    length : (m,) float array
    leaving, arriving : (m, 3) float array
        Unit tangents at the start and at the end.
    """

    start: IntArray
    end: IntArray
    length: FloatArray
    leaving: FloatArray
    arriving: FloatArray


@dataclass(frozen=True)
class HopGraph:
    """The graph of a connected surface, without control points.

    Attributes
    ----------
    surface : CurveSurface
    vertex : (n,) int array
        Vertices of the surface that are the n cells.
    spacing : float
        Square root of the area per cell.
    hops : Hops
        The m hops, sorted by their starts.
    reverse : (m,) int array
        Index of the reverse of each hop.
    """

    surface: CurveSurface
    vertex: IntArray
    spacing: float
    hops: Hops
    reverse: IntArray

    @cached_property
    def arcs(self) -> tuple[IntArray, IntArray, FloatArray]:
        """Arcs from each hop to its continuations: `indptr`, `indices` and the bending θ² / h."""
        hops = self.hops
        first = np.searchsorted(hops.start, np.arange(len(self.vertex) + 1))
        before, after = continuations(hops.end, first)
        kept = np.flatnonzero(turning(hops, before, hops, after) <= SHARPEST_TURN)
        before, after = before[kept], after[kept]
        indptr = np.searchsorted(before, np.arange(len(hops.start) + 1))
        return indptr, after, bending(hops, before, hops, after)


def build_hop_graph(surface: CurveSurface) -> HopGraph:
    """Build the hop graph of a connected surface."""
    mesh = surface.mesh
    areas = np.zeros(len(mesh.vertices))
    np.add.at(areas, mesh.faces, mesh.face_areas[:, None] / 3.0)
    vertex = np.flatnonzero(areas > 0.0)
    spacing = float(np.sqrt(areas.sum() / min(CELLS, len(vertex))))
    if len(vertex) > CELLS:
        # The numbering depends only on the surface (`geometry.numbering`), so the sample does too.
        chance = 1.0 - np.random.default_rng(0).random(len(mesh.vertices))
        normals = surface.vertex_normals
        distance = PACKING * spacing
        vertex = spread_vertices(
            mesh, normals, areas, chance, CANDIDATES * CELLS, distance, NORMAL_WEIGHT
        )
    checkpoint()
    start, end, along = nicmm_kernels.nearest_cells(
        mesh.edge_graph, vertex, HOPS, REACH * spacing, checkpoint
    )
    size = len(vertex)
    key = np.concatenate([start * size + end, end * size + start])
    key, first = np.unique(key, return_index=True)
    start, end, along = key // size, key % size, np.tile(along, 2)[first]
    positions, normals = mesh.vertices[vertex], surface.vertex_normals[vertex]
    hops = _hops(start, end, along, positions, normals)
    in_space = np.linalg.norm(positions[start] - positions[end], axis=1)
    same_sheet = along <= SAME_SHEET * in_space
    hops, key = select_hops(hops, same_sheet), key[same_sheet]
    reverse = np.searchsorted(key, hops.end * size + hops.start)
    return HopGraph(surface, vertex, spacing, hops, reverse)


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
    positions, normals : (n + k, 3) float array
        Positions and unit normals of the cells.
    hops : Hops
        The hops of all m + 2 d states.
    reverse : (m + 2 d,) int array
        Index of the reverse of each state.
    weighted_length : (m + 2 d,) float array
        Length of the hop of each state, times the factor there.
    tension : float
        τ, in 1/length².
    cost : (k, m + 2 d) float array
        Least cost of a path from each control point that ends with each state; infinite if there is
        no such path.
    previous : (k, m + 2 d) int array
        The state before each state on this path, -1 if it is the first.
    """

    graph: HopGraph
    points: SurfacePoints
    positions: FloatArray
    normals: FloatArray
    hops: Hops
    reverse: IntArray
    weighted_length: FloatArray
    tension: float
    cost: FloatArray
    previous: IntArray

    @cached_property
    def first(self) -> IntArray:
        """The first state on the best path to each state, (k, m + 2 d)."""
        states = np.arange(self.cost.shape[1])
        found = np.where(self.previous < 0, states, self.previous)
        while True:
            further = np.take_along_axis(found, found, axis=1)
            if np.array_equal(further, found):
                return found
            found = further

    def by_state(self, start: int, end: int) -> FloatArray:
        """Least cost of a leg between two control points through each state, (m + 2 d,)."""
        return self.cost[start] + self.cost[end][self.reverse] - self.tension * self.weighted_length


def with_control_points(
    graph: HopGraph,
    points: SurfacePoints,
    along: FloatArray,
    legs: IntArray,
    factor: FloatArray | None,
    tension: float,
) -> CourseGraph:
    """Add control points to a graph, and find the least costs from them.

    Parameters
    ----------
    graph : HopGraph
    points : SurfacePoints
        k control points on the component of the graph.
    along : (k, V + k) float array
        Distances from the control points, by `distances_along_edges`.
    legs : (l, 2) int array
        Indices of the two points of each leg.
    factor : (V,) float array or None
        Factor of lengths at the vertices; None for no factor.
    tension : float
        τ L², where L is the length of the shortest path through the points.
    """
    surface, n, k = graph.surface, len(graph.vertex), len(points)
    length = along[:, len(surface.mesh.vertices) :][legs[:, 0], legs[:, 1]].sum()
    cells = np.concatenate([graph.vertex, len(surface.mesh.vertices) + np.arange(k)])
    to_cells = along[:, cells]
    to_cells[np.arange(k), n + np.arange(k)] = np.inf
    to_cells[to_cells > REACH * graph.spacing] = np.inf
    nodes = nodes_at(surface, points, closed=False)
    mesh = surface.mesh
    positions = np.concatenate([mesh.vertices[graph.vertex], nodes.positions])
    normals = np.concatenate([surface.vertex_normals[graph.vertex], nodes.normals])
    control, cell = _nearest(to_cells, HOPS)
    departures = _hops(n + control, cell, to_cells[control, cell], positions, normals)
    arrivals = Hops(
        departures.end, departures.start, departures.length, -departures.arriving,
        -departures.leaving,
    )  # fmt: skip
    hops = joined_hops([graph.hops, departures, arrivals])
    m, d = len(graph.reverse), len(control)
    reverse = np.concatenate([graph.reverse, np.arange(m + d, m + 2 * d), np.arange(m, m + d)])
    weighted = hops.length
    if factor is not None:
        at_cells = np.concatenate([factor[graph.vertex], _at_points(surface, points, factor)])
        weighted = weighted * 0.5 * (at_cells[hops.start] + at_cells[hops.end])
    tension = tension / max(float(length), tolerances.TINY) ** 2
    cost, previous = _least_costs(graph, hops, departures, control, weighted, tension, k)
    return CourseGraph(
        graph, points, positions, normals, hops, reverse, weighted, tension, cost, previous
    )


def _least_costs(
    graph: HopGraph,
    hops: Hops,
    departures: Hops,
    control: IntArray,
    length: FloatArray,
    tension: float,
    k: int,
) -> tuple[FloatArray, IntArray]:
    """Least costs from k control points to all states, and the state before each on its path.

    Both have the shape (k, m + 2 d).
    """
    m, d, n = len(graph.reverse), len(departures.start), len(graph.vertex)
    indptr, after, bent = graph.arcs
    first = np.searchsorted(graph.hops.start, np.arange(n + 1))
    first = np.concatenate([first, np.full(k, first[-1])])  # no hop goes on from a control point
    before, onward = continuations(departures.end, first)
    leaving = bending(departures, before, graph.hops, onward) + tension * length[onward]
    rows = np.concatenate(
        [
            indptr,
            indptr[-1] + np.searchsorted(before, np.arange(1, d + 1)),
            indptr[-1] + len(before) + np.searchsorted(control, np.arange(1, k + 1)),
        ]
    )
    columns = np.concatenate([after, onward, m + np.arange(d)])
    values = np.concatenate([bent + tension * length[after], leaving, tension * length[m : m + d]])
    size = m + d + k
    matrix = sparse.csr_array((values, columns, rows), shape=(size, size))
    checkpoint()
    cost, previous = csgraph.dijkstra(
        matrix, indices=m + d + np.arange(k), return_predecessors=True
    )
    cost, previous = cost[:, : m + d], previous[:, : m + d]
    previous[(previous >= m + d) | (previous < 0)] = -1
    # An arrival continues the states that end at the cell where it starts.
    order = np.argsort(hops.end[: m + d], kind="stable")
    ends = np.searchsorted(hops.end[: m + d][order], np.arange(n + k + 1))
    arrival, place = continuations(departures.end, ends)
    state = order[place]
    backward = m + d + arrival
    kept = departures.start[arrival] != hops.start[state]
    arrival, state, backward = arrival[kept], state[kept], backward[kept]
    added = bending(hops, state, hops, backward) + tension * length[backward]
    arriving, came = np.full((k, d), np.inf), np.full((k, d), -1)
    for number in range(k):
        total = cost[number, state] + added
        best = np.lexsort((total, arrival))
        best = best[np.unique(arrival[best], return_index=True)[1]]
        best = best[np.isfinite(total[best])]
        arriving[number, arrival[best]] = total[best]
        came[number, arrival[best]] = state[best]
    # The reverse of a direct hop between two control points is a whole path in itself.
    direct = np.flatnonzero(departures.end >= n)
    arriving[:, direct], came[:, direct] = np.inf, -1
    arriving[departures.end[direct] - n, direct] = tension * length[m + direct]
    return np.concatenate([cost, arriving], axis=1), np.concatenate([previous, came], axis=1)


def continuations(ends: IntArray, first: IntArray) -> tuple[IntArray, IntArray]:
    """All pairs of a hop and an item of the cell where the hop ends, by the indices of both.

    Parameters
    ----------
    ends : (p,) int array
        Cell at which each hop ends.
    first : (cells + 1,) int array
        Index of the first item of each cell, and the number of items at the end. Items are sorted
        by cell; they may be the hops that start there.
    """
    count = first[ends + 1] - first[ends]
    hop = np.repeat(np.arange(len(ends)), count)
    place = np.arange(len(hop)) - np.repeat(np.cumsum(count) - count, count)
    return hop, first[ends[hop]] + place


def turning(one: Hops, before: IntArray, other: Hops, after: IntArray) -> FloatArray:
    """Turning angle θ from hops to their continuations, in radians, 0 … π."""
    arriving, leaving = one.arriving.take(before, axis=0), other.leaving.take(after, axis=0)
    return np.arccos(dot(arriving.T, leaving.T).clip(-1.0, 1.0))


def bending(one: Hops, before: IntArray, other: Hops, after: IntArray) -> FloatArray:
    """θ² / h from hops to their continuations."""
    step = 0.5 * (one.length[before] + other.length[after])
    return turning(one, before, other, after) ** 2 / np.maximum(step, tolerances.TINY)


def select_hops(hops: Hops, which: IntArray | BoolArray) -> Hops:
    """Some of the hops, by indices or a mask."""
    return Hops(
        hops.start[which], hops.end[which], hops.length[which], hops.leaving[which],
        hops.arriving[which],
    )  # fmt: skip


def joined_hops(parts: list[Hops]) -> Hops:
    """Concatenate hops."""
    return Hops(
        *(
            np.concatenate([getattr(part, name) for part in parts])
            for name in ("start", "end", "length", "leaving", "arriving")
        )
    )


def _nearest(distance: FloatArray, count: int) -> tuple[IntArray, IntArray]:
    """Row and column of the `count` least finite distances of each row, rows ascending."""
    if distance.shape[1] > count:
        farthest = np.partition(distance, count - 1, axis=1)[:, count - 1, None]
        distance = np.where(distance <= farthest, distance, np.inf)
    row, column = np.nonzero(np.isfinite(distance))
    order = np.lexsort((distance[row, column], row))  # stable
    row, column = row[order], column[order]
    place = np.arange(len(row)) - np.searchsorted(row, row)
    return row[place < count], column[place < count]


def _hops(
    start: IntArray,
    end: IntArray,
    along_edges: FloatArray,
    positions: FloatArray,
    normals: FloatArray,
) -> Hops:
    """Hops between cells with given positions and normals."""
    offset = positions[end] - positions[start]
    length = np.maximum(np.linalg.norm(offset, axis=1), along_edges / EDGE_DETOUR)
    return Hops(
        start, end, length, tangents(offset, normals[start]), tangents(offset, normals[end])
    )


def tangents(vectors: FloatArray, normals: FloatArray) -> FloatArray:
    """Unit vectors along the projections of vectors, (m, 3), onto planes with given normals."""
    flat = vectors - np.einsum("md,md->m", vectors, normals)[:, None] * normals
    return flat / np.maximum(np.linalg.norm(flat, axis=1), tolerances.TINY)[:, None]


def distances_along_edges(surface: CurveSurface, points: SurfacePoints) -> FloatArray:
    """Distances along edges from k points to the vertices and the points, (k, V + k)."""
    mesh = surface.mesh
    corners = mesh.faces[points.faces]
    away = np.linalg.norm(mesh.vertices[corners] - points.positions(mesh)[:, None], axis=2)
    to_vertices = nicmm_kernels.distances_along_edges(mesh.edge_graph, corners, away, checkpoint)
    to_points = (to_vertices[:, corners] + away).min(axis=2)
    np.fill_diagonal(to_points, 0.0)
    return np.concatenate([to_vertices, to_points], axis=1)


def _at_points(surface: CurveSurface, points: SurfacePoints, values: FloatArray) -> FloatArray:
    """Values at the vertices, (V,), interpolated at k points, (k,)."""
    corners = values[surface.mesh.faces[points.faces]]
    return np.einsum("kc,kc->k", points.barycentric, corners)
