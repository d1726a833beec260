"""The initial path (section 3.1): mesh edges through the control points, closed or open.

Plain shortest paths between consecutive points share edges and cross, and then no signed
distance belongs to them. Here each path avoids every vertex that an earlier one took, and where
vertices are too few it runs through the midpoints of edges, which are then split virtually.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy import sparse
from scipy.sparse import csgraph

from .array_types import FloatArray, IntArray
from .band_refinement import refine_along
from .errors import ArgumentError, UnreachableError
from .mesh import Mesh
from .surface_points import SurfacePoints
from .virtual_splits import SplitMesh, WorkingMesh
from .visiting_order import shortest_order

ORDERS = ("given", "shortest")

MIDPOINT_DETOUR = 2.0
"""Length of a way through edge midpoints, relative to the same length along edges.

Above 1 so that the mesh is split only where edges alone would make a long detour.
"""

STRAND_CLEARANCE = 0.1
"""Distance, in square roots of the component's area, within which a path shuns earlier ones."""

STRAND_PENALTY = 4.0
"""How much longer a way right beside an earlier path counts.

Two strands of a loop then pass a thin limb on opposite sides instead of side by side, which
leaves the level set room on both sides.
"""

LEAST_WEIGHT = 0.1
"""Least factor that alignment gives to a length; at 0 any detour inside a region would be free."""


@dataclass(frozen=True)
class InitialLoop:
    """A simple path of edges of a working mesh, closed or open.

    Attributes
    ----------
    vertices : (l,) int array
        Working vertices in order, the first of a closed path not repeated at the end. No two of
        them are joined by an edge that is not part of the path.
    control_vertices : (k,) int array
        The working vertex of each control point, in the order visited.
    order : (k,) int array
        Which of the caller's control points each of them is.
    edge_length : float
        Mean length of the edges at the loop: the h that band and delta are measured in.
    zigzag : float
        Length of the steps in which the loop follows the mesh, which smoothing has to remove.
    closed : bool
    """

    vertices: IntArray
    control_vertices: IntArray
    order: IntArray
    edge_length: float
    zigzag: float
    closed: bool = True

    def neighbours(self, place: int) -> list[int]:
        """Vertices before and after the one at a place of the path."""
        places = [place - 1, place + 1]
        if self.closed:
            return [int(self.vertices[i % len(self.vertices)]) for i in places]
        return [int(self.vertices[i]) for i in places if 0 <= i < len(self.vertices)]


def build_initial_loop(
    mesh: Mesh,
    points: SurfacePoints,
    order: str,
    importance: FloatArray | None = None,
    closed: bool = True,
) -> tuple[WorkingMesh, InitialLoop]:
    """Insert the control points and join them by edge paths that do not touch one another.

    Parameters
    ----------
    mesh : Mesh
    points : SurfacePoints
        At least three, or two of an open path, on one component.
    order : {"given", "shortest"}
        Visit the points as given, or in the shortest order.
    importance : (V,) float array, optional
        φ_fea at the input vertices. Lengths count times its square, as the curve's does in Eq. 7,
        so the loop goes round obstacles and along alignment from the start.
    closed : bool
        Whether the path returns from the last point to the first.

    Returns
    -------
    WorkingMesh
        The component of the points, split so that the loop runs along edges.
    InitialLoop

    Raises
    ------
    UnreachableError
        If the paths so far cut the surface between two consecutive points.
    ArgumentError
        If ``order`` is neither of the two.
    """
    if order not in ORDERS:
        raise ArgumentError(f"order is {order!r}; choose one of {', '.join(map(repr, ORDERS))}")
    split = SplitMesh(mesh)
    component = int(mesh.face_component[points.faces[0]])
    controls = split.insert_points(points)
    visit = np.arange(len(points))
    if order == "shortest":
        visit = shortest_order(_edge_distances(split, component, controls), closed)
    controls = controls[visit]
    _separate_controls(split, controls)

    path: list[int] = [int(controls[0])]
    for leg in range(len(controls) - (not closed)):
        target = int(controls[(leg + 1) % len(controls)])
        blocked = (set(path) | {int(control) for control in controls}) - {path[-1], target}
        nodes = _shortest_free_path(split, component, target, path, blocked, importance)
        if nodes is None:
            here, there = int(visit[leg]), int(visit[(leg + 1) % len(visit)])
            raise UnreachableError(
                f"control_points[{here}] cannot be joined to control_points[{there}] without "
                "crossing the curve through the points before them; visit the points in another "
                'order, for example with order="shortest"'
            )
        path += _split_along(split, nodes)[1:]
    loop, zigzag = refine_along(split, component, path[:-1] if closed else path, closed)
    _separate_strands(split, loop, closed)
    working, renumbered = split.assemble(component)
    vertices = renumbered[loop]
    beside = np.isin(working.edges, vertices).any(axis=1)
    edge_length = float(working.edge_lengths[beside].mean())
    return working, InitialLoop(vertices, renumbered[controls], visit, edge_length, zigzag, closed)


