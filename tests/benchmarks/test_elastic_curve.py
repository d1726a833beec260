"""The yardstick of fairness against closed forms."""

import numpy as np
import pytest

from benchmarks.elastic_curve import elastic_curve
from benchmarks.measures import bending
from benchmarks.polylines import NearestPoints
from nicmm_core import shapes

CIRCLE = 4 * np.pi**2
"""L ∮ κ² ds of a plane circle."""


@pytest.fixture(scope="module")
def ball():
    return shapes.sphere(4)


def wavy_ring(mesh, axis, waves=5, height=0.2, points=300, controls=4):
    """A closed curve that swings about the great circle across an axis and meets it at controls."""
    across = np.cross(axis, [0.0, 0.0, 1.0])
    across /= np.linalg.norm(across)
    angle = np.arange(points) * 2 * np.pi / points
    ring = np.outer(np.cos(angle), across) + np.outer(np.sin(angle), np.cross(axis, across))
    ring += height * np.outer(np.sin(controls * angle) * np.sin(waves * angle), axis)
    ring /= np.linalg.norm(ring, axis=1, keepdims=True)
    return NearestPoints(mesh).curve(ring, np.arange(controls) * points // controls)


def test_points_on_a_great_circle_give_the_great_circle(ball):
    axis = np.array([1.0, 2.0, 2.0]) / 3.0
    start = wavy_ring(ball, axis)
    result = elastic_curve(ball, start)

    assert bending(ball, start) > CIRCLE
    assert result.energies[-1] < 0.01
    assert bending(ball, result.curve) < 0.3  # what the facets of the ball leave
    assert np.abs(result.curve.points @ axis).max() < 5e-3
    assert result.curve.length == pytest.approx(2 * np.pi, rel=1e-2)


def test_points_on_a_circle_of_the_plane_give_a_circle():
    disc = shapes.disc(24)
    angle = np.arange(240) * 2 * np.pi / 240
    radius = 0.6 + 0.1 * np.sin(6 * angle) * np.sin(2 * angle)
    ring = np.stack([radius * np.cos(angle), radius * np.sin(angle), 0 * angle], axis=1)
    start = NearestPoints(disc).curve(ring, np.arange(4) * 60)
    result = elastic_curve(disc, start)

    assert result.energies[-1] == pytest.approx(CIRCLE, rel=2e-2)
    assert np.linalg.norm(result.curve.points, axis=1) == pytest.approx(0.6, abs=5e-3)


def test_energy_falls_and_control_points_stay(ball):
    start = wavy_ring(ball, np.array([0.6, 0.8, 0.0]), waves=7)
    result = elastic_curve(ball, start, nodes=100)

    assert (np.diff(result.energies) < 0.0).all()
    fixed = start.points[start.control_index]
    np.testing.assert_allclose(
        result.curve.points[result.curve.control_index], fixed, rtol=0, atol=1e-12
    )
    assert NearestPoints(ball).greatest_distance(result.curve.points) < 2e-3


def test_control_points_out_of_order_are_refused(ball):
    start = wavy_ring(ball, np.array([0.6, 0.8, 0.0]))
    swapped = type(start)(
        start.closed,
        start.faces,
        start.barycentric,
        start.points,
        start.control_index[[0, 2, 1, 3]],
    )
    with pytest.raises(ValueError, match="follow one another"):
        elastic_curve(ball, swapped)
