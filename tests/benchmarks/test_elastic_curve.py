"""Tests the elastic curves, the reference for fairness, against closed forms."""

import numpy as np
import pytest

from benchmarks.elastic_curve import elastic_curve
from benchmarks.measures import bending, curvature_along, squared_curvature
from benchmarks.polylines import NearestPoints
from nicmm_core import shapes

CIRCLE = 4 * np.pi**2
"""Bending L ∮ κ² ds of a circle in the plane."""


@pytest.fixture(scope="module")
def ball():
    return shapes.sphere(4)


def wavy_ring(mesh, axis, waves=5, height=0.2, points=300, controls=4):
    """Closed curve that oscillates about a great circle and meets it at the control points.

    The great circle is perpendicular to ``axis``.
    """
    across = np.cross(axis, [0.0, 0.0, 1.0])
    across /= np.linalg.norm(across)
    angle = np.arange(points) * 2 * np.pi / points
    ring = np.outer(np.cos(angle), across) + np.outer(np.sin(angle), np.cross(axis, across))
    ring += height * np.outer(np.sin(controls * angle) * np.sin(waves * angle), axis)
    ring /= np.linalg.norm(ring, axis=1, keepdims=True)
    return NearestPoints(mesh).curve(ring, np.arange(controls) * points // controls)


@pytest.mark.slow
def test_points_on_a_great_circle_give_the_great_circle(ball):
    axis = np.array([1.0, 2.0, 2.0]) / 3.0
    start = wavy_ring(ball, axis)
    result = elastic_curve(ball, start, nodes=120)

    assert bending(ball, start) > CIRCLE
    assert result.energies[-1] < 0.01
    assert bending(ball, result.curve) < 0.3  # discretisation error of the facets
    assert np.abs(result.curve.points @ axis).max() < 5e-3
    assert result.curve.length == pytest.approx(2 * np.pi, rel=1e-2)


@pytest.mark.slow
def test_points_on_a_circle_of_the_plane_give_a_circle():
    disc = shapes.disc(24)
    angle = np.arange(240) * 2 * np.pi / 240
    radius = 0.6 + 0.1 * np.sin(6 * angle) * np.sin(2 * angle)
    ring = np.stack([radius * np.cos(angle), radius * np.sin(angle), 0 * angle], axis=1)
    start = NearestPoints(disc).curve(ring, np.arange(4) * 60)
    result = elastic_curve(disc, start, nodes=120)

    assert result.energies[-1] == pytest.approx(CIRCLE, rel=2e-2)
    assert np.linalg.norm(result.curve.points, axis=1) == pytest.approx(0.6, abs=5e-3)


@pytest.mark.slow
def test_energy_falls_and_control_points_stay(ball):
    start = wavy_ring(ball, np.array([0.6, 0.8, 0.0]), waves=7)
    result = elastic_curve(ball, start, nodes=100)

    assert (np.diff(result.energies) < 0.0).all()
    fixed = start.points[start.control_index]
    np.testing.assert_allclose(
        result.curve.points[result.curve.control_index], fixed, rtol=0, atol=1e-12
    )
    assert NearestPoints(ball).greatest_distance(result.curve.points) < 2e-3


def wavy_arc(mesh, place, controls, waves=6, height=0.1, points=241):
    """Open curve that oscillates about an arc and meets it at evenly spaced control points.

    ``place(along, aside)`` returns positions for fractions of the arc and offsets across it.
    """
    along = np.linspace(0.0, 1.0, points)
    swing = np.sin(waves * np.pi * along) * np.sin((controls - 1) * np.pi * along)
    index = np.arange(controls) * (points - 1) // (controls - 1)
    return NearestPoints(mesh).curve(place(along, height * swing), index, closed=False)


@pytest.mark.slow
def test_open_curve_on_a_great_circle_is_its_arc(ball):
    def place(along, aside):
        angle = 2.5 * along
        ring = np.stack([np.cos(angle), np.sin(angle), aside], axis=1)
        return ring / np.linalg.norm(ring, axis=1, keepdims=True)

    start = wavy_arc(ball, place, controls=3)
    result = elastic_curve(ball, start, nodes=120)
    assert bending(ball, start) > 10.0
    assert result.energies[-1] < 0.01
    assert bending(ball, result.curve) < 0.1  # discretisation error of the facets
    assert not result.curve.closed
    assert np.abs(result.curve.points[:, 2]).max() < 5e-3
    assert result.curve.length == pytest.approx(2.5, rel=1e-2)


@pytest.mark.slow
@pytest.mark.parametrize("controls, share", [(5, 0.1), (9, 0.05)])
def test_open_curve_through_points_on_an_arc_of_the_plane(controls, share):
    """The result is nearly the arc but slightly fairer, since it may straighten near its ends."""
    disc, angle = shapes.disc(24), 0.9 * np.pi

    def place(along, aside):
        turn = np.stack([np.cos(angle * along), np.sin(angle * along), 0 * along], axis=1)
        return (0.6 + aside[:, None]) * turn

    result = elastic_curve(disc, wavy_arc(disc, place, controls), nodes=120)
    assert (1.0 - 2.5 * share) * angle**2 < result.energies[-1] < angle**2
    assert np.linalg.norm(result.curve.points, axis=1) == pytest.approx(0.6, abs=0.15 * share)
    curvature = curvature_along(disc, result.curve)
    assert np.abs(curvature[:3]).max() < 0.5 and np.abs(curvature[-3:]).max() < 0.5
    assert curvature[54:74] == pytest.approx(1.0 / 0.6, rel=1.5 * share)


@pytest.mark.slow
def test_energy_of_an_open_curve_falls_and_control_points_stay(ball):
    def place(along, aside):
        ring = np.stack([np.cos(4.0 * along), np.sin(4.0 * along), 0.4 + aside], axis=1)
        return ring / np.linalg.norm(ring, axis=1, keepdims=True)

    start = wavy_arc(ball, place, controls=4, waves=9)
    result = elastic_curve(ball, start, nodes=100)
    assert (np.diff(result.energies) < 0.0).all()
    index = result.curve.control_index
    assert index[0] == 0 and index[-1] == len(result.curve.points) - 1
    fixed = start.points[start.control_index]
    np.testing.assert_allclose(result.curve.points[index], fixed, rtol=0, atol=1e-12)


def test_bending_of_arcs_and_circles():
    """Closed forms: κ is 1 / r along an arc of angle a, so L ∫ κ² ds is a²."""
    disc = shapes.disc(24)
    for angle, closed in ((2 * np.pi, True), (1.5, False), (4.0, False)):
        turn = np.linspace(0.0, angle, 4000, endpoint=not closed)
        ring = 0.5 * np.stack([np.cos(turn), np.sin(turn), 0 * turn], axis=1)
        arc = NearestPoints(disc).curve(ring, np.zeros(0, dtype=np.int64), closed)
        for samples in (128, 240):
            # The sum of an open curve leaves out its two ends.
            left_out = 0.0 if closed else 1.0 / (samples - 1)
            assert bending(disc, arc, samples) == pytest.approx(
                angle**2 * (1.0 - left_out), rel=2e-3
            )
            assert squared_curvature(disc, arc, samples) == pytest.approx(
                2.0 * angle * (1.0 - left_out), rel=2e-3
            )


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
