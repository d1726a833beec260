"""Separates a surface along curves: the two sides of a curve get separate vertices."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..geometry.array_types import FloatArray, IntArray
from ..geometry.mesh import Mesh, adjacent_sides, joined_corners, side_corners, sides_among
from .cut import CutMesh


@dataclass(frozen=True)
class PartedMesh:
    """A cut mesh that is disconnected along its curve.

    Attributes
    ----------
    vertices : (V', 3) float array
        Vertices of the cut mesh, followed by duplicates of those along the curve.
    faces : (F', 3) int array
        Faces of the cut mesh, in the same order.
    source_vertex : (V',) int array
        The vertex of the cut mesh from which each vertex is copied.
    part : (F',) int array
        Index of the connected component of each face.
    """

    vertices: FloatArray
    faces: IntArray
    source_vertex: IntArray
    part: IntArray


def part_mesh(cut: CutMesh) -> PartedMesh:
    """Separate a cut mesh along its curve.

    End points of an open curve are not duplicated inside the surface, so the curve becomes a slit.
    A curve that bounds no region leaves the surface connected, with one or two additional boundary
    loops.

    Parameters
    ----------
    cut : CutMesh
        From `cut_mesh`.

    Returns
    -------
    PartedMesh
    """
    n_vertices, vertex = len(cut.vertices), cut.faces.ravel()
    # Two corners at a vertex stay joined if their faces share an uncut edge at the vertex.
    ends = side_corners(cut.faces)
    one, other = adjacent_sides(cut.faces)
    uncut = ~sides_among(cut.faces, cut.chain_edges)[one]
    # At a vertex off the curve all corners stay joined, even if the vertex is non-manifold.
    order = np.argsort(vertex, kind="stable")
    off = ~np.isin(vertex[order[1:]], cut.chain_edges)
    beside = np.flatnonzero((np.diff(vertex[order]) == 0) & off)
    rows = np.concatenate([ends[one[uncut]].ravel(), order[beside]])
    columns = np.concatenate([ends[other[uncut]].ravel(), order[beside + 1]])
    group, owner = joined_corners(cut.faces, rows, columns)
    # The first group of each vertex keeps the index of the vertex.
    by_vertex = np.argsort(owner, kind="stable")
    again = np.concatenate([[False], np.diff(owner[by_vertex]) == 0])
    number = owner.copy()
    number[by_vertex[again]] = n_vertices + np.arange(again.sum())
    source_vertex = np.concatenate([np.arange(n_vertices), owner[by_vertex[again]]])
    vertices, faces = cut.vertices[source_vertex], number[group]
    _, part = np.unique(Mesh(vertices, faces).face_component, return_inverse=True)
    return PartedMesh(vertices, faces, source_vertex, part)
