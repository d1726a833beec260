"""Tests that the perturbation of section 4.6 degrades a mesh as described, and is reproducible."""

import numpy as np
import pytest

from nicmm_core import shapes
from tests.oracles.perturbation import LEAST_ANGLE, angles, perturbed


def test_angles_of_a_known_triangle():
    triangle = np.array([[[0.0, 0, 0], [1, 0, 0], [0, 1, 0]]])
    np.testing.assert_allclose(angles(triangle), [[90.0, 45.0, 45.0]])


@pytest.mark.slow
def test_faces_get_worse_while_the_shape_and_the_control_points_stay():
    mesh = shapes.sphere(3)
    kept = np.array([3, 50, 400])
    smallest = []
    for every in (16, 4, 1):
        rough, moved = perturbed(mesh, every, np.random.default_rng(1), kept)
        assert 0 < moved <= len(mesh.faces) // every
        np.testing.assert_array_equal(rough.faces, mesh.faces)
        np.testing.assert_array_equal(rough.vertices[kept], mesh.vertices[kept])
        assert 0.9 < np.linalg.norm(rough.vertices, axis=1).min()
        smallest.append(np.quantile(angles(rough.vertices[rough.faces]).min(axis=1), 0.05))
    assert smallest[0] > smallest[1] > smallest[2]
    assert smallest[2] < 10 * LEAST_ANGLE


def test_same_seed_gives_the_same_mesh():
    mesh = shapes.sphere(2)
    first, second = (
        perturbed(mesh, 2, np.random.default_rng(7), np.array([0]))[0] for _ in range(2)
    )
    np.testing.assert_array_equal(first.vertices, second.vertices)
