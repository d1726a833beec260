"""Tests the places of a polygon that points snap to."""

import numpy as np

import nicmm_core as nicmm
from nicmm_core.geometry.snap_targets import snap_targets

PENTAGON = np.array([[0, 0, 0], [2, 0, 0], [3, 2, 0], [1, 3, 0], [-1, 2, 0], [5, 5, 0]], float)
MESH = nicmm.Mesh(PENTAGON, np.array([[0, 1, 2], [0, 2, 3], [0, 3, 4], [2, 5, 3]]))
TARGETS = snap_targets(MESH, np.array([0, 1, 2]))


def in_order(points):
    places = points.positions(MESH)
    return places[np.lexsort(places.T)]


def test_vertices_are_those_of_the_polygon():
    expected = PENTAGON[:5]
    np.testing.assert_allclose(in_order(TARGETS.vertices), expected[np.lexsort(expected.T)])


def test_diagonals_are_not_edges():
    expected = 0.5 * (PENTAGON[:5] + np.roll(PENTAGON[:5], -1, axis=0))
    np.testing.assert_allclose(in_order(TARGETS.midpoints), expected[np.lexsort(expected.T)])


def test_the_centre_is_the_mean_of_the_vertices():
    np.testing.assert_allclose(TARGETS.centre.positions(MESH)[0], PENTAGON[:5].mean(axis=0))


def test_points_on_edges_are_nearest_to_the_line_of_sight():
    found = TARGETS.on_edges(np.array([0.5, 0.1, 9.0]), np.array([0.0, 0.0, -4.0]))
    places = found.positions(MESH)
    best = places[np.linalg.norm(places[:, :2] - [0.5, 0.1], axis=1).argmin()]
    np.testing.assert_allclose(best, [0.5, 0.0, 0.0], atol=1e-12)