def _edge_distances(split: SplitMesh, component: int, controls: IntArray) -> FloatArray:
    """Distances along edges between control points, shape (k, k)."""
    working, renumbered = split.assemble(component)
    sources = renumbered[controls]
    return csgraph.dijkstra(working.edge_graph(), directed=False, indices=sources)[:, sources]


def _shortest_free_path(
    split: SplitMesh,
    component: int,
    target: int,
    taken: list[int],
    blocked: set[int],
    importance: FloatArray | None,
) -> list[int | tuple[int, int]] | None:
    """Dijkstra's path from the last vertex taken over vertices and edge midpoints that are free.

    Returns
    -------
    list or None
        Vertices, and edges (pairs of vertices) for their midpoints, from there to the target; None
        when there is no way.
    """
    working, renumbered = split.assemble(component)
    n_vertices = len(working.vertices)
    edges = working.edges
    path_vertices = renumbered[np.array(taken, dtype=np.int64)]
    graph = _vertex_and_midpoint_graph(working, edges)
    if importance is not None:
        graph = _weighed(graph, working.interpolation @ importance, edges)
    clearance = STRAND_CLEARANCE * working.face_areas.sum() ** 0.5
    avoided = np.concatenate([path_vertices, renumbered[sorted(blocked)]])
    graph = _shunning(graph, avoided, path_vertices[[0, -1]], clearance)

    free = np.ones(graph.shape[0], dtype=bool)
    free[renumbered[list(blocked)]] = False
    # The midpoint of an edge of the path so far would cross it, and so would the edge itself,
    # whose ends are blocked anyway unless it is the last one.
    on_path = np.sort(np.stack([path_vertices[:-1], path_vertices[1:]], axis=1), axis=1)
    free[n_vertices + _rows_in(edges, on_path, n_vertices)] = False
    keep = np.flatnonzero(free)
    position = np.full(len(free), -1)
    position[keep] = np.arange(len(keep))
    reduced = graph[keep][:, keep]
    source, sink = position[renumbered[taken[-1]]], position[renumbered[target]]
    _, previous = csgraph.dijkstra(reduced, indices=source, return_predecessors=True)
    if previous[sink] < 0:
        return None
    nodes = [sink]
    while nodes[-1] != source:
        nodes.append(previous[nodes[-1]])

    original = np.flatnonzero(renumbered >= 0)
    path: list[int | tuple[int, int]] = []
    for node in keep[nodes[::-1]]:
        if node < n_vertices:
            path.append(int(original[node]))
        else:
            a, b = original[edges[node - n_vertices]]
            path.append((int(a), int(b)))
    return path


def _vertex_and_midpoint_graph(working: WorkingMesh, edges: IntArray) -> sparse.csr_array:
    """Graph whose nodes are the vertices and then the midpoints of the edges.

    Arcs are edges, halves of edges, and the three lines between midpoints in every face. Lines
    from a vertex to the midpoint opposite are left out: with them, splitting the edges of a path
    one after the other would not always leave the path's own lines as edges.
    """
    n_vertices, n_edges = len(working.vertices), len(edges)
    middle = working.vertices[edges].mean(axis=1)
    node_position = np.concatenate([working.vertices, middle])
    sides = np.sort(working.faces[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2), axis=1)
    side_node = n_vertices + _rows_in(edges, sides, n_vertices).reshape(-1, 3)
    midpoint = n_vertices + np.arange(n_edges)
    through_midpoints = np.concatenate(
        [
            np.stack([edges[:, 0], midpoint], axis=1),
            np.stack([edges[:, 1], midpoint], axis=1),
            side_node[:, [0, 1]],
            side_node[:, [1, 2]],
            side_node[:, [2, 0]],
        ]
    )
    arcs = np.concatenate([edges, through_midpoints])
    length = np.linalg.norm(node_position[arcs[:, 0]] - node_position[arcs[:, 1]], axis=1)
    length[n_edges:] *= MIDPOINT_DETOUR
    both_ways = np.concatenate([arcs, arcs[:, ::-1]])
    size = n_vertices + n_edges
    entries = (np.concatenate([length, length]), (both_ways[:, 0], both_ways[:, 1]))
    return sparse.csr_array(sparse.coo_array(entries, shape=(size, size)))


