"""The shortest path for one leg: Dijkstra's algorithm over free vertices and edge midpoints.

Midpoints connect every face to its neighbours across all edges that belong neither to another leg
nor to the boundary. So a leg is found wherever the remaining surface is connected, however few
vertices it has.
"""

from __future__ import annotations

from collections.abc import Set as AbstractSet
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from scipy import sparse
from scipy.sparse import csgraph

from ..geometry.array_types import BoolArray, FloatArray, IntArray
from ..geometry.grouping import components, path_between
from ..geometry.mesh import Mesh, edge_lengths
from ..maps.guidance import length_factor
from ..progress import checkpoint
from .leg_graph import LegGraph, Node
from .virtual_splits import SplitMesh

MIDPOINT_DETOUR = 2.0
"""Cost of a length through edge midpoints, relative to the same length along edges.

It is above 1, so that edges are split only where a path along edges would be a long detour.
"""

STRAND_PENALTY = 4.0
"""Relative cost added to lengths right beside an earlier leg.

It makes two strands of a loop pass a thin limb on opposite sides, which leaves room for the level
set between them.
"""


@dataclass(frozen=True)
class BlockedElements:
    """Vertices and edges that a leg must avoid; by default none.

    Attributes
    ----------
    vertices : set of int
        Vertices of other legs, and waypoints that do not belong to this leg.
    edges : set of (int, int)
        Edges of other legs, which must not be crossed.
    ends : set of int
        Waypoints at which exactly one leg ends so far, from which the path may continue.
    """

    vertices: AbstractSet[int] = frozenset()
    edges: AbstractSet[tuple[int, int]] = frozenset()
    ends: AbstractSet[int] = frozenset()


@dataclass(frozen=True)
class Leg:
    """A path from one waypoint to the next.

    Attributes
    ----------
    nodes : list of Node
        Vertices and edge midpoints of the path, in order.
    length : float
        Length of the path, weighted by φ_fea, without the penalties of the search.
    """

    nodes: list[Node]
    length: float


