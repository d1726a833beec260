"""Points that are close together determine the course of a curve; far ones do not."""

from dataclasses import replace

import numpy as np
import pytest

import nicmm_core as nicmm
from nicmm_core import start_search
from nicmm_core.relaxation.close_points import bends_like_points, has_short_legs, turns
from nicmm_core.relaxation.discrete_curve import DiscreteCurve
from tests.core.checks import circle, points_near


def relaxed(mesh, positions, closed=True) -> DiscreteCurve:
    design = nicmm.design_curve(mesh, points_near(mesh, positions), closed=closed)
    return design.resumable.curve


@pytest.mark.parametrize("count", [3, 6, 20])
def test_turns_of_a_regular_polygon(count):
    corners = circle(np.arange(count) * 2.0 * np.pi / count)
    up = np.tile([0.0, 0.0, 1.0], (count, 1))
    np.testing.assert_allclose(turns(corners, up, True), 2.0 * np.pi / count, atol=1e-12)
    of_open = turns(corners, up, False)
    assert of_open[0] == of_open[-1] == 0.0
    np.testing.assert_allclose(of_open[1:-1], 2.0 * np.pi / count, atol=1e-12)


@pytest.mark.parametrize("count", [4, 7])
def test_a_great_circle_does_not_turn(count):
    points = circle(np.arange(count) * 2.0 * np.pi / count)
    np.testing.assert_allclose(turns(points, points, True), 0.0, atol=1e-12)


def test_a_turn_back_is_half_a_turn():
    line, up = np.array([[0.0, 0, 0], [1, 0, 0], [0.2, 0, 0]]), np.tile([0.0, 0, 1], (3, 1))
    np.testing.assert_allclose(turns(line, up, False), [0.0, np.pi, 0.0], atol=1e-12)


def test_legs_of_a_circle_are_short_unless_one_is_most_of_it(flat_disc):
    """A third of a circle is 1.21 times as long as its chord."""
    for count in (3, 6):
        curve = relaxed(flat_disc, 0.6 * circle(np.arange(count) * 2.0 * np.pi / count))
        assert has_short_legs(curve) and bends_like_points(curve)
    half = relaxed(flat_disc, 0.6 * circle(np.array([0.0, 0.1, 0.2]) + 1.0))
    assert not has_short_legs(half)


def test_waves_between_two_points_bend_more_than_these(flat_disc):
    angles = np.linspace(0.0, 2.0 * np.pi, 9)
    waves = np.stack([0.15 * (angles - np.pi), 0.2 * np.sin(angles), 0.0 * angles], axis=1)
    curve = relaxed(flat_disc, waves, closed=False)
    assert bends_like_points(curve)
    assert not bends_like_points(replace(curve, control_nodes=curve.control_nodes[[0, -1]]))


@pytest.fixture
def searches(monkeypatch):
    """The requests of all searches for courses."""
    found = []
    search = start_search.StartSearch._joined_courses

    def spy(self, request, *given):
        found.append(request)
        return search(self, request, *given)

    monkeypatch.setattr(start_search.StartSearch, "_joined_courses", spy)
    return found


def test_there_is_no_search_through_close_points(flat_disc, searches):
    nicmm.design_curve(flat_disc, points_near(flat_disc, 0.5 * circle(np.arange(8) * np.pi / 4.0)))
    assert not searches


@pytest.mark.parametrize("count", [4, 6])
def test_there_is_a_search_through_few_or_turning_points(flat_disc, searches, count):
    zigzag = np.array([[0.1 * i, 0.3 * (-1) ** i, 0.0] for i in range(count)])
    nicmm.design_curve(flat_disc, points_near(flat_disc, zigzag), closed=False)
    assert searches


def test_maps_and_other_energies_are_searched_for(flat_disc, searches):
    points = points_near(flat_disc, 0.5 * circle(np.arange(8) * np.pi / 4.0))
    lane = np.exp(-((flat_disc.vertices[:, 0] / 0.1) ** 2))
    for options in ({"alignment": lane}, {"normal_bending": 0.5}, {"order": "shortest"}):
        searches.clear()
        nicmm.design_curve(flat_disc, points, **options)
        assert searches, options