def _weighed(graph: sparse.csr_array, importance: FloatArray, edges: IntArray) -> sparse.csr_array:
    """Multiply lengths by the square of φ_fea, given at the vertices."""
    at_nodes = np.concatenate([importance, importance[edges].mean(axis=1)])
    square = np.maximum(at_nodes**2, LEAST_WEIGHT)
    return _stretched(graph, square)


def _stretched(graph: sparse.csr_array, factor: FloatArray) -> sparse.csr_array:
    """Multiply the length of each arc by the mean factor of its ends."""
    arcs = graph.tocoo()
    length = arcs.data * 0.5 * (factor[arcs.row] + factor[arcs.col])
    return sparse.csr_array(sparse.coo_array((length, (arcs.row, arcs.col)), shape=graph.shape))


def _shunning(
    graph: sparse.csr_array, taken: IntArray, ends: IntArray, clearance: float
) -> sparse.csr_array:
    """Lengthen the arcs that come nearer to the nodes taken than the clearance.

    Around the ends of the path so far only the side that the path lies on is shunned: there the
    nearest taken node is not the end itself. So the curve goes on through its control points
    instead of turning back at them.
    """
    to_taken = csgraph.dijkstra(graph, indices=taken, limit=clearance, min_only=True)
    to_ends = csgraph.dijkstra(graph, indices=ends, min_only=True)
    beside = np.zeros(graph.shape[0])
    near = np.isfinite(to_taken) & (to_taken < to_ends)
    beside[near] = (1.0 - to_taken[near] / clearance) * (1.0 - to_taken[near] / to_ends[near])
    return _stretched(graph, 1.0 + STRAND_PENALTY * beside)


def _rows_in(edges: IntArray, wanted: IntArray, n_vertices: int) -> IntArray:
    """Row of each wanted edge in the sorted edge array."""
    keys = edges[:, 0] * n_vertices + edges[:, 1]
    return np.searchsorted(keys, wanted[:, 0] * n_vertices + wanted[:, 1])


def _split_along(split: SplitMesh, nodes: list[int | tuple[int, int]]) -> list[int]:
    """Split the edges whose midpoints a path uses; the path as vertices, each joined to the next.

    Where a path passes all three edges of a face, a line from an earlier midpoint may lie across
    a later step; there the diagonal of the two faces is exchanged.
    """
    path = [node if isinstance(node, int) else split.split_edge(*node) for node in nodes]
    for start, end in zip(path[:-1], path[1:], strict=True):
        if not split.join(start, end):
            raise UnreachableError(
                "control_points: the paths between them come too close to one another for this "
                "mesh; use a finer mesh or fewer points"
            )
    return path


def _separate_controls(split: SplitMesh, controls: IntArray) -> None:
    """Split the edges that join two control points, so that no two of them are neighbours."""
    wanted = {int(control) for control in controls}
    for control in sorted(wanted):
        for face in sorted(split.faces_around(control)):
            for other in sorted(wanted.intersection(split.corners(face)) - {control}):
                if split.faces_around(control) & split.faces_around(other):
                    split.split_edge(control, other)


def _separate_strands(split: SplitMesh, loop: list[int], closed: bool) -> None:
    """Give both sides of the loop vertices of their own wherever two strands are neighbours.

    An edge that joins two loop vertices without being part of the loop is split, and so is a face
    whose three edges all are. Afterwards the two sides of the loop are components of the
    remaining vertices, so flood fill can tell them apart.
    """
    on_loop = set(loop)
    onward = loop[1:] + loop[:1] if closed else loop[1:]
    loop_edges = {frozenset(edge) for edge in zip(loop, onward, strict=False)}
    for vertex in loop:
        for face in sorted(split.faces_around(vertex)):
            if face not in split.faces_around(vertex):
                continue
            a, b, c = split.corners(face)
            sides = {frozenset(side) for side in ((a, b), (b, c), (c, a))}
            if sides <= loop_edges:
                split.split_face(face)
                continue
            for side in sorted(tuple(sorted(s)) for s in sides - loop_edges):
                if on_loop.issuperset(side):
                    split.split_edge(*side)
                    break
