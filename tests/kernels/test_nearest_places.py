"""Nearest places are those that libigl finds among the faces of each group."""

import nicmm_kernels
import numpy as np
import pytest

from nicmm_core import shapes
from nicmm_core.geometry.mesh import Mesh
from nicmm_core.geometry.surface_points import SurfacePoints, nearest_points


def nearest(mesh, positions, groups, begins, faces):
    found = nicmm_kernels.nearest_places(
        mesh.for_kernels, positions, groups, np.array(begins), faces, lambda: None
    )
    return SurfacePoints(*found)


@pytest.mark.parametrize("spread", [0.01, 0.3, 3.0])
def test_nearest_places_are_those_of_libigl(spread):
    rng, mesh = np.random.default_rng(5), shapes.torus(1.0, 0.4, 40, 20)
    begins = np.array([0, 1, 7, 60, 500])
    faces, groups = rng.integers(0, len(mesh.faces), 500), rng.integers(0, 4, 300)
    positions = mesh.vertices[rng.integers(0, len(mesh.vertices), 300)]
    positions = positions + spread * rng.normal(size=positions.shape)
    found = nearest(mesh, positions, groups, begins, faces)
    assert np.allclose(found.barycentric.sum(axis=1), 1.0, atol=1e-15)
    assert (found.barycentric >= -1e-15).all()
    for group in range(4):
        here, among = groups == group, faces[begins[group] : begins[group + 1]]
        assert np.isin(found.faces[here], among).all()
        _, expected = nearest_points(mesh, positions[here], among)
        away = np.linalg.norm(found[here].positions(mesh) - positions[here], axis=1)
        assert np.allclose(away, expected, rtol=1e-12, atol=1e-14)


def test_faces_without_area_have_nearest_places():
    corners = np.array([[0.0, 0, 0], [1, 0, 0], [3, 0, 0], [3, 0, 0], [0, 5, 0]])
    mesh = Mesh(corners, [[0, 1, 2], [2, 3, 3 - 2], [3, 2, 4]])
    positions = np.array([[2.0, 1, 0], [-1.0, 2, 1], [4.0, -1, 0], [3.0, 0, 7]])
    for face in range(3):
        one = np.zeros(4, np.int64)
        found = nearest(mesh, positions, one, [0, 1], np.array([face]))
        _, expected = nearest_points(mesh, positions, np.array([face]))
        away = np.linalg.norm(found.positions(mesh) - positions, axis=1)
        assert np.allclose(away, expected, rtol=1e-12)


def test_of_equally_near_places_the_first_is_found():
    mesh = shapes.sphere(2)
    around = mesh.faces_at(np.array([0]))
    for faces in (around, around[::-1].copy()):
        found = nearest(mesh, 2.0 * mesh.vertices[:1], np.zeros(1, int), [0, len(faces)], faces)
        assert found.faces[0] == faces[0]