class LegSearch:
    """Searches for legs on one component of a split mesh.

    Parameters
    ----------
    mesh : Mesh
        The input mesh, a manifold.
    split : SplitMesh
        Virtual splits of the input mesh; more may be added between searches.
    component : (F,) bool array
        Whether each input face belongs to the component.
    phi_fea : (V,) float array or None
        φ_fea at the input vertices.
    clearance : float
        Distance within which a leg avoids other legs, in mesh units.
    """

    def __init__(
        self,
        mesh: Mesh,
        split: SplitMesh,
        component: BoolArray,
        phi_fea: FloatArray | None,
        clearance: float,
    ) -> None:
        self._mesh = mesh
        self._split = split
        self._component = component
        self._phi_fea = phi_fea
        self._clearance = clearance
        self._longest_edge = float(edge_lengths(mesh.vertices, mesh.edges).max())
        self._whole: tuple[int, LegGraph] | None = None
        self._least_factor = 1.0
        if phi_fea is not None:
            self._least_factor = min(1.0, float(length_factor(phi_fea).min()))

    def shortest(self, source: int, target: int, blocked: BlockedElements) -> Leg | None:
        """Find the shortest leg that avoids the blocked elements; None if no leg exists.

        A search covers only the part of the surface that a leg of limited length can reach. It is
        repeated with larger limits until it succeeds. The leg found is the shortest one on the
        whole surface.
        """
        start, end = self._split.position(source), self._split.position(target)
        apart = np.linalg.norm(self._mesh.vertices - start, axis=1)
        apart += np.linalg.norm(self._mesh.vertices - end, axis=1)
        reach = 3.0 * float(np.linalg.norm(end - start))
        while True:
            checkpoint()
            near = apart <= reach + 2.0 * (self._clearance + self._longest_edge)
            inside = self._component & near[self._mesh.faces].any(axis=1)
            if inside.sum() >= 0.5 * self._component.sum():
                return self._search(self._whole_graph(), source, target, blocked, np.inf)
            graph = LegGraph(self._split.assemble_faces(inside), self._phi_fea)
            leg = self._search(graph, source, target, blocked, self._least_factor * reach)
            if leg is not None:
                return leg
            reach *= 2.0

    def are_joinable(self, pairs: list[tuple[int, int]], blocked: BlockedElements) -> bool:
        """Whether each pair of blocked vertices, taken alone, can be joined by a leg."""
        graph = self._whole_graph()
        free = _free(graph, blocked)
        _, label = components(graph.size, *graph.arcs[free[graph.arcs].all(axis=1)].T)

        def reached(vertex: int) -> set[int]:
            """Components of free nodes beside a vertex."""
            beside = graph.arcs[(graph.arcs == graph.vertex_nodes({vertex})).any(axis=1)]
            return set(label[beside[free[beside]]].tolist())

        return all(reached(first) & reached(second) for first, second in pairs)

    def _whole_graph(self) -> LegGraph:
        """Graph of the whole component, kept until the mesh is split again."""
        if self._whole is None or self._whole[0] != self._split.n_faces:
            working = self._split.assemble_faces(self._component)
            self._whole = self._split.n_faces, LegGraph(working, self._phi_fea)
        return self._whole[1]

    def _search(
        self, graph: LegGraph, source: int, target: int, blocked: BlockedElements, limit: float
    ) -> Leg | None:
        """The cheapest leg in a graph, penalties included; None if all exceed the cost limit."""
        through_midpoints = (graph.arcs >= graph.n_vertices).any(axis=1)
        costs = np.where(through_midpoints, MIDPOINT_DETOUR, 1.0) * graph.lengths(graph.arcs)
        checkpoint()
        avoided = graph.vertex_nodes(blocked.vertices | {source})
        ends = graph.vertex_nodes(blocked.ends | {source})
        beside = _closeness(graph.matrix(costs), avoided, ends, self._clearance)
        costs *= 1.0 + STRAND_PENALTY * beside[graph.arcs].mean(axis=1)

        (here,), (there,) = (graph.vertex_nodes({vertex}).tolist() for vertex in (source, target))
        free = _free(graph, blocked)
        free[[here, there]] = True
        costs[~free[graph.arcs].all(axis=1)] = np.inf
        _, previous = csgraph.dijkstra(
            graph.matrix(costs), indices=here, return_predecessors=True, limit=limit
        )
        if previous[there] < 0:
            return None
        path = _without_crossing(graph, path_between(previous, here, there))
        length = float(graph.lengths(np.array(list(pairwise(path)))).sum())
        return Leg([graph.node(index) for index in path], length)


def _free(graph: LegGraph, blocked: BlockedElements) -> BoolArray:
    """Whether a leg may pass through each node: interior nodes that are not blocked."""
    free = graph.interior.copy()
    free[graph.vertex_nodes(blocked.vertices)] = False
    # A leg through the midpoint of an edge of another leg would cross that leg.
    free[graph.midpoint_nodes(blocked.edges)] = False
    return free


def _without_crossing(graph: LegGraph, path: list[int]) -> list[int]:
    """Shorten a path that both runs along an edge and passes the midpoint of that edge.

    Such a path may be the cheapest where the penalty beside other legs varies strongly.
    """
    step_along = {frozenset(step): number for number, step in enumerate(pairwise(path))}
    for here, node in enumerate(path):
        if node >= graph.n_vertices:
            edge = frozenset(graph.edges[node - graph.n_vertices].tolist())
            if edge in step_along:
                start = step_along[edge]
                first, last = (here, start + 1) if here < start else (start, here)
                return _without_crossing(graph, path[: first + 1] + path[last:])
    return path


def _closeness(
    graph: sparse.csr_array, taken: IntArray, ends: IntArray, clearance: float
) -> FloatArray:
    """Closeness of each node to blocked nodes: 1 at distance 0, and 0 from the clearance on.

    Near an end of the path, only nodes whose nearest blocked node is not the end itself count as
    close. So the curve continues through its control points instead of turning back.
    """
    checkpoint()
    to_taken = csgraph.dijkstra(graph, indices=taken, limit=clearance, min_only=True)
    to_ends = csgraph.dijkstra(graph, indices=ends, min_only=True)
    beside = np.zeros(graph.shape[0])
    near = np.isfinite(to_taken) & (to_taken < to_ends)
    beside[near] = (1.0 - to_taken[near] / clearance) * (1.0 - to_taken[near] / to_ends[near])
    return beside
