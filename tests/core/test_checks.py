"""Tests of the checker, since a checker that accepts everything would let all tests pass."""

from dataclasses import replace

import numpy as np
import pytest

import nicmm_core as nicmm
from nicmm_core.geometry.curve import curve_on_mesh
from tests.core.checks import assert_valid_curve

# Two triangles that share the edge (0, 2).
SQUARE = nicmm.Mesh([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], [[0, 1, 2], [0, 2, 3]])
CONTROLS = np.array([[0.5, 0.25, 0], [0.5, 0.5, 0], [0.25, 0.5, 0]])


def square_curve(positions, faces, controls=()):
    """A curve on the square, from positions and the face in which each is given."""
    positions = np.asarray(positions, dtype=float)
    barycentric = []
    for (x, y), face in zip(positions, faces, strict=True):
        barycentric.append([1 - x, x - y, y] if face == 0 else [1 - y, x, y - x])
    return curve_on_mesh(
        SQUARE, True, np.array(faces), np.array(barycentric), np.array(controls, dtype=int)
    )


@pytest.fixture
def valid():
    """A quadrilateral across the diagonal."""
    corners = [[0.25, 0.25], [0.5, 0.25], [0.5, 0.5], [0.25, 0.5]]
    return square_curve(corners, [0, 0, 1, 1], [1, 2, 3])


def test_accepts_a_valid_curve(valid):
    assert_valid_curve(SQUARE, valid, CONTROLS)


def test_accepts_a_control_order_that_starts_elsewhere(valid):
    shifted = replace(valid, control_index=np.array([2, 3, 1]))
    assert_valid_curve(SQUARE, shifted, CONTROLS[[1, 2, 0]])


def test_refuses_a_point_beside_its_barycentrics(valid):
    points = valid.points.copy()
    points[1, 2] += 1e-9
    with pytest.raises(AssertionError):
        assert_valid_curve(SQUARE, replace(valid, points=points))


def test_refuses_negative_barycentrics():
    curve = square_curve([[0.25, 0.25], [0.5, 0.25], [0.4, 0.5], [0.25, 0.5]], [0, 0, 0, 1])
    with pytest.raises(AssertionError):
        assert_valid_curve(SQUARE, curve)


def test_refuses_neighbours_without_a_common_face():
    curve = square_curve([[0.25, 0.25], [0.5, 0.25], [0.25, 0.5]], [0, 0, 1])
    with pytest.raises(AssertionError, match="no common face"):
        assert_valid_curve(SQUARE, curve)


def test_refuses_a_crossing():
    curve = square_curve([[0.2, 0.1], [0.8, 0.3], [0.8, 0.1], [0.3, 0.2]], [0, 0, 0, 0])
    with pytest.raises(AssertionError, match="cross"):
        assert_valid_curve(SQUARE, curve)


def test_refuses_a_point_visited_twice():
    corners = [[0.5, 0.25], [0.7, 0.3], [0.7, 0.2], [0.5, 0.25], [0.3, 0.1], [0.3, 0.2]]
    with pytest.raises(AssertionError, match="twice"):
        assert_valid_curve(SQUARE, square_curve(corners, [0] * 6))


def test_refuses_an_open_curve(valid):
    with pytest.raises(AssertionError):
        assert_valid_curve(SQUARE, replace(valid, closed=False))


def test_refuses_control_points_missed_or_out_of_order(valid):
    missed = CONTROLS + [[1e-9, 0, 0]]
    with pytest.raises(AssertionError):
        assert_valid_curve(SQUARE, valid, missed)
    backwards = replace(valid, control_index=valid.control_index[::-1].copy())
    with pytest.raises(AssertionError, match="out of order"):
        assert_valid_curve(SQUARE, backwards, CONTROLS[::-1])
