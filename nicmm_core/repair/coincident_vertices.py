"""Joins vertices of open edges that are at the same position, or almost.

The triangles of a soup, the two sides of a seam and the parts of an export share no vertices, but
are meant as one surface.
"""

from __future__ import annotations

import numpy as np
from scipy.spatial import cKDTree

from ..geometry import tolerances
from ..geometry.array_types import FloatArray, IntArray
from ..geometry.grouping import distinct_rows, first_of_components
from ..geometry.mesh import Mesh, edge_lengths, unique_edges
from ..progress import checkpoint
from .face_parts import FaceParts, whole_faces


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
