"""Tests of the maps between faces and the triangles that they consist of."""

import numpy as np
import pytest

import nicmm_core as nicmm
from nicmm_core.geometry.curve import curve_on_mesh
from nicmm_core.geometry.surface_points import SurfacePoints
from nicmm_core.repair.face_parts import FaceParts, whole_faces

MESH = nicmm.Mesh([[0, 0, 0], [1, 0, 0], [0, 1, 0], [1, 1, 0]], [[0, 1, 2], [3, 2, 1]])
SHARES = np.array([0.25, 0.5])


@pytest.fixture
def parts():
    """The first face divided at two points of its side from vertex 0 to vertex 1."""
    vertex = np.array([0, 1, 2])
    once = whole_faces(MESH.faces).divided(vertex[:1], vertex[:1], vertex[1:2], [4], SHARES[:1])
    rest = (SHARES[1:] - SHARES[0]) / (1.0 - SHARES[0])
    return once.divided(np.array([2]), np.array([4]), vertex[1:2], [5], rest)


def positions(parts, points):
    return parts.in_parents(points).positions(MESH)


def segment(start, end):
    """A curve of one segment in the first face."""
    weights = np.array([start, end], dtype=float)
    return curve_on_mesh(MESH, False, np.array([0, 0]), weights, np.array([0, 1]))


def test_divided_faces_are_covered(parts):
    assert parts.parent.tolist() == [0, 1, 0, 0]
    assert parts.faces.tolist() == [[0, 4, 2], [3, 2, 1], [4, 5, 2], [5, 1, 2]]
    area = np.bincount(parts.parent, weights=np.linalg.det(parts.corners))
    np.testing.assert_allclose(area, 1.0)


def test_points_lie_in_every_part_that_contains_them(parts):
    points = SurfacePoints(
        np.array([0, 0, 1]), np.array([[0.5, 0.5, 0], [0, 0, 1], [0.2, 0.3, 0.5]])
    )
    there, which = parts.in_parts(points)
    assert which.tolist() == [0, 0, 1, 1, 1, 2]
    assert sorted(there.faces.tolist()) == [0, 1, 2, 2, 3, 3]
    np.testing.assert_allclose(positions(parts, there), points.positions(MESH)[which], atol=1e-15)


@pytest.mark.parametrize("backward", [False, True])
def test_a_segment_gets_a_point_wherever_it_leaves_a_part(parts, backward):
    ends = [[0.7, 0.2, 0.1], [0.0, 0.9, 0.1]]
    curve = segment(*(ends[::-1] if backward else ends))
    points, which = parts.through(MESH, curve)
    assert which.tolist() == [0, 0, 0, 1]
    assert points.faces.tolist() == ([3, 2, 0, 0] if backward else [0, 2, 3, 3])
    crossed = sorted(positions(parts, points)[1:3, 0])
    np.testing.assert_allclose(crossed, 0.9 * SHARES)  # the sides lead to vertex 2
    assert (points.barycentric[1:3] > 0.0).sum(axis=1).tolist() == [2, 2]


def test_parts_without_area_are_passed_over(parts):
    corners = parts.corners.copy()
    corners[0] = corners[0, [0, 0, 2]]
    flat = FaceParts(parts.faces, parts.parent, corners)
    points, which = flat.through(MESH, segment([0.3, 0.5, 0.2], [0.1, 0.7, 0.2]))
    assert points.faces.tolist() == [3, 3] and which.tolist() == [0, 1]
    there, _ = flat.in_parts(SurfacePoints(np.array([0]), np.array([[0.0, 0.0, 1.0]])))
    assert there.faces.tolist() == [2, 3]


def test_a_face_without_parts_yields_nothing(parts):
    points, which = parts.taken(np.array([1])).through(MESH, segment([1, 0, 0], [0, 1, 0]))
    assert len(points) == len(which) == 0
