"""Tests geodesic curvature (Eq. 10) and resampling against closed forms."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from nicmm_core import SurfaceCurve
from nicmm_core.geometry.curve import (
    along_leg,
    curve_on_mesh,
    leg_lengths,
    points_of_leg,
    resample,
)
from nicmm_core.geometry.geodesic_curvature import geodesic_curvature
from tests.core.checks import circle, random_surface_points

ANGLES = np.arange(60) * 2 * np.pi / 60
UP = np.tile([0.0, 0.0, 1.0], (60, 1))


@pytest.mark.parametrize("radius", [0.1, 1.0, 30.0])
def test_circle_in_the_plane_has_the_curvature_of_its_radius(radius):
    np.testing.assert_allclose(geodesic_curvature(circle(ANGLES, radius), UP), 1.0 / radius)


def test_clockwise_turns_are_negative():
    np.testing.assert_allclose(geodesic_curvature(circle(-ANGLES, 2.0), UP), -0.5)
    np.testing.assert_allclose(geodesic_curvature(circle(ANGLES, 2.0), -UP), -0.5)


def test_great_circle_has_none():
    turn = Rotation.from_rotvec([0.3, 1.0, -0.4])
    points = turn.apply(circle(ANGLES))
    np.testing.assert_allclose(geodesic_curvature(points, points), 0.0, atol=1e-12)


@pytest.mark.parametrize("latitude", [-1.0, 0.3, 1.2])
def test_parallel_of_the_sphere_has_the_tangent_of_its_latitude(latitude):
    errors = []
    for count in (60, 240):
        angles = np.arange(count) * 2 * np.pi / count
        points = circle(angles, np.cos(latitude)) + [0.0, 0.0, np.sin(latitude)]
        curvature = geodesic_curvature(points, points)
        errors.append(np.abs(curvature - np.tan(latitude)).max() / abs(np.tan(latitude)))
    assert errors[0] < 0.01
    # Second order: a quarter of the spacing gives a sixteenth of the error.
    assert errors[1] < 0.1 * errors[0]


def test_helix_parallel_and_meridian_of_a_cylinder():
    """A parallel of a cylinder is a geodesic, since it is straight after unrolling."""
    points = circle(ANGLES)
    np.testing.assert_allclose(geodesic_curvature(points, points), 0.0, atol=1e-12)


def test_curvature_scales_with_one_over_length_and_turns_with_the_surface():
    generator = np.random.default_rng(0)
    wobble = circle(ANGLES, 1.0) * (1 + 0.1 * np.sin(3 * ANGLES))[:, None]
    expected = geodesic_curvature(wobble, UP)
    turn = Rotation.from_rotvec(generator.normal(size=3))
    moved = turn.apply(5.0 * wobble) + [7.0, 8.0, 9.0]
    np.testing.assert_allclose(geodesic_curvature(moved, turn.apply(UP)), expected / 5.0, rtol=1e-9)


@pytest.mark.parametrize("count", [7, 60, 501])
def test_resampled_points_are_evenly_spaced_on_the_polyline(count):
    uneven = np.sort(np.random.default_rng(4).uniform(0, 2 * np.pi, 80))
    polygon = circle(uneven)
    points, segment = resample(polygon, count)
    assert points.shape == (count, 3)
    np.testing.assert_array_equal(points[0], polygon[0])
    start, end = polygon[segment], np.roll(polygon, -1, axis=0)[segment]
    side = np.linalg.norm(end - start, axis=1)
    along = np.linalg.norm(points - start, axis=1)
    # Each point lies on its segment, at equal distances along the polygon.
    np.testing.assert_allclose(along + np.linalg.norm(points - end, axis=1), side, atol=1e-12)
    before = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(polygon, axis=0), axis=1))])
    total = before[-1] + np.linalg.norm(polygon[0] - polygon[-1])
    np.testing.assert_allclose(before[segment] + along, np.arange(count) * total / count, atol=1e-9)


def test_open_arc_has_the_curvature_of_its_radius_between_its_ends():
    arc = circle(ANGLES[:20], 2.0)
    curvature = geodesic_curvature(arc, UP[:20], closed=False)
    np.testing.assert_allclose(curvature[1:-1], 0.5)
    np.testing.assert_array_equal(curvature[[0, -1]], 0.0)


@pytest.mark.parametrize("count", [2, 60, 501])
def test_resampled_open_polyline_keeps_its_ends(count):
    line = circle(np.sort(np.random.default_rng(4).uniform(0, 4.0, 80)))
    points, segment = resample(line, count, closed=False)
    np.testing.assert_allclose(points[[0, -1]], line[[0, -1]], atol=1e-12)
    lengths = np.linalg.norm(np.diff(line, axis=0), axis=1)
    along = np.linalg.norm(points - line[segment], axis=1)
    places = np.concatenate([[0.0], np.cumsum(lengths)])[segment] + along
    np.testing.assert_allclose(places, np.linspace(0.0, lengths.sum(), count), atol=1e-9)


def test_length_and_steps_of_closed_and_open_curves(ball):
    points = random_surface_points(ball, 5, seed=1)
    place = points.positions(ball)
    gaps = np.linalg.norm(np.diff(place, axis=0), axis=1).sum()
    back = np.linalg.norm(place[0] - place[-1])
    none = np.zeros(0, dtype=np.int64)
    closed, opened = (
        curve_on_mesh(ball, kind, points.faces, points.barycentric, none) for kind in (True, False)
    )
    assert opened.length == pytest.approx(gaps)
    assert closed.length == pytest.approx(gaps + back)
    assert closed.steps.shape == (5, 3) and opened.steps.shape == (4, 3)
    np.testing.assert_allclose(closed.steps.sum(axis=0), 0.0, atol=1e-15)
    np.testing.assert_allclose(closed.points, place, rtol=0, atol=1e-15)


@pytest.fixture
def square():
    """A closed curve around a square of side 2, with points at corners and middles of sides."""
    sides = np.array([[0, 0], [1, 0], [2, 0], [2, 1], [2, 2], [1, 2], [0, 2], [0, 1]], dtype=float)
    points = np.concatenate([sides, np.zeros((8, 1))], axis=1)
    return SurfaceCurve(True, np.zeros(8, int), np.zeros((8, 3)), points, np.array([1, 3, 6]))


@pytest.mark.parametrize(("leg", "points"), [(0, [1, 2, 3]), (1, [3, 4, 5, 6]), (2, [6, 7, 0, 1])])
def test_points_of_a_leg_include_both_control_points(square, leg, points):
    assert points_of_leg(square, leg).tolist() == points


def test_positions_along_a_leg_are_those_of_the_nearest_points(square):
    positions = np.array([[-0.5, 1.5, 0.0], [0.25, -0.25, 0.0], [0.0, 3.0, 0.0], [9.0, 0.0, 0.0]])
    np.testing.assert_allclose(along_leg(square, 2, positions), [0.5, 2.25, 0.0, 3.0])
    assert len(along_leg(square, 0, np.zeros((0, 3)))) == 0


@pytest.mark.parametrize(
    ("closed", "control_index", "expected"),
    [
        (True, [0, 1, 2], [1.0, 2.0, 3.0]),
        (True, [1, 2, 0], [2.0, 3.0, 1.0]),
        (True, [1, -1, 0], [5.0, 1.0]),
        (True, [2], [6.0]),
        (True, [-1], []),
        (False, [0, 2], [3.0]),
    ],
)
def test_leg_lengths(closed, control_index, expected):
    # The sides have the lengths 1, 2 and 3, so the triangle has no area.
    points = np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [3.0, 0.0, 0.0]])
    curve = SurfaceCurve(closed, np.zeros(3, int), np.eye(3), points, np.array(control_index))
    np.testing.assert_allclose(leg_lengths(curve), expected, atol=1e-12)
