"""Linear finite elements on the working mesh: gradient, divergence and centroid values."""

from __future__ import annotations

from dataclasses import dataclass

import igl
import numpy as np
from scipy import sparse

from ..errors import MeshError
from ..geometry.array_types import BoolArray, FloatArray, IntArray
from ..geometry.mesh import triangle_areas
from ..progress import checkpoint
from .sign_bundle import SignBundle, corner_matrix
from .sparse_solver import DEGENERATE

MOLLIFICATION = 1e-8
"""Least amount by which two sides of a face exceed the third, in mean edge lengths.

It corresponds to angles of about 0.01°. Cotangents are computed from edge lengths, with less
rounding error.
"""


@dataclass(frozen=True)
class FiniteElements:
    """Operators for n vertices and m faces; lengths are in the unit of the vertex positions.

    Attributes
    ----------
    face_areas : (m,) float array
    vertex_areas : (n,) float array
        Barycentric area of each vertex, a third of its adjacent faces; positive.
    gradient : (3 m, n) sparse array
        Gradient of a linear function in each face; all x components, then y, then z.
    stiffness : (n, n) sparse array
        Cotangent stiffness: positive semidefinite, and zero on constants unless a sign bundle is
        used.
    divergence : (n, 3 m) sparse array
        Pointwise divergence, at the vertices, of a vector field that is constant in each face; all
        x components, then y, then z. Rows of selected vertices are zero, such as those on the
        boundary, where the sum over faces contains the boundary flux.
    centroid : (m, n) sparse array
        Value of a linear function at the centroid of each face.
    plain_centroid : (m, n) sparse array
        The same values for ordinary functions, without the signs of a bundle.
    """

    face_areas: FloatArray
    vertex_areas: FloatArray
    gradient: sparse.csr_array
    stiffness: sparse.csr_array
    divergence: sparse.csr_array
    centroid: sparse.csr_array
    plain_centroid: sparse.csr_array


def mollified(lengths: FloatArray) -> FloatArray:
    """Edge lengths of faces, increased so that every face has an area, shape (m, 3).

    The same length is added to all edges: the least length for which any two sides of every face
    exceed the third by `MOLLIFICATION` (Sharp and Crane, "A Laplacian for nonmanifold triangle
    meshes", 2020). On meshes without slivers it is zero.
    """
    slack = lengths.sum(axis=1) - 2.0 * lengths.max(axis=1)
    return lengths + max(0.0, MOLLIFICATION * float(lengths.mean()) - float(slack.min()))


def build_finite_elements(
    vertices: FloatArray,
    faces: IntArray,
    without_divergence: BoolArray,
    bundle: SignBundle | None = None,
) -> FiniteElements:
    """Assemble the operators of a mesh, in double precision.

    Parameters
    ----------
    vertices : (n, 3) float array
    faces : (m, 3) int array
    without_divergence : (n,) bool array
        Whether a vertex has a zero row in the divergence, such as the vertices on the boundary.
    bundle : SignBundle, optional
        Signs with which faces read the values of their corners.

    Returns
    -------
    FiniteElements

    Raises
    ------
    MeshError
        If a face has no area.
    """
    n_vertices, n_faces = len(vertices), len(faces)
    face_areas = triangle_areas(vertices, faces)
    corners = (np.repeat(np.arange(n_faces), 3), faces.ravel())
    thirds = np.full(3 * n_faces, 1.0 / 3.0)
    plain_centroid = sparse.csr_array((thirds, corners), shape=(n_faces, n_vertices))
    vertex_areas = plain_centroid.T @ face_areas
    checkpoint()
    lengths = mollified(igl.edge_lengths(vertices, faces))
    if bundle is None:
        centroid = plain_centroid
        stiffness = sparse.csr_array(-igl.cotmatrix_intrinsic(lengths, faces))
        gradient = sparse.csr_array(igl.grad(vertices, faces))
    else:
        reading = corner_matrix(faces, n_vertices, bundle)
        centroid = sparse.csr_array(
            (thirds * bundle.corner_sign.ravel(), corners), shape=(n_faces, n_vertices)
        )
        apart = np.arange(3 * n_faces).reshape(-1, 3)
        at_corners = vertices[faces].reshape(-1, 3)
        cotangents = -igl.cotmatrix_intrinsic(lengths, apart)
        stiffness = sparse.csr_array(reading.T @ cotangents @ reading)
        gradient = sparse.csr_array(igl.grad(at_corners, apart) @ reading)
    if not (face_areas > 0.0).all():
        raise MeshError(DEGENERATE)
    inside = np.where(without_divergence, 0.0, 1.0 / vertex_areas)
    divergence = (
        sparse.diags_array(-inside) @ gradient.T @ sparse.diags_array(np.tile(face_areas, 3))
    )
    return FiniteElements(
        face_areas=face_areas,
        vertex_areas=vertex_areas,
        gradient=gradient,
        stiffness=stiffness,
        divergence=sparse.csr_array(divergence),
        centroid=centroid,
        plain_centroid=plain_centroid,
    )
