"""Closes the surface at open edges that are meant to meet.

The triangles of a soup, the two sides of a seam and the parts of an export share no vertices, but
are meant as one surface. Vertices of open edges that are at the same position, or almost, are
joined. Patches of CAD models often meet along a border on which their vertices differ. Open edges
are divided at the vertices of other open edges that lie on them, so the edges on both sides have
the same ends.
"""

from __future__ import annotations

import numpy as np
from scipy.spatial import cKDTree

from ..geometry import tolerances
from ..geometry.array_types import BoolArray, FloatArray, IntArray
from ..geometry.grouping import distinct_rows, first_of_components, occurrences
from ..geometry.mesh import Mesh, edge_lengths, feet_on_edges, unique_edges
from ..progress import checkpoint
from .face_parts import FaceParts, whole_faces

ROUNDS = 64
"""Greatest number of rounds. In each, every open edge is divided once, near its middle."""

MOST_OPEN_EDGES = 300_000
"""Number of open edges above which T-junctions are not sought. Such a mesh is a heap of separate
faces rather than a few patches, and the search would take seconds."""


def joined_vertices(mesh: Mesh, parts: FaceParts) -> tuple[IntArray, FloatArray]:
    """Find the vertices of open edges of some distinct faces that count as one vertex.

    Vertices of edges with exactly one face are joined if their positions are equal, and those that
    are still at open edges then also if the gap between them is below `tolerances.GAP` and far
    smaller than the open edges there. Other vertices stay as they are, so closed surfaces that
    touch each other stay separate.

    Returns
    -------
    (V,) int array
        For each vertex the first of those that count as one with it.
    (V, 3) float array
        Positions; where a gap is closed, the mean of the positions joined.
    """
    place = _at_equal_positions(mesh.vertices, open_edges(mesh, parts))
    if not vertices_stay(place):
        parts = parts.with_faces(place[parts.faces]).distinct()
    edges = open_edges(mesh, parts)
    pairs = _across_gaps(mesh, edges)
    if not len(pairs):
        return place, mesh.vertices
    first = first_of_components(len(place), *pairs.T)
    moved = np.unique(pairs)
    total = np.zeros((len(place), 3))
    np.add.at(total, first[moved], mesh.vertices[moved])
    count = np.bincount(first[moved], minlength=len(place))
    vertices = mesh.vertices.copy()
    vertices[moved] = total[first[moved]] / count[first[moved], None]
    return first[place], vertices


def distinct_faces(mesh: Mesh) -> FaceParts:
    """The faces of a mesh; of faces with the same three corners, the first one."""
    every = whole_faces(mesh.faces)
    # Two faces with the same corners share at least two edges with no others, or an edge of many.
    one, other, third = mesh.face_neighbours.T
    alike = ((one == other) & (one >= 0)) | ((other == third) & (other >= 0))
    alike |= (third == one) & (third >= 0)
    return every.distinct() if mesh.has_nonmanifold_edges or alike.any() else every


def open_edges(mesh: Mesh, parts: FaceParts) -> IntArray:
    """Edges with exactly one of some faces of a mesh, (e, 2)."""
    if parts.faces is mesh.faces:
        edges, count = mesh.unpaired_edges  # already known, or needed later
    else:
        edges, count = unique_edges(parts.faces)
    return edges[count == 1]


def vertices_stay(place: IntArray) -> bool:
    """Whether no vertex is joined with an earlier one."""
    return bool((place == np.arange(len(place))).all())


def _at_equal_positions(vertices: FloatArray, edges: IntArray) -> IntArray:
    """For each vertex of an edge, the first such vertex at the same position, shape (V,)."""
    on_rim = np.zeros(len(vertices), dtype=bool)
    on_rim[edges] = True
    rim = np.flatnonzero(on_rim)
    place = np.arange(len(vertices))
    first, group = distinct_rows(vertices[rim])
    place[rim] = rim[first[group]]
    return place


def _across_gaps(mesh: Mesh, edges: IntArray) -> IntArray:
    """Pairs of vertices of open edges with a tiny gap between them, (p, 2)."""
    rim, ends = np.unique(edges, return_inverse=True)
    lengths = edge_lengths(mesh.vertices, edges)
    shortest = np.full(len(rim), np.inf)
    np.minimum.at(shortest, ends.reshape(-1, 2), lengths[:, None])
    tree = cKDTree(mesh.vertices[rim], balanced_tree=False, compact_nodes=False)
    checkpoint()
    pairs = tree.query_pairs(tolerances.GAP * mesh.diagonal, output_type="ndarray")
    gap = edge_lengths(mesh.vertices, rim[pairs])
    small = gap <= tolerances.GAP_SHARE * shortest[pairs].min(axis=1)
    return rim[pairs[small]].astype(np.int64)


