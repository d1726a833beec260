"""A surface separated along a curve: each side gets its own vertices."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..geometry.array_types import FloatArray, IntArray
from ..geometry.grouping import components
from ..geometry.mesh import adjacent_sides, joined_corners, side_corners, sides_among
from .cut import CutMesh


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
    n_vertices, vertex = len(cut.vertices), cut.faces.ravel()
    # Corners at a vertex stay joined if their faces share an uncut edge there.
    ends = side_corners(cut.faces)
    one, other = adjacent_sides(cut.faces)
    uncut = ~sides_among(cut.faces, cut.chain_edges)[one]
    # Off the curve, all corners of a vertex stay joined, even at non-manifold vertices.
    order = np.argsort(vertex, kind="stable")
    off = ~np.isin(vertex[order[1:]], cut.chain)
    beside = np.flatnonzero((np.diff(vertex[order]) == 0) & off)
    rows = np.concatenate([ends[one[uncut]].ravel(), order[beside]])
    columns = np.concatenate([ends[other[uncut]].ravel(), order[beside + 1]])
    group, owner = joined_corners(cut.faces, rows, columns)
    # The first group of each vertex keeps its number.
    by_vertex = np.argsort(owner, kind="stable")
    again = np.concatenate([[False], np.diff(owner[by_vertex]) == 0])
    number = owner.copy()
    number[by_vertex[again]] = n_vertices + np.arange(again.sum())
    source_vertex = np.concatenate([np.arange(n_vertices), owner[by_vertex[again]]])
    parted = number[group]
    return PartedMesh(cut.vertices[source_vertex], parted, source_vertex, _parts(parted))


def _parts(faces: IntArray) -> IntArray:
    """Connected components of faces by shared vertices, (F,)."""
    one, other = faces[:, :2].ravel(), faces[:, 1:].ravel()
    _, label = components(int(faces.max()) + 1, one, other)
    return np.unique(label[faces[:, 0]], return_inverse=True)[1]
