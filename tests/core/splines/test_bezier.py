"""Tests that Bézier splines keep the tolerance, have few knots and are smooth except at corners."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from nicmm_core.geometry.tolerances import CLEAN_CURVE
from nicmm_core.splines.bezier import fit_bezier
from nicmm_core.splines.polyline import angles
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
SAMPLES = 3000
"""Approximate number of points on all cubics; their chords are very close to the cubics."""


def sampled(spline):
    """Points along all cubics of a spline."""
    following = np.roll(np.arange(len(spline.knots)), -1)
    ends = spline.knots, spline.right, spline.left[following], spline.knots[following]
    cubics = np.stack(ends, axis=1)[: None if spline.closed else -1]
    count = max(SAMPLES // len(cubics), 8)
    t = (np.arange(count) / count)[:, None]
    basis = np.concatenate([(1 - t) ** 3, 3 * t * (1 - t) ** 2, 3 * t**2 * (1 - t), t**3], axis=1)
    points = np.einsum("tb,sbd->std", basis, cubics).reshape(-1, 3)
    return points if spline.closed else np.concatenate([points, spline.knots[-1:]])


def turns(spline):
    """Angles between the two handles of each knot, in radians."""
    found = angles(spline.knots - spline.left, spline.right - spline.knots)
    return found if spline.closed else found[1:-1]


def turning(points, closed):
    """Sum of all turning angles of a polyline."""
    steps = np.diff(np.concatenate([points, points[:1]]) if closed else points, axis=0)
    steps = np.concatenate([steps, steps[:1]]) if closed else steps
    return angles(steps[:-1], steps[1:]).sum()


def assert_fits(points, closed, control_index, tolerance, slack=1.01):
    """Fit a spline, assert everything that holds for any polyline, and return the spline."""
    spline = fit_bezier(points, closed, control_index, tolerance)
    assert spline.closed == closed
    assert spline.knots.shape == spline.left.shape == spline.right.shape
    places = sampled(spline)
    assert np.isfinite(places).all()
    assert strays(places, points, closed) <= tolerance * slack
    assert strays(subdivided(points, closed), places, closed) <= tolerance * slack
    passed = control_index >= 0
    at_controls = spline.knots[spline.control_index[passed]]
    np.testing.assert_array_equal(at_controls, points[control_index[passed]])
    np.testing.assert_array_equal(spline.control_index[~passed], -1)
    if not closed:
        np.testing.assert_array_equal(spline.knots[[0, -1]], points[[0, -1]])
    return spline


@pytest.mark.parametrize("controls", [NONE, np.array([900]), np.array([900, -1, 40, 1500])])
def test_circle_has_few_knots(controls):
    points = circle(2 * np.pi * irregular(2000, seed=0))
    spline = assert_fits(points, True, controls, 3e-4)
    assert len(spline.knots) <= 10
    np.testing.assert_allclose(turns(spline), 0.0, atol=1e-6)
    radii = np.linalg.norm(sampled(spline), axis=1)
    np.testing.assert_allclose(radii, 1.0, atol=3.2e-4)
    # A handle for an arc φ of the unit circle has the length 4/3 tan(φ / 4), about φ / 3.
    lengths = np.linalg.norm(spline.right - spline.knots, axis=1)
    following = np.roll(spline.knots, -1, axis=0)
    arcs = 2.0 * np.arcsin(0.5 * np.linalg.norm(following - spline.knots, axis=1))
    np.testing.assert_allclose(lengths, 4.0 / 3.0 * np.tan(arcs / 4.0), rtol=0.05)


def test_helix():
    at = irregular(2000, seed=1) * 20.0
    points = np.stack([np.cos(at), np.sin(at), 0.2 * at], axis=1)
    spline = assert_fits(points, False, np.array([1500, 0, 1999, 700]), 1e-3)
    assert len(spline.knots) <= 25
    np.testing.assert_allclose(turns(spline), 0.0, atol=1e-6)
    assert (np.argsort(spline.control_index) == [1, 3, 0, 2]).all()


def test_a_cubic_is_found_again():
    """One cubic is enough, although its tangents are estimated from short parts of the polyline."""
    t = np.linspace(0.0, 1.0, 500)[:, None]
    ends = np.array([[0.0, 0, 0], [1, 0, 0], [1, 1, 1], [2, 1, 1]])
    basis = [(1 - t) ** 3, 3 * t * (1 - t) ** 2, 3 * t**2 * (1 - t), t**3]
    points = np.concatenate(basis, axis=1) @ ends
    spline = assert_fits(points, False, NONE, 1e-3)
    assert len(spline.knots) == 2
    np.testing.assert_allclose(spline.right[0], ends[1], atol=0.02)
    np.testing.assert_allclose(spline.left[1], ends[2], atol=0.02)


def test_corners_have_free_handles():
    points = np.roll(square(10), 3, axis=0)
    spline = assert_fits(points, True, np.array([1, 43]), 1e-4)
    corner = np.isin(spline.knots[:, 0], [0, 1]) & np.isin(spline.knots[:, 1], [0, 1])
    assert corner.sum() == 4
    np.testing.assert_allclose(turns(spline)[corner], np.pi / 2.0, atol=1e-6)
    np.testing.assert_allclose(turns(spline)[~corner], 0.0, atol=1e-6)
    assert len(spline.knots) <= 6


def test_a_weak_corner_is_rounded():
    """A turn of 10° does not count as a corner, so the handles are collinear."""
    slope = np.tan(np.radians(10.0))
    x = np.linspace(-1.0, 1.0, 41)
    points = np.stack([x, slope * np.maximum(x, 0.0), 0.0 * x], axis=1)
    spline = assert_fits(points, False, NONE, 1e-4)
    np.testing.assert_allclose(turns(spline), 0.0, atol=1e-6)
    assert len(spline.knots) <= 5


def test_a_given_corner_has_free_handles():
    """However weak it is, both sides stay exactly straight."""
    slope = np.tan(np.radians(10.0))
    x = np.linspace(-1.0, 1.0, 41)
    points = np.stack([x, slope * np.maximum(x, 0.0), 0.0 * x], axis=1)
    spline = fit_bezier(points, False, NONE, 1e-4, corners=np.array([20]))
    np.testing.assert_array_equal(spline.knots, points[[0, 20, 40]])
    assert turns(spline) == pytest.approx([np.radians(10.0)], abs=1e-9)
    assert strays(sampled(spline), points, False) < 1e-12


@pytest.mark.parametrize("first", [0, 300])
def test_corners_of_a_smooth_curve(first):
    """The arcs on both sides of a given corner are fitted apart, each to its own side."""
    at = np.linspace(0.0, np.pi, 301)
    arc = np.stack([np.cos(at), np.sin(at), 0.0 * at], axis=1)
    crescent = np.concatenate([arc[:-1], arc[:-1] * [-1.0, 0.15, 1.0]])
    points, corners = np.roll(crescent, -first, axis=0), (np.array([0, 300]) - first) % 600
    spline = fit_bezier(points, True, corners, 1e-3, corners)
    sharp = np.isin(np.arange(len(spline.knots)), spline.control_index)
    assert sharp.sum() == 2
    np.testing.assert_allclose(turns(spline)[~sharp], 0.0, atol=1e-6)
    assert (turns(spline)[sharp] > np.radians(60.0)).all()
    assert strays(sampled(spline), points, True) < 1.01e-3


def test_a_corner_need_not_be_a_control_point():
    points = circle(np.linspace(0.0, 2.0 * np.pi, 400, endpoint=False))
    spline = fit_bezier(points, True, np.array([50, -1]), 1e-3, corners=np.array([210]))
    np.testing.assert_array_equal(spline.knots[spline.control_index[0]], points[50])
    assert spline.control_index[1] == -1
    assert (spline.knots == points[210]).all(axis=1).any()
    assert strays(sampled(spline), points, True) < 1.01e-3


def test_a_square_designed_with_corners():
    """Four knots, and all handles on the sides."""
    curve = designed_square()
    spline = fit_bezier(curve.points, True, curve.control_index, 1e-4, curve.control_index)
    np.testing.assert_allclose(spline.knots, SQUARE, atol=1e-12)
    np.testing.assert_allclose(np.abs(sampled(spline)[:, :2]).max(axis=1), 0.5, atol=2e-4)
    np.testing.assert_allclose(turns(spline), 0.5 * np.pi, atol=1e-2)


def test_zigzag_within_the_tolerance_does_not_show():
    """Exact curves have such zigzags where they cross edges."""
    at = 2.0 * np.pi * irregular(1000, seed=4)
    points = circle(at, (1.0 + 2e-5 * (-1.0) ** np.arange(1000))[:, None])
    spline = assert_fits(points, True, np.array([100, 600]), 3e-4)
    assert len(spline.knots) <= 12
    assert turning(sampled(spline), True) == pytest.approx(2.0 * np.pi, rel=0.02)


@pytest.mark.slow
@pytest.mark.parametrize("name", DESIGNS)
@pytest.mark.parametrize("share", [CLEAN_CURVE, 10 * CLEAN_CURVE])
def test_designed_curve(name, share):
    mesh, curve = designed(name)
    tolerance = share * mesh.diagonal
    spline = assert_fits(curve.points, curve.closed, curve.control_index, tolerance)
    assert len(spline.knots) < 0.5 * len(curve.points)
    turn = turns(spline)
    # At each knot the spline is either smooth or follows a corner of the polyline.
    assert ((turn < 1e-6) | (turn > np.radians(15.0))).all()
    if name == "ball":
        assert turn.max() < 1e-6
    # It has no wiggles: it turns no more than the polyline itself.
    points = sampled(spline)
    assert turning(points, curve.closed) < 1.05 * turning(curve.points, curve.closed)


def test_scale_does_not_matter():
    points = circle(2 * np.pi * irregular(500, seed=2))
    one = fit_bezier(points, True, np.array([7, 200]), 1e-3)
    other = fit_bezier(points * 2.0**-20, True, np.array([7, 200]), 1e-3 * 2.0**-20)
    np.testing.assert_allclose(other.right * 2.0**20, one.right, atol=1e-9)


def test_two_points():
    points = np.array([[0.0, 0, 0], [3, 0, 0]])
    spline = fit_bezier(points, False, np.array([1, 0, -1]), 1e-3)
    np.testing.assert_array_equal(spline.knots, points)
    np.testing.assert_array_equal(spline.control_index, [1, 0, -1])
    np.testing.assert_allclose(spline.right, [[1.0, 0, 0], [4, 0, 0]], atol=1e-6)
    np.testing.assert_allclose(spline.left, [[-1.0, 0, 0], [2, 0, 0]], atol=1e-6)


def test_legs_of_one_segment():
    points = circle(np.arange(13) * 2 * np.pi / 13)
    spline = assert_fits(points, True, np.arange(13), 1e-3)
    np.testing.assert_array_equal(spline.knots[spline.control_index], points)
    np.testing.assert_allclose(turns(spline), 0.0, atol=1e-6)


@pytest.mark.parametrize("closed", [True, False])
def test_repeated_points(closed):
    points = np.repeat(circle(2 * np.pi * irregular(300, seed=5)), 3, axis=0)
    spline = assert_fits(points, closed, np.array([31, -1, 150, 152, 899]), 1e-2)
    assert len(spline.knots) < 20
    one_place = fit_bezier(np.ones((4, 3)), closed, np.array([1, -1]), 1e-3)
    np.testing.assert_array_equal(one_place.knots, np.ones((1, 3)))
    np.testing.assert_array_equal(one_place.control_index, [0, -1])


def test_a_closed_curve_has_two_knots():
    """Even if one cubic from a corner back to it would be enough."""
    t = np.linspace(0.0, 1.0, 200)[:, None]
    drop = 3 * t * (1 - t) ** 2 * [1.0, 1, 0] + 3 * t**2 * (1 - t) * [1.0, -1, 0]
    spline = assert_fits(drop[:-1], True, np.array([0]), 1e-3)
    assert 2 <= len(spline.knots) <= 4
    assert turns(spline).max() == pytest.approx(np.pi / 2.0, abs=0.1)


def test_noise_is_followed_where_the_tolerance_demands_it():
    generator = np.random.default_rng(0)
    points = circle(np.linspace(0.0, 2 * np.pi, 300, endpoint=False))
    points += generator.normal(size=points.shape) * 1e-2
    assert_fits(points, True, np.array([100, 200]), 1e-4)


@pytest.mark.slow
@settings(max_examples=12)
@given(
    seed=st.integers(0, 10_000),
    count=st.integers(4, 150),
    closed=st.booleans(),
    controls=st.lists(st.floats(0.0, 0.999), max_size=5),
)
def test_any_polyline(seed, count, closed, controls):
    """Smooth closed curves with irregular points, which may be cut open at one of them."""
    amplitudes = np.random.default_rng(seed).normal(size=(2, 3, 3)) / [[[1], [4], [9]]]
    at = 2.0 * np.pi * irregular(count, seed)[:, None] * np.arange(1, 4)
    points = np.cos(at) @ amplitudes[0] + np.sin(at) @ amplitudes[1]
    index = np.array([int(count * share) for share in controls], dtype=np.int64)
    assert_fits(points, closed, index, 1e-2, slack=1.05)