def without_t_junctions(
    mesh: Mesh, vertices: FloatArray, parts: FaceParts
) -> tuple[FaceParts, IntArray]:
    """Divide faces so that open edges that lie on each other have the same ends.

    Parameters
    ----------
    mesh : Mesh
        The given mesh.
    vertices : (V, 3) float array
        Positions of its vertices.
    parts : FaceParts
        Its faces, or parts of them, with different corners each.

    Returns
    -------
    FaceParts
        The faces, some of them divided.
    (d, 3) int array
        Vertices at which edges were divided, and the two ends of the edge of each.
    """
    divisions = [np.zeros((0, 3), dtype=np.int64)]
    for _ in range(ROUNDS):
        checkpoint()
        edges = open_edges(mesh, parts)
        if not 3 <= len(edges) <= MOST_OPEN_EDGES:
            break
        edge, middle, share = _vertices_on_edges(vertices, edges, tolerances.GAP * mesh.diagonal)
        if not len(edge):
            break
        _, face = parts.at_edges(*edges[edge].T)  # one for each edge, as it is open
        # One division for each face; its other sides are divided in the next rounds.
        _, chosen = np.unique(face, return_index=True)
        start, end = edges[edge[chosen]].T
        parts = parts.divided(face[chosen], start, end, middle[chosen], share[chosen])
        divisions.append(np.stack([middle[chosen], start, end], axis=1))
    return parts, np.concatenate(divisions)


def _vertices_on_edges(
    vertices: FloatArray, edges: IntArray, tolerance: float
) -> tuple[IntArray, IntArray, FloatArray]:
    """Ends of open edges that lie on other open edges, of which a part coincides with their own.

    Returns
    -------
    (k,) int array
        Indices of the edges to divide, each once.
    (k,) int array
        A vertex on each of these edges, the nearest one to its middle.
    (k,) float array
        Its position, as a fraction from the first end to the second.
    """
    rim = np.unique(edges)
    start, end = vertices[edges[:, 0]], vertices[edges[:, 1]]
    middle, radius = 0.5 * (start + end), 0.5 * np.linalg.norm(end - start, axis=1)
    tree = cKDTree(vertices[rim], balanced_tree=False, compact_nodes=False)
    # The ends of an edge are as far from its middle as the radius, so any vertex on it is nearer.
    crossed = np.flatnonzero(tree.query(middle)[0] < radius - tolerance)
    checkpoint()
    inside = tree.query_ball_point(middle[crossed], radius[crossed] - tolerance)
    edge = np.repeat(crossed, np.array([len(each) for each in inside], dtype=np.int64))
    vertex = rim[np.array([number for each in inside for number in each], dtype=np.int64)]
    share, height = feet_on_edges(vertices, edges[edge], vertex)
    margin = 2.0 * radius[edge] * np.minimum(share, 1.0 - share)
    on_edge = (height <= tolerance) & (height <= tolerances.GAP_SHARE * margin)
    on_edge[on_edge] = _has_edge_along(vertices, edges, edge[on_edge], vertex[on_edge], tolerance)
    order = np.lexsort((np.abs(share - 0.5), edge))
    order = order[on_edge[order]]
    chosen = order[np.diff(edge[order], prepend=-1) > 0]
    return edge[chosen], vertex[chosen], share[chosen]


def _has_edge_along(
    vertices: FloatArray, edges: IntArray, edge: IntArray, vertex: IntArray, tolerance: float
) -> BoolArray:
    """Whether an open edge begins at each vertex, (k,), that overlaps the edge it lies on, (k,)."""
    rank, place = occurrences(edges.ravel(), vertex)
    other_end, on = edges[place // 2, 1 - place % 2], edges[edge[rank]]
    # Either end of one edge lies on the other edge.
    share, height = feet_on_edges(vertices, on, other_end)
    found = (height <= tolerance) & (share >= 0.0) & (share <= 1.0)
    for end in on.T:
        share, height = feet_on_edges(vertices, np.stack([vertex[rank], other_end], axis=1), end)
        found |= (height <= tolerance) & (share > 0.0) & (share < 1.0)
    return np.isin(np.arange(len(vertex)), rank[found & (place // 2 != edge[rank])])
