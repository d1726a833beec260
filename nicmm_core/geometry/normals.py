"""Computes normals of a surface at its vertices, and finds folded faces."""

from __future__ import annotations

import igl
import numpy as np

from ..progress import checkpoint
from .array_types import BoolArray, FloatArray, IntArray
from .mesh import Mesh, joined_corners, side_corners
from .vectors import unit


def vertex_normals(vertices: FloatArray, faces: IntArray) -> FloatArray:
    """Unit normals weighted by corner angle, shape (n, 3); zero where they cancel."""
    checkpoint()
    normals = igl.per_vertex_normals(vertices, faces, igl.PER_VERTEX_NORMALS_WEIGHTING_TYPE_ANGLE)
    return np.nan_to_num(normals)


def unsigned_normals(mesh: Mesh) -> FloatArray:
    """Unit normals at the vertices, up to sign, shape (V, 3).

    Face normals are weighted by corner angle. At corners of folded faces, for example beside a
    vertex pushed across an edge, they are weighted by area instead, since their sum then does not
    change when a vertex moves within the plane of its neighbours. Where faces of opposite
    orientation meet, as on a Möbius strip, the faces around a vertex are first turned to one side.
    """
    return normals_and_folds(mesh)[0]


def normals_and_folds(mesh: Mesh) -> tuple[FloatArray, BoolArray | None]:
    """`unsigned_normals`, and whether each face is folded, (F,), or None if no face is.

    A folded face faces away from the normals of its corners. Faces at vertices where opposite
    orientations meet never count as folded, since signs have no meaning there.
    """
    normals = vertex_normals(mesh.vertices, mesh.faces)
    mixed = mesh.unoriented_vertices
    against = _facing(mesh, normals) <= 0.0  # a zero normal counts too
    if not len(mixed) and not against.any():
        return normals, None
    folded = np.setdiff1d(mesh.faces[against.any(axis=1)], mixed)
    area_vector = mesh.vertex_faces[folded] @ (mesh.face_areas[:, None] * mesh.face_normals)
    there = area_vector.any(axis=1)
    normals[folded[there]] = unit(area_vector[there].T).T
    if len(mixed):
        normals[mixed] = _normals_on_double_cover(mesh)[mixed]
    return normals, folds(mesh, normals)


def folds(mesh: Mesh, normals: FloatArray) -> BoolArray | None:
    """Whether each face is folded, (F,), given the normals of the vertices; None if no face is."""
    against = _facing(mesh, normals).sum(axis=1) < 0.0
    if not against.any():
        return None
    faces = against & ~np.isin(mesh.faces, mesh.unoriented_vertices).any(axis=1)
    return faces if faces.any() else None


def _facing(mesh: Mesh, normals: FloatArray) -> FloatArray:
    """Cosines between the normal of each face and the normals of its corners, (F, 3)."""
    of_corners = [np.take(normals, corner, axis=0) for corner in mesh.faces.T]
    return np.stack([np.einsum("fd,fd->f", each, mesh.face_normals) for each in of_corners], axis=1)


def _normals_on_double_cover(mesh: Mesh) -> FloatArray:
    """Normals at the vertices of any mesh up to sign, (V, 3), weighted by corner angle.

    The orientable double cover has every face twice, once in either orientation. Of the vertices of
    the cover over one vertex, the one with its first corner counts.
    """
    n_corners = mesh.faces.size
    corner = np.arange(n_corners)
    reverse = n_corners + corner.reshape(-1, 3)[:, [0, 2, 1]].ravel()  # the same corner there
    side = np.flatnonzero(mesh.opposite_sides > corner)
    across = mesh.opposite_sides[side]
    ends = side_corners(mesh.faces)
    rises = (mesh.faces[:, [1, 2, 0]] < mesh.faces[:, [2, 0, 1]]).ravel()
    alike = (rises[side] == rises[across])[:, None]
    one, other = ends[side], ends[across]
    joined_to = np.where(alike, reverse[other], other), np.where(alike, other, reverse[other])
    group, vertex = joined_corners(
        np.concatenate([mesh.faces, mesh.faces[:, [0, 2, 1]]]),
        np.concatenate([one, reverse[one]]).ravel(),
        np.concatenate(joined_to).ravel(),
    )
    of_groups = vertex_normals(mesh.vertices[vertex], group)
    normals = np.zeros(mesh.vertices.shape)
    first = np.arange(n_corners)[::-1]  # the first assignment of each vertex comes last
    normals[mesh.faces.ravel()[first]] = of_groups[group.ravel()[first]]
    return normals
