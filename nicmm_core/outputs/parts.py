"""A surface separated along a curve: each side gets its own vertices."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy import sparse
from scipy.sparse import csgraph

from ..geometry.array_types import FloatArray, IntArray
from .cut import CutMesh
from .shared_sides import shared_sides


@dataclass(frozen=True)
class PartedMesh:
    """A cut mesh in which both sides of the curve are disconnected.

    Attributes
    ----------
    vertices : (V', 3) float array
        Those of the cut mesh, then their copies along the curve.
    faces : (F', 3) int array
        Faces of the cut mesh, in the same order.
    source_vertex : (V',) int array
        The vertex of the cut mesh of each vertex.
    part : (F',) int array
        The connected component of each face, from 0.
    """

    vertices: FloatArray
    faces: IntArray
    source_vertex: IntArray
    part: IntArray


def part_mesh(cut: CutMesh) -> PartedMesh:
    """Separate a cut mesh along its curve.

    Ends of an open curve inside the surface are not duplicated, so it opens a slit. A curve that
    bounds no region leaves the surface connected, with one or two more boundaries.

    Parameters
    ----------
    cut : CutMesh
        From `cut_mesh`.

    Returns
    -------
    PartedMesh
    """
    n_vertices, n_corners = len(cut.vertices), cut.faces.size
    shared = shared_sides(cut.faces, cut.chain_edges)
    edges, faces = shared.edges[~shared.on_chain], shared.faces[~shared.on_chain]
    # Corners at a vertex stay joined if their faces share an uncut edge there.
    one, other = (
        (3 * side[:, None] + (cut.faces[side][:, None] == edges[:, :, None]).argmax(axis=2)).ravel()
        for side in faces.T
    )
    on_chain = np.zeros(n_vertices, dtype=bool)
    on_chain[cut.chain] = True
    vertex = cut.faces.ravel()
    # Off the curve, all corners of a vertex stay joined, even at non-manifold vertices.
    order = np.argsort(vertex, kind="stable")
    beside = np.flatnonzero((np.diff(vertex[order]) == 0) & ~on_chain[vertex[order[1:]]])
    rows = np.concatenate([one, order[beside]])
    columns = np.concatenate([other, order[beside + 1]])
    graph = sparse.coo_array((np.ones(len(rows)), (rows, columns)), shape=(n_corners,) * 2)
    n_groups, group = csgraph.connected_components(graph, directed=False)
    # The first group of each vertex keeps its number.
    first = np.full(n_groups, n_corners)
    np.minimum.at(first, group, np.arange(n_corners))
    owner = vertex[first]
    by_vertex = np.argsort(owner, kind="stable")
    again = np.concatenate([[False], np.diff(owner[by_vertex]) == 0])
    number = np.empty(n_groups, dtype=np.int64)
    number[by_vertex[~again]] = owner[by_vertex[~again]]
    number[by_vertex[again]] = n_vertices + np.arange(again.sum())
    source_vertex = np.concatenate([np.arange(n_vertices), owner[by_vertex[again]]])
    parted = number[group].reshape(-1, 3)
    return PartedMesh(cut.vertices[source_vertex], parted, source_vertex, _parts(parted))


def _parts(faces: IntArray) -> IntArray:
    """Connected components of faces by shared vertices, (F,)."""
    ends = np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]]])
    size = int(faces.max()) + 1
    graph = sparse.coo_array((np.ones(len(ends)), (ends[:, 0], ends[:, 1])), shape=(size, size))
    _, label = csgraph.connected_components(graph, directed=False)
    return np.unique(label[faces[:, 0]], return_inverse=True)[1]
