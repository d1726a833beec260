"""Tests which zero set a design with maps starts from."""

import numpy as np
import pytest

import nicmm_core as nicmm
from nicmm_core.geometry.surface_points import locate_control_points
from nicmm_core.level_set.problem import build_problem
from nicmm_core.level_set.zero_set import ZeroSet, shortest_by_map, zero_set
from tests.core.checks import assert_valid_curve, curve_through

ENDS = np.array([[-0.6, 0.03, 0.0], [0.6, 0.03, 0.0]])


def problem_on(mesh, **maps):
    points = locate_control_points(mesh, ENDS, closed=False)
    return build_problem(mesh, points, closed=False, **maps)


def bow(mesh, height):
    """A zero set, given only by its curve, that rises to a height in the middle."""
    x = np.linspace(-0.6, 0.6, 41)
    y = 0.03 + height * (1.0 - (x / 0.6) ** 2)
    return ZeroSet(
        np.zeros(0), 0, [curve_through(mesh, np.stack([x, y, 0 * x], 1), [0, 40], False)]
    )


@pytest.fixture(scope="module")
def lane(flat_disc):
    return (np.abs(flat_disc.vertices[:, 1]) < 0.05).astype(float)


@pytest.mark.slow
def test_a_shorter_curve_is_kept_and_a_longer_one_replaced(flat_disc, lane):
    problem = problem_on(flat_disc, alignment=lane)
    straight, detour = bow(flat_disc, 0.0), bow(flat_disc, 0.5)
    assert shortest_by_map(flat_disc, problem, straight) is straight
    other = shortest_by_map(flat_disc, problem, detour)
    assert other is not detour
    assert other.curves[0].length < 1.2 * straight.curves[0].length
    assert_valid_curve(flat_disc, other.curves[0], ENDS, False)


def test_lengths_count_by_the_map(flat_disc):
    """The straight path leads through an obstacle, so it is longer in the metric of the map."""
    x, y, _ = flat_disc.vertices.T
    wall = ((np.abs(x) < 0.1) & (y < 0.25)).astype(float)
    problem = problem_on(flat_disc, obstacles=wall)
    straight, detour = bow(flat_disc, 0.0), bow(flat_disc, 0.45)
    assert shortest_by_map(flat_disc, problem, straight) is not straight
    kept = shortest_by_map(flat_disc, problem, detour)
    assert np.abs(kept.curves[0].points[:, 1]).max() > 0.2


@pytest.mark.slow
def test_what_is_no_simple_curve_is_replaced(flat_disc, lane):
    problem = problem_on(flat_disc, alignment=lane)
    none = ZeroSet(np.zeros(0), 0, [])
    found = shortest_by_map(flat_disc, problem, none)
    assert found.is_simple_curve(flat_disc, closed=False)
    # The replacement needs no repair: the zero sets of φ₀ and of the distance are one curve.
    for field in (problem.initial_distance, problem.distance):
        as_it_is, repaired = (zero_set(flat_disc, problem, field, kept) for kept in (True, False))
        assert repaired.breaking_vertices == 0
        assert as_it_is.curves[0].length == pytest.approx(repaired.curves[0].length)


@pytest.mark.slow
@pytest.mark.parametrize("closed", [True, False])
def test_designs_without_maps_do_not_choose(flat_disc, monkeypatch, closed):
    from nicmm_core.network import single_pass

    monkeypatch.setattr(single_pass, "shortest_by_map", None)
    points = [[-0.5, 0.0, 0.0], [0.5, 0.1, 0.0], [0.0, 0.6, 0.0]]
    assert nicmm.design_curve(flat_disc, points, closed=closed).status is nicmm.Status.CONVERGED
