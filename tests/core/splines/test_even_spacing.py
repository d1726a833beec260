"""Tests that evenly spaced points keep the tolerance and the control points."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import nicmm_core as nicmm
from nicmm_core import shapes
from nicmm_core.geometry.tolerances import CLEAN_CURVE, of_clean_curve
from nicmm_core.splines.even_spacing import even_curve, even_places
from tests.core.checks import circle
from tests.core.splines.clean_curves import (
    DESIGNS,
    SQUARE,
    designed,
    designed_square,
    irregular,
    square,
    strays,
    subdivided,
)

NONE = np.zeros(0, dtype=np.int64)
ROUNDED = 1.0 + 1e-9


def positions(points, segment, share):
    following = points[(segment + 1) % len(points)]
    return (1.0 - share)[:, None] * points[segment] + share[:, None] * following


def legs(places, closed, index):
    """Chord lengths of each leg."""
    bounds = np.unique(index[index >= 0])
    steps = np.linalg.norm(np.roll(places, -1, axis=0) - places, axis=1)
    if closed:
        turned = np.roll(steps, -bounds[0]) if len(bounds) else steps
        return np.split(turned, bounds[1:] - bounds[0]) if len(bounds) else [turned]
    bounds = np.unique(np.concatenate([bounds, [0, len(places) - 1]]))
    return np.split(steps[:-1], bounds[1:-1])


def assert_even(points, closed, control_index, tolerance):
    """Assert everything that holds if the tolerance can be met, and return the new points."""
    segment, share, index = even_places(points, closed, control_index, tolerance)
    assert ((share >= 0.0) & (share < 1.0)).all()
    assert (np.diff(np.unique(segment + share)) > 0.0).all()
    passed = control_index >= 0
    np.testing.assert_array_equal(segment[index[passed]], control_index[passed])
    np.testing.assert_array_equal(share[index[passed]], 0.0)
    np.testing.assert_array_equal(index[~passed], -1)
    places = positions(points, segment, share)
    if not closed:
        np.testing.assert_array_equal(places[[0, -1]], points[[0, -1]])
    assert strays(points, places, closed) <= tolerance * ROUNDED
    assert strays(subdivided(places, closed), points, closed) <= tolerance * ROUNDED
    for chords in legs(places, closed, index):
        assert chords.min() >= 0.5 * chords.mean() / ROUNDED
    return places, index


@pytest.mark.parametrize("count", [40, 300, 3000])
@pytest.mark.parametrize("closed", [True, False])
def test_circle_of_irregular_points(count, closed):
    points = circle(2 * np.pi * irregular(count, seed=count))
    # The tolerance is larger than the corners of the polygon, so it counts as round.
    tolerance = 0.05 if count == 40 else 3e-4
    controls = np.array([count // 3, 5, -1, count // 2])
    places, index = assert_even(points, closed, controls, tolerance)
    spacing = [chords.mean() for chords in legs(places, closed, index)]
    # At the greatest spacing s, the sagitta 1 - cos(s / 2) is the tolerance.
    greatest = 2.0 * np.arccos(1.0 - tolerance)
    assert max(spacing) <= 1.1 * greatest
    if count == 3000:
        assert len(places) <= 1.3 * 2.0 * np.pi / greatest
        assert max(chords.max() / chords.min() for chords in legs(places, closed, index)) < 1.05


def test_helix_between_control_points_in_any_order():
    at = irregular(2000, seed=1) * 20.0
    points = np.stack([np.cos(at), np.sin(at), 0.2 * at], axis=1)
    places, index = assert_even(points, False, np.array([1500, 0, 1999, 700]), 1e-3)
    assert (np.argsort(index) == [1, 3, 0, 2]).all()
    means = [chords.mean() for chords in legs(places, False, index)]
    assert max(means) < 1.1 * min(means)


def test_corners_are_points():
    """A square needs only its four corners, wherever its points begin."""
    for shift in (0, 3, 10):
        points = np.roll(square(10), shift, axis=0)
        places, _ = assert_even(points, True, NONE, 1e-4)
        assert len(places) == 4
        assert strays(np.array([[0.0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]]), places, True) == 0.0


def test_a_square_designed_with_corners():
    """Its corners are points, and no point between them leaves the sides."""
    curve = designed_square()
    places, index = assert_even(curve.points, True, curve.control_index, 1e-4)
    np.testing.assert_allclose(places[index], SQUARE, atol=1e-12)
    np.testing.assert_allclose(np.abs(places[:, :2]).max(axis=1), 0.5, atol=2e-4)
    assert len(places) <= 12


def test_points_beside_corners():
    """A point on either side of each corner, at the given distance, where there is room."""
    points, corners = np.roll(square(100), -100, axis=0), np.array([0, 200, 400, 600])
    segment, share, index = even_places(points, True, corners, 1e-4, corners[:3], beside=0.07)
    places = positions(points, segment, share)
    unit = np.array([[1.0, 0, 0], [1, 1, 0], [0, 1, 0], [0, 0, 0]])
    np.testing.assert_allclose(places[index], unit, atol=1e-12)
    for number, corner in enumerate(unit):
        for other in (unit[number - 1], unit[(number + 1) % 4]):
            beside = corner + 0.07 * (other - corner)
            there = np.linalg.norm(places - beside, axis=1).min() < 1e-12
            assert there == (number < 3)
    none = even_places(points, True, corners, 1e-4, corners, beside=0.4)
    assert len(none[0]) == 4  # there is no room for them


def test_points_beside_corners_keep_the_tolerance():
    at = irregular(2000, seed=1) * 20.0
    points = np.stack([np.cos(at), np.sin(at), 0.2 * at], axis=1)
    controls = np.array([0, 700, 1500, 1999])
    segment, share, _ = even_places(points, False, controls, 1e-3, controls[1:3], beside=0.01)
    places = positions(points, segment, share)
    assert len(places) == len(even_places(points, False, controls, 1e-3)[0]) + 4
    assert strays(points, places, False) <= 1e-3 * ROUNDED


def test_corners_between_control_points_need_few_points():
    places, _ = assert_even(square(100), True, np.array([37, 410]), 1e-4)
    assert len(places) <= 24


def test_a_corner_of_a_smooth_curve_takes_few_points():
    """Two quarter circles meet at a corner; even spacing alone would need thousands of points."""
    at = np.linspace(0.0, 0.5 * np.pi, 400)
    quarter = np.stack([np.sin(at), 1.0 - np.cos(at), 0.0 * at], axis=1)
    points = np.concatenate([quarter, quarter[1:] + quarter[-1]])
    places, _ = assert_even(points, False, NONE, 1e-4)
    assert len(places) <= 1.1 * np.pi / np.sqrt(8e-4)
    assert np.isclose(places, quarter[-1], atol=1e-12).all(axis=1).any()


def test_neighbouring_legs_have_similar_spacing():
    """A small bend follows a straight leg that by itself would need no inner points."""
    bend = 0.1 * circle(np.linspace(-0.5 * np.pi, 0.5 * np.pi, 300)) + [0.0, 0.1, 0.0]
    straight = np.stack([np.linspace(-3.0, -0.01, 300), *np.zeros((2, 300))], axis=1)
    points = np.concatenate([straight, bend])
    places, index = assert_even(points, False, np.array([0, 300, 599]), 1e-4)
    means = [chords.mean() for chords in legs(places, False, index)]
    assert means[1] < means[0] <= 2.0 * means[1] * (1.0 + 1e-3)


def test_a_leg_shorter_than_the_spacing_is_one_segment():
    points = circle(np.linspace(0.0, 2 * np.pi, 4000, endpoint=False))
    places, index = assert_even(points, True, np.array([0, 3, 2000]), 1e-3)
    assert index[1] == 1
    assert len(places) < 100


def test_scale_does_not_matter():
    points = circle(2 * np.pi * irregular(500, seed=2))
    one = even_places(points, True, np.array([7, 200]), 1e-3)
    # The factor is a power of two, so there is no rounding.
    other = even_places(points * 2.0**-20, True, np.array([7, 200]), 1e-3 * 2.0**-20)
    for first, second in zip(one, other, strict=True):
        np.testing.assert_array_equal(first, second)


@pytest.mark.slow
@pytest.mark.parametrize("name", DESIGNS)
@pytest.mark.parametrize("share", [CLEAN_CURVE, 10 * CLEAN_CURVE])
def test_designed_curve(name, share):
    mesh, curve = designed(name)
    tolerance = share * mesh.diagonal
    assert_even(curve.points, curve.closed, curve.control_index, tolerance)
    even = even_curve(mesh, curve, tolerance)
    corners = mesh.vertices[mesh.faces[even.faces]]
    np.testing.assert_array_equal(even.points, (even.barycentric[:, :, None] * corners).sum(axis=1))
    assert even.barycentric.min() >= 0.0
    np.testing.assert_allclose(even.barycentric.sum(axis=1), 1.0, atol=1e-12)
    # The points lie on the curve itself.
    assert strays(even.points, curve.points, curve.closed) < 1e-12 * mesh.diagonal
    at_controls = even.points[even.control_index]
    np.testing.assert_allclose(at_controls, curve.points[curve.control_index], atol=1e-12)
    assert even.closed == curve.closed


@pytest.mark.slow
def test_a_curve_on_a_soup_of_triangles():
    """Faces without common vertices make no difference to a curve on the same faces."""
    ball = shapes.sphere(2)
    separate = np.arange(ball.faces.size).reshape(-1, 3)
    soup = nicmm.Mesh(ball.vertices[ball.faces].reshape(-1, 3), separate)
    corners = [int(np.flatnonzero(ball.faces.ravel() == vertex)[0]) for vertex in (3, 60, 100)]
    curve = nicmm.design_curve(soup, corners).curves[0]
    tolerance = of_clean_curve(soup.diagonal)
    even = even_curve(soup, curve, tolerance)
    expected = even_curve(ball, curve, tolerance)
    np.testing.assert_allclose(even.points, expected.points, rtol=0, atol=1e-12)
    places = (even.barycentric[:, :, None] * soup.vertices[soup.faces[even.faces]]).sum(axis=1)
    np.testing.assert_allclose(places, even.points, rtol=0, atol=1e-12)


@pytest.mark.slow
def test_curve_of_another_mesh_is_refused(flat_disc):
    _, curve = designed("ball")
    with pytest.raises(nicmm.CurveError, match="not on this mesh"):
        even_curve(flat_disc, curve, 1e-3)


def test_two_points():
    points = np.array([[0.0, 0, 0], [1, 2, 3]])
    segment, share, index = even_places(points, False, np.array([1, 0]), 1e-3)
    np.testing.assert_array_equal(segment, [0, 1])
    np.testing.assert_array_equal(share, 0.0)
    np.testing.assert_array_equal(index, [1, 0])


def test_legs_of_one_segment():
    points = circle(np.arange(7) * 2 * np.pi / 7)
    segment, share, index = even_places(points, True, np.arange(7), 1e-3)
    np.testing.assert_array_equal(segment, np.arange(7))
    np.testing.assert_array_equal(index, np.arange(7))
    assert not share.any()


@pytest.mark.parametrize("closed", [True, False])
def test_repeated_points(closed):
    points = np.repeat(circle(2 * np.pi * irregular(100, seed=5)), 3, axis=0)
    places, _ = assert_even(points, closed, np.array([31, -1, 150, 270]), 0.05)
    assert len(places) < 60
    one_place = np.ones((4, 3))
    segment, share, index = even_places(one_place, closed, np.array([1, 2]), 1e-3)
    assert not share.any()
    np.testing.assert_array_equal(segment[index], [1, 2])


def test_a_closed_curve_has_three_points():
    points = circle(np.linspace(0.0, 2 * np.pi, 60, endpoint=False))
    for controls in (NONE, np.array([20]), np.array([20, 50]), np.array([-1, -1])):
        segment, _, _ = even_places(points, True, controls, 10.0)
        assert len(segment) >= 3


@pytest.mark.slow
def test_a_wild_polyline_gets_a_limited_number_of_regular_points():
    """With noise far above the tolerance, only the tolerance cannot be met."""
    generator = np.random.default_rng(0)
    points = circle(np.linspace(0.0, 2 * np.pi, 2000, endpoint=False))
    points += generator.normal(size=points.shape) * 1e-2
    results = [even_places(points, True, np.array([100, 900]), 1e-5) for _ in range(2)]
    for first, second in zip(*results, strict=True):
        np.testing.assert_array_equal(first, second)
    segment, share, index = results[0]
    assert len(segment) <= 8 * len(points)
    for chords in legs(positions(points, segment, share), True, index):
        assert chords.min() >= 0.5 * chords.mean() / ROUNDED


@pytest.mark.slow
@settings(max_examples=40)
@given(
    seed=st.integers(0, 10_000),
    count=st.integers(4, 200),
    closed=st.booleans(),
    controls=st.lists(st.floats(0.0, 0.999), max_size=6),
)
def test_any_smooth_polyline(seed, count, closed, controls):
    """Smooth closed curves with irregular points, which may be cut open at one of them."""
    amplitudes = np.random.default_rng(seed).normal(size=(2, 3, 3)) / [[[1], [4], [9]]]
    at = 2.0 * np.pi * irregular(count, seed)[:, None] * np.arange(1, 4)
    points = np.cos(at) @ amplitudes[0] + np.sin(at) @ amplitudes[1]
    index = np.array([int(count * share) for share in controls], dtype=np.int64)
    segment, share, found = even_places(points, closed, index, 1e-2)
    np.testing.assert_array_equal(segment[found], index)
    assert not share[found].any()
    places = positions(points, segment, share)
    for chords in legs(places, closed, found):
        assert chords.min() >= 0.5 * chords.mean() / ROUNDED
    assert len(segment) <= max(8 * count, 64 * (len(controls) + 2))


def test_tolerance_of_a_tube_is_a_tenth_of_its_radius():
    assert of_clean_curve(10.0) == pytest.approx(1e-3)
    assert of_clean_curve(10.0, 1.0) == pytest.approx(1e-3)
    assert of_clean_curve(10.0, 1e-4) == pytest.approx(1e-5)
