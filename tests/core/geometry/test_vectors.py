"""Tests products and lengths of vectors against NumPy."""

import numpy as np
import pytest

from nicmm_core.geometry import vectors


@pytest.fixture
def pair():
    generator = np.random.default_rng(0)
    return generator.standard_normal((2, 3, 4, 5))


def test_dot_and_cross_products_of_components_on_the_first_axis(pair):
    one, other = pair
    np.testing.assert_allclose(vectors.dot(one, other), (one * other).sum(axis=0), rtol=1e-14)
    np.testing.assert_allclose(vectors.cross(one, other), np.cross(one, other, axis=0))


def test_lengths_and_unit_vectors(pair):
    np.testing.assert_allclose(vectors.lengths(pair[0]), np.linalg.norm(pair[0], axis=0))
    np.testing.assert_allclose(vectors.lengths(vectors.unit(pair[0])), 1.0)
    assert not vectors.unit(np.zeros((3, 2))).any()
