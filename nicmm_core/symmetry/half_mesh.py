"""The part of a mesh on one side of a plane, whose faces are faces of the mesh or parts of them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..geometry.array_types import BoolArray, FloatArray, IntArray
from ..geometry.mesh import Mesh
from ..geometry.mirror import ON_PLANE, Plane
from ..repair.divided_faces import positive_parts
from ..repair.face_parts import FaceParts, whole_faces


@dataclass(frozen=True)
class HalfMesh:
    """The faces of a mesh on one side of a plane; faces that the plane cuts are cut there.

    Attributes
    ----------
    mesh : Mesh
    parts : FaceParts
        Its faces as parts of those of the whole mesh.
    parents : (v,) int array
        A face of the whole mesh that contains each vertex.
    barycentric : (v, 3) float array
        Coordinates of the vertex in that face.
    on_plane : (v,) bool array
        Which vertices are on the plane.
    """

    mesh: Mesh
    parts: FaceParts
    parents: IntArray
    barycentric: FloatArray
    on_plane: BoolArray

    def weights_to(self, whole: Mesh, weights: FloatArray) -> FloatArray:
        """Weights at the vertices of the whole mesh, (V,), interpolated at those of the half."""
        result: FloatArray = (self.barycentric * weights[whole.faces[self.parents]]).sum(axis=1)
        return result


def half_mesh(mesh: Mesh, plane: Plane) -> HalfMesh | None:
    """Cut a mesh along a plane, and keep the side to which the normal of the plane points.

    None if no face has a part on this side.
    """
    parts, vertices = positive_parts(
        whole_faces(mesh.faces),
        mesh.vertices,
        plane.heights(mesh.vertices),
        ON_PLANE * mesh.diagonal,
    )
    if not len(parts.faces):
        return None
    used, corner, faces = np.unique(parts.faces, return_index=True, return_inverse=True)
    half = Mesh(vertices[used], faces.reshape(-1, 3))
    on_plane = np.abs(plane.heights(half.vertices)) <= ON_PLANE * mesh.diagonal
    barycentric = parts.corners.reshape(-1, 3)[corner]
    parents = np.repeat(parts.parent, 3)[corner]
    return HalfMesh(half, parts.with_faces(half.faces), parents, barycentric, on_plane)
