"""Midpoint subdivision of a mesh, which adds vertices and does not change the surface."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy import sparse

from . import tolerances
from .array_types import FloatArray, IntArray
from .mesh import Mesh
from .surface_points import SurfacePoints

POINTS = np.concatenate([np.eye(3), 0.5 * (1.0 - np.eye(3))])
"""Barycentric coordinates of the corners of a face and of the midpoints opposite them."""

PARTS = np.array([[0, 5, 4], [5, 1, 3], [4, 3, 2], [3, 4, 5]])
"""Corners of each of the four parts of a face, as indices into `POINTS`."""


@dataclass(frozen=True)
class Refined:
    """A mesh with faces divided into equal parts, and its map to the original mesh.

    Attributes
    ----------
    mesh : Mesh
        The divided mesh, with f faces and v vertices.
    parent : (f,) int array
        Original face of which each face is a part, ascending.
    corners : (f, 3, 3) float array
        Barycentric coordinates of the corners of each face in its original face.
    interpolation : (v, V) sparse array
        Matrix that interpolates values at the original vertices to all vertices.
    """

    mesh: Mesh
    parent: IntArray
    corners: FloatArray
    interpolation: sparse.csr_array

    def in_parents(self, points: SurfacePoints) -> SurfacePoints:
        """Map points of the divided mesh to the original mesh."""
        barycentric = np.einsum("pc,pcd->pd", points.barycentric, self.corners[points.faces])
        return SurfacePoints(self.parent[points.faces], barycentric)

    def in_parts(self, points: SurfacePoints) -> SurfacePoints:
        """Map points of the original mesh to the divided mesh."""
        begin = np.searchsorted(self.parent, points.faces)
        parts = begin[:, None] + np.arange(len(self.parent) // (self.parent[-1] + 1))
        matrix = self.corners[parts].transpose(0, 1, 3, 2)
        local = np.linalg.solve(matrix, points.barycentric[:, None, :, None])[..., 0]
        best = local.min(axis=2).argmax(axis=1)
        rows = np.arange(len(best))
        local = local[rows, best]
        local = np.where(local < tolerances.ROUNDED, 0.0, local)
        return SurfacePoints(parts[rows, best], local / local.sum(axis=1, keepdims=True))


def refined(mesh: Mesh, times: int) -> Refined:
    """Divide every face into four equal parts, ``times`` times in succession."""
    count = len(mesh.vertices)
    faces, weights = mesh.faces, sparse.eye_array(count, format="csr")
    corners = np.broadcast_to(np.eye(3), (len(faces), 3, 3))
    parent = np.arange(len(faces))
    for _ in range(times):
        edge = np.sort(faces[:, [1, 2, 2, 0, 0, 1]].reshape(-1, 2), axis=1)
        ends, number = np.unique(edge, axis=0, return_inverse=True)
        midpoints = weights.shape[0] + number.reshape(-1, 3)  # opposite each corner
        halves = sparse.csr_array(
            (np.full(2 * len(ends), 0.5), ends.ravel(), 2 * np.arange(len(ends) + 1)),
            shape=(len(ends), weights.shape[0]),
        )
        weights = sparse.csr_array(sparse.vstack([weights, halves @ weights]))
        faces = np.concatenate([faces, midpoints], axis=1)[:, PARTS].reshape(-1, 3)
        corners = np.einsum("pij,fjk->fpik", POINTS[PARTS], corners).reshape(-1, 3, 3)
        parent = np.repeat(parent, 4)
    divided = mesh if times == 0 else Mesh(weights @ mesh.vertices, faces)
    return Refined(divided, parent, corners, weights)
