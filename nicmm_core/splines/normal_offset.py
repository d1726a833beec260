"""Computes points at a given height above the surface."""

from __future__ import annotations

from ..geometry.array_types import FloatArray, IntArray
from ..geometry.mesh import Mesh
from ..geometry.surface_points import SurfacePoints
from ..repair.surface_normals import surface_normals


def offset_points(
    mesh: Mesh, faces: IntArray, barycentric: FloatArray, height: float
) -> FloatArray:
    """Positions of points of a mesh, moved along `surface_normals`.

    Parameters
    ----------
    mesh : Mesh
    faces : (n,) int array
        The face in which each point lies.
    barycentric : (n, 3) float array
        Coordinates in these faces.
    height : float
        In mesh units; negative towards the inside.

    Returns
    -------
    (n, 3) float array
    """
    normals = surface_normals(mesh, faces, barycentric)
    return SurfacePoints(faces, barycentric).positions(mesh) + height * normals
