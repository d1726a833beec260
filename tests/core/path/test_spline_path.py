"""Tests the spline through control points, and the curve along it."""

import numpy as np
import pytest

import nicmm_core as nicmm
from nicmm_core.geometry.surface_points import nearest_points
from nicmm_core.path.spline_path import spline_samples
from nicmm_core.relaxation.curve_along import curve_along
from nicmm_core.relaxation.curve_nodes import curve_surface
from tests.core.checks import random_surface_points


def on_circle(count, turn=1.0):
    """Points of the unit circle."""
    angle = 2.0 * np.pi * turn * np.arange(count) / count
    return np.stack([np.cos(angle), np.sin(angle), 0.0 * angle], axis=1)


def no_corners(points):
    return np.zeros(len(points), dtype=bool)


@pytest.mark.parametrize("count", [6, 12, 24])
def test_a_periodic_spline_converges_to_a_circle(count):
    points = on_circle(count)
    line, index = spline_samples(points, True, no_corners(points))
    np.testing.assert_allclose(line[index], points, atol=1e-12)
    away = np.abs(np.linalg.norm(line, axis=1) - 1.0).max()
    assert away < 6.0 / count**4  # the error of cubic interpolation


def test_an_open_spline_through_two_points_is_a_line():
    points = np.array([[0.0, 0.0, 0.0], [1.0, 2.0, 3.0]])
    line, index = spline_samples(points, False, no_corners(points))
    share = np.linspace(0.0, 1.0, len(line))
    np.testing.assert_allclose(line, share[:, None] * points[1], atol=1e-12)
    assert index.tolist() == [0, len(line) - 1]


@pytest.mark.parametrize("first", range(4))
def test_a_spline_is_straight_between_corners(first):
    square = np.array([[0.0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]])
    points = np.roll(square, first, axis=0)
    line, index = spline_samples(points, True, np.ones(4, dtype=bool))
    np.testing.assert_allclose(line[index], points, atol=1e-12)
    off_side = np.minimum(np.abs(line[:, :2]).min(axis=1), np.abs(1.0 - line[:, :2]).min(axis=1))
    assert off_side.max() < 1e-12


def test_a_spline_with_one_corner_turns_only_there():
    points = on_circle(12)
    corners = no_corners(points)
    corners[5] = True
    line, index = spline_samples(points, True, corners)
    np.testing.assert_allclose(line[index], points, atol=1e-12)
    steps = np.roll(line, -1, axis=0) - line
    steps /= np.linalg.norm(steps, axis=1, keepdims=True)
    turn = np.arccos((steps * np.roll(steps, 1, axis=0)).sum(axis=1).clip(-1.0, 1.0))
    assert turn.argmax() == index[5]


def test_the_spline_does_not_depend_on_the_first_point_or_the_direction():
    points = np.random.default_rng(0).normal(size=(9, 3))
    whole = spline_samples(points, True, no_corners(points))[0]
    rolled = spline_samples(np.roll(points, -4, axis=0), True, no_corners(points))[0]
    turned = spline_samples(points[::-1], True, no_corners(points))[0]
    for other in (rolled, turned):
        apart = np.linalg.norm(whole[:, None] - other, axis=2).min(axis=1)
        assert apart.max() < 1e-9


@pytest.mark.slow
def test_a_curve_along_a_spline_passes_the_points_and_stays_near(surface):
    points = random_surface_points(surface, 3, 2)
    design = nicmm.design_curve(surface, points, closed=False)
    line = design.curves[0].points
    chosen = np.linspace(0, len(line) - 1, 9).astype(int)
    controls, _ = nearest_points(surface, line[chosen])
    spline, index = spline_samples(line[chosen], False, no_corners(line[chosen]))
    found = curve_along(curve_surface(surface), spline, False, index, controls)
    curve = found.surface_curve(surface)
    np.testing.assert_allclose(curve.points[curve.control_index], line[chosen], atol=1e-7)
    _, away = nearest_points(surface, spline)
    apart = np.linalg.norm(curve.points[:, None] - spline, axis=2).min(axis=1)
    spacing = np.linalg.norm(np.diff(spline, axis=0), axis=1).max()
    assert apart.max() <= away.max() + 2.0 * spacing


def test_there_is_no_curve_along_a_line_far_from_the_surface(ball):
    line = 3.0 * on_circle(30)
    assert curve_along(curve_surface(ball), line, True, np.array([0, 10, 20])) is None
