"""Tests of vertex normals."""

import numpy as np

from nicmm_core import shapes
from nicmm_core.geometry.normals import vertex_normals


def test_normals_of_a_sphere_point_outwards():
    for mesh in (shapes.sphere(2), shapes.sphere(3)):
        normals = vertex_normals(mesh.vertices, mesh.faces)
        np.testing.assert_allclose(np.linalg.norm(normals, axis=1), 1.0)
        assert (normals * mesh.vertices).sum(axis=1).min() > 0.99


def test_normals_are_finite_where_they_cancel():
    """Two faces back to back."""
    vertices = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0]])
    assert np.isfinite(vertex_normals(vertices, np.array([[0, 1, 2], [0, 2, 1]]))).all()
