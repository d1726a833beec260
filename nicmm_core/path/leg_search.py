"""The shortest path for one leg: Dijkstra's algorithm over free vertices and edge midpoints.

Midpoints connect every face to its neighbours across all edges that belong neither to another leg
nor to the boundary. So a leg is found wherever the remaining surface is connected, however few
vertices it has.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy import sparse
from scipy.sparse import csgraph

from ..geometry.array_types import BoolArray, FloatArray, IntArray
from ..geometry.grouping import components, path_between
from ..geometry.mesh import Mesh, side_keys, unique_edges
from ..maps.guidance import length_factor
from ..progress import checkpoint
from .leg_graph import Node, Patch
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
    """Vertices and edges that a leg must avoid.

    Attributes
    ----------
    vertices : (q,) int array
        Vertices of other legs, and waypoints that do not belong to this leg.
    edges : (p, 2) int array
        Edges of other legs, which must not be crossed.
    ends : (e,) int array
        Waypoints at which exactly one leg ends so far, from which the path may continue.
    """

    vertices: IntArray
    edges: IntArray
    ends: IntArray


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
        corners = mesh.vertices[mesh.faces]
        sides = np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2).max(axis=1)
        self._longest_edge = np.zeros(len(mesh.vertices))
        np.maximum.at(self._longest_edge, mesh.faces, sides[:, None])
        self._kept: tuple[int, Patch] | None = None
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
            whole = inside.sum() >= 0.5 * self._component.sum()
            limit = np.inf if whole else self._least_factor * reach
            patch = self._whole() if whole else self._patch(inside)
            leg = self._search(patch, source, target, blocked, limit)
            if leg is not None or whole:
                return leg
            reach *= 2.0

    def are_joinable(self, pairs: list[tuple[int, int]], blocked: BlockedElements) -> bool:
        """Whether each pair of vertices, taken alone, can be joined by a leg."""
        patch = self._whole()
        free = self._free(patch, blocked, np.zeros(0, dtype=np.int64))
        free_arcs = patch.arcs[free[patch.arcs].all(axis=1)]
        _, label = components(patch.size, *free_arcs.T)
        whole = patch.graph(patch.lengths)

        def reached(vertex: int) -> set[int]:
            (index,) = patch.node_indices(np.array([vertex]))
            around = whole[[int(index)]].indices
            return set(label[around[free[around]]].tolist())

        return all(reached(first) & reached(second) for first, second in pairs)

    def _search(
        self, patch: Patch, source: int, target: int, blocked: BlockedElements, limit: float
    ) -> Leg | None:
        """The cheapest leg on a patch, penalties included; None if all exceed the cost limit."""
        lengths = np.where(patch.through_midpoints, MIDPOINT_DETOUR, 1.0) * patch.lengths
        checkpoint()
        avoided = patch.node_indices(np.append(blocked.vertices, source))
        ends = patch.node_indices(np.append(blocked.ends, source))
        beside = _closeness(patch.graph(lengths), avoided, ends, self._clearance)
        lengths *= 1.0 + STRAND_PENALTY * beside[patch.arcs].mean(axis=1)

        (here,), (there,) = (patch.node_indices(np.array([vertex])) for vertex in (source, target))
        free = self._free(patch, blocked, np.array([here, there]))
        lengths[~free[patch.arcs].all(axis=1)] = np.inf
        _, previous = csgraph.dijkstra(
            patch.graph(lengths), indices=here, return_predecessors=True, limit=limit
        )
        if previous[there] < 0:
            return None
        path = self._without_crossing(patch, path_between(previous, int(here), int(there)))
        steps = np.stack([path[:-1], path[1:]], axis=1)
        length = float(patch.step_lengths(steps).sum())
        return Leg([patch.node(index) for index in path], length)

    def _whole(self) -> Patch:
        """Graph of the whole component, cached until the mesh is split again."""
        if self._kept is None or self._kept[0] != self._split.n_faces:
            self._kept = self._split.n_faces, self._patch(self._component)
        return self._kept[1]

    def _patch(self, inside: BoolArray) -> Patch:
        """Graph of the living faces inside selected input faces.

        The arcs are the edges, the two halves of each edge, and the three lines between edge
        midpoints in every face. Lines from a vertex to the midpoint of the opposite edge are
        omitted: with them, splitting the edges of a path one by one would not always turn the lines
        of the path into edges. Boundary edges have no arcs, because a path along the boundary would
        separate the surface.
        """
        vertices, faces = np.unique(self._split.living_faces(inside), return_inverse=True)
        faces = faces.reshape(-1, 3)
        edges, count = unique_edges(faces)
        n_vertices = len(vertices)
        corner = self._split.positions(vertices)
        node_position = np.concatenate([corner, corner[edges].mean(axis=1)])
        keys = side_keys(faces, n_vertices).reshape(-1, 3)[:, [2, 0, 1]]
        side_node = n_vertices + np.searchsorted(edges @ [n_vertices, 1], keys)
        inner = count > 1
        midpoint = n_vertices + np.flatnonzero(inner)
        arcs = np.concatenate(
            [
                edges[inner],
                np.stack([edges[inner, 0], midpoint], axis=1),
                np.stack([edges[inner, 1], midpoint], axis=1),
                side_node[:, [0, 1]],
                side_node[:, [1, 2]],
                side_node[:, [2, 0]],
            ]
        )
        weight = np.ones(len(node_position))
        if self._phi_fea is not None:
            phi_fea = self._phi_fea_at(vertices)
            at_nodes = np.concatenate([phi_fea, phi_fea[edges].mean(axis=1)])
            weight = length_factor(at_nodes)
        return Patch(
            vertices=vertices,
            edges=edges,
            on_rim=~inner,
            positions=node_position,
            weight=weight,
            arcs=arcs,
            through_midpoints=np.arange(len(arcs)) >= len(midpoint),
        )

    def _free(self, patch: Patch, blocked: BlockedElements, ends: IntArray) -> BoolArray:
        """Whether a leg may use each node: its ends, and interior nodes that are not blocked."""
        n_vertices = len(patch.vertices)
        free = np.ones(patch.size, dtype=bool)
        free[patch.edges[patch.on_rim]] = False
        free[n_vertices + np.flatnonzero(patch.on_rim)] = False
        free[patch.node_indices(blocked.vertices)] = False
        if len(blocked.edges):
            # A leg through the midpoint of an edge of another leg would cross that leg.
            size = self._split.n_vertices
            keys = patch.vertices[patch.edges] @ [size, 1]
            on_path = np.isin(keys, np.sort(blocked.edges, axis=1) @ [size, 1])
            free[n_vertices + np.flatnonzero(on_path)] = False
        free[ends] = True
        return free

    def _phi_fea_at(self, vertices: IntArray) -> FloatArray:
        """φ_fea at vertices of the split mesh, interpolated at inserted vertices."""
        assert self._phi_fea is not None
        n_input = len(self._mesh.vertices)
        result = self._phi_fea[np.minimum(vertices, n_input - 1)]
        for index in np.flatnonzero(vertices >= n_input).tolist():
            weights = self._split.weights(int(vertices[index]))
            result[index] = sum(w * self._phi_fea[vertex] for vertex, w in weights.items())
        return result

    def _without_crossing(self, patch: Patch, path: list[int]) -> list[int]:
        """Shorten a path that both runs along an edge and passes the midpoint of that edge.

        Such a path may be the cheapest where the penalty beside other legs varies strongly.
        """
        at = {node_index: number for number, node_index in enumerate(path)}
        for node_index in path:
            if node_index < len(patch.vertices):
                continue
            low, high = sorted(
                at.get(int(end), -2 - side)
                for side, end in enumerate(patch.edges[node_index - len(patch.vertices)])
            )
            if low >= 0 and high == low + 1:
                here = at[node_index]
                first, last = (here, high) if here < low else (low, here)
                return self._without_crossing(patch, path[: first + 1] + path[last:])
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
