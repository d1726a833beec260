"""Tests zero sets of level sets, and the test whether they are one simple curve."""

import numpy as np
import pytest

from nicmm_core.geometry.surface_points import locate_control_points
from nicmm_core.paper.problem import build_problem
from nicmm_core.paper.zero_set import is_simple_curve, zero_set
from tests.core.checks import assert_valid_curve

ENDS = np.array([[-0.6, 0.03, 0.0], [0.6, 0.03, 0.0]])


@pytest.fixture(scope="module")
def problem(small_ball):
    points = locate_control_points(small_ball, [3, 60, 100], closed=True)
    return build_problem(small_ball, points)


@pytest.mark.slow
def test_zero_sets_of_the_initial_distances_are_one_curve(flat_disc):
    lane = (np.abs(flat_disc.vertices[:, 1]) < 0.05).astype(float)
    points = locate_control_points(flat_disc, ENDS, closed=False)
    problem = build_problem(flat_disc, points, closed=False, alignment=lane)
    for field in (problem.initial_distance, problem.distance):
        curves = zero_set(flat_disc, problem, field)
        assert is_simple_curve(flat_disc, curves, closed=False)
        assert not is_simple_curve(flat_disc, curves, closed=True)
        assert_valid_curve(flat_disc, curves[0], ENDS, closed=False)


def test_closed_zero_set_passes_through_the_points(small_ball, problem):
    curves = zero_set(small_ball, problem, problem.initial_distance)
    assert is_simple_curve(small_ball, curves, closed=True)
    assert not is_simple_curve(small_ball, curves, closed=False)
    assert_valid_curve(small_ball, curves[0], small_ball.vertices[[3, 60, 100]])


def test_second_component_is_no_simple_curve(small_ball, problem):
    """A patch of the other sign away from the curve has a zero set of its own."""
    field = problem.initial_distance.copy()
    farthest = np.argmax(field)
    field[np.linalg.norm(problem.vertices - problem.vertices[farthest], axis=1) < 0.1] = -0.1
    curves = zero_set(small_ball, problem, field)
    assert len(curves) == 2
    assert not is_simple_curve(small_ball, curves, closed=True)


def test_field_without_a_change_of_sign_has_no_curve(small_ball, problem):
    curves = zero_set(small_ball, problem, np.ones(len(problem.vertices)))
    assert not is_simple_curve(small_ball, curves, closed=True)


def test_field_is_not_changed(small_ball, problem):
    before = problem.initial_distance.copy()
    zero_set(small_ball, problem, problem.initial_distance)
    np.testing.assert_array_equal(problem.initial_distance, before)
