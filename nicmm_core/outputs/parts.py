"""A surface parted along a curve: either side gets its own vertices."""

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
    """A cut mesh whose two sides of the curve are no longer joined.

    Attributes
    ----------
    vertices : (V', 3) float array
        Those of the cut mesh, then the second and further copies along the curve.
    faces : (F', 3) int array
        As many as the cut mesh has, in the same order.
    source_vertex : (V',) int array
        Which vertex of the cut mesh each one is or copies.
    part : (F',) int array
        Which connected part each face belongs to, from 0 on.
    """

    vertices: FloatArray
    faces: IntArray
    source_vertex: IntArray
    part: IntArray


def part_mesh(cut: CutMesh) -> PartedMesh:
    """Part a mesh along the curve that it was cut along.

    The ends of an open curve inside the surface stay single, so the surface opens like a slit. A
    curve that bounds nothing leaves the surface in one part with one or two more boundaries.

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
    # Corners at one vertex stay joined where their faces share an edge there that is not cut.
    one, other = (
        (3 * side[:, None] + (cut.faces[side][:, None] == edges[:, :, None]).argmax(axis=2)).ravel()
        for side in faces.T
    )
    on_chain = np.zeros(n_vertices, dtype=bool)
    on_chain[cut.chain] = True
    vertex = cut.faces.ravel()
    # Elsewhere all corners of a vertex stay together, whatever the surface is like there.
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
    """Connected parts of faces that share vertices, (F,)."""
    ends = np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]]])
    size = int(faces.max()) + 1
    graph = sparse.coo_array((np.ones(len(ends)), (ends[:, 0], ends[:, 1])), shape=(size, size))
    _, label = csgraph.connected_components(graph, directed=False)
    return np.unique(label[faces[:, 0]], return_inverse=True)[1]
