"""Tests of curves across removed faces: where they turn back, and whether they are simple."""

import numpy as np
import pytest

import nicmm_core as nicmm
from nicmm_core.geometry.curve import curve_on_mesh
from nicmm_core.geometry.surface_points import SurfacePoints
from nicmm_core.repair.removed_faces import RemovedFaces, without_backtracking

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


SOUP = nicmm.Mesh(MESH.vertices[MESH.faces.ravel()], np.arange(6).reshape(2, 3))


def curve_in_plane(mesh, faces, positions, closed):
    """A curve through positions, (n, 2), each given in a face."""
    corners = mesh.vertices[mesh.faces[faces]]
    plane = np.ones((len(faces), 3, 3))
    plane[:, :2] = corners[:, :, :2].transpose(0, 2, 1)
    wanted = np.column_stack([positions, np.ones(len(faces))])
    weights = np.linalg.solve(plane, wanted[:, :, None])[:, :, 0].round(12)
    return curve_on_mesh(mesh, closed, np.asarray(faces), weights, np.array([0, len(faces) - 1]))


@pytest.mark.parametrize("mesh", [MESH, SOUP])
@pytest.mark.parametrize(
    ("faces", "positions", "closed", "simple"),
    [
        ([0] * 4, [[0.1, 0.1], [0.5, 0.1], [0.5, 0.4], [0.1, 0.4]], True, True),
        ([0] * 4, [[0.1, 0.1], [0.5, 0.4], [0.5, 0.1], [0.1, 0.4]], True, False),
        ([0, 0, 1], [[0.2, 0.2], [0.3, 0.0], [0.3, -0.2]], False, True),
        ([0, 1, 1], [[0.2, 0.2], [0.3, 0.0], [0.3, -0.2]], False, True),
        ([0, 1], [[0.2, 0.2], [0.3, -0.2]], False, False),  # no face has both points
        ([0, 0, 1, 1, 0], [[0.2, 0.2], [0.5, 0], [0.2, -0.2], [0.5, 0], [0.5, 0.2]], False, False),
        ([0, 0, 1, 1, 0], [[0.2, 0.2], [0, 0], [0.2, -0.2], [0, 0], [0.5, 0.2]], False, False),
    ],
)
def test_whether_a_curve_is_simple(mesh, faces, positions, closed, simple):
    """Also where the faces share no vertices, which were joined."""
    removed = RemovedFaces(mesh, MESH.faces, np.zeros(2, dtype=bool))
    assert removed.is_simple(curve_in_plane(mesh, faces, positions, closed)) is simple
