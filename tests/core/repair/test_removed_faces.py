"""Tests of removing points at which a polyline turns back along an edge."""

import numpy as np
import pytest

import nicmm_core as nicmm
from nicmm_core.geometry.surface_points import SurfacePoints
from nicmm_core.repair.removed_faces import without_backtracking

MESH = nicmm.Mesh([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, -1, 0]], [[0, 1, 2], [1, 0, 3]])


def along_edge(shares):
    """Points on the edge from vertex 0 to vertex 1, given in either face in turn."""
    faces = np.arange(len(shares)) % 2
    shares = np.asarray(shares, dtype=float)
    here = np.stack([1.0 - shares, shares, 0.0 * shares], axis=1)
    there = here[:, [1, 0, 2]]
    return SurfacePoints(faces, np.where(faces[:, None] == 0, here, there))


def shares_of(points):
    return points.positions(MESH)[:, 0]


@pytest.mark.parametrize(
    ("shares", "remaining"),
    [
        ([0.1, 0.2, 0.5, 0.9], [0.1, 0.2, 0.5, 0.9]),
        ([0.1, 0.5, 0.4, 0.6, 0.9], [0.1, 0.4, 0.6, 0.9]),
        ([0.9, 0.3, 0.5, 0.4, 0.1], [0.9, 0.5, 0.4, 0.1]),
        ([0.0, 0.7, 0.2, 0.6, 0.3, 1.0], [0.0, 0.2, 0.3, 1.0]),
    ],
)
def test_the_rest_is_monotonic(shares, remaining):
    polyline = along_edge(shares)
    found, number = without_backtracking(MESH, polyline, np.array([], dtype=int), closed=False)
    np.testing.assert_allclose(shares_of(found), remaining)
    same = np.isclose(shares_of(found)[number], shares)
    assert same.sum() == len(remaining)


def test_control_points_stay():
    polyline = along_edge([0.1, 0.6, 0.3, 0.9])
    found, number = without_backtracking(MESH, polyline, np.array([1]), closed=False)
    assert np.isclose(shares_of(found)[number[1]], 0.6)


def test_a_turn_inside_a_face_stays():
    weights = np.array([[0.8, 0.2, 0.0], [0.3, 0.3, 0.4], [0.7, 0.3, 0.0], [0.2, 0.8, 0.0]])
    polyline = SurfacePoints(np.zeros(4, dtype=int), weights)
    found, _ = without_backtracking(MESH, polyline, np.array([], dtype=int), closed=False)
    assert len(found) == 4
