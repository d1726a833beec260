"""Unit normals of the surface at points, whatever the orientation of single faces."""

from __future__ import annotations

import numpy as np

from ..geometry.array_types import FloatArray, IntArray
from ..geometry.mesh import Mesh
from ..geometry.normals import vertex_normals
from ..geometry.orientation import turned, turned_faces
from .clean_surface import joined_surface


def surface_normals(mesh: Mesh, faces: IntArray, barycentric: FloatArray) -> FloatArray:
    """Unit normals of the surface at points of a mesh, (n, 3).

    The angle-weighted vertex normals are interpolated in the face and scaled to unit length. Where
    they cancel, the face normal is used instead; if the face has no area either, the normal is
    zero. Before, coincident vertices are joined, and faces are turned to the side to which most
    faces of their component point.

    Parameters
    ----------
    mesh : Mesh
    faces : (n,) int array
        The face in which each point lies.
    barycentric : (n, 3) float array
        Coordinates in these faces.
    """
    surface = joined_surface(mesh)
    which = turned_faces(surface.mesh)
    vertex_normal = vertex_normals(surface.mesh.vertices, turned(surface.mesh.faces, which))
    at_corners = vertex_normal[surface.place[mesh.faces[faces]]]
    against = np.zeros(len(mesh.faces), dtype=bool)
    against[surface.parts.parent] = which
    face_normals = np.where(against[faces, None], -1.0, 1.0) * mesh.face_normals[faces]
    normals = np.einsum("nc,ncd->nd", barycentric, at_corners)
    length = np.linalg.norm(normals, axis=1, keepdims=True)
    # Where the normals at the corners cancel, the normal of the face replaces them.
    sound = length > 1e-6
    return np.where(sound, normals / np.where(sound, length, 1.0), face_normals)
