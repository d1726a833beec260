"""Nodes of several curves, evenly spaced between fixed nodes and along traces."""

import numpy as np
import pytest

from nicmm_core import shapes
from nicmm_core.geometry.surface_points import joined
from nicmm_core.relaxation.batch_relaxation import BatchConfig, relax_batch
from nicmm_core.relaxation.curve_nodes import curve_surface, nodes_at
from nicmm_core.relaxation.even_nodes import resampled
from tests.core.checks import points_near

SIZE = 24
FIXED = [0, 7, 15, SIZE - 1]


@pytest.fixture(scope="module")
def sphere():
    return curve_surface(shapes.sphere(4))


def circles(surface, closed):
    """Two circles of latitude whose nodes are unevenly spaced, and which nodes are fixed."""
    angle = np.arange(SIZE) * 2.0 * np.pi / (SIZE if closed else 1.3 * SIZE)
    angle = angle + 0.08 * np.sin(3.0 * angle)
    places = []
    for height in (0.1, -0.4):
        ring = np.sqrt(1.0 - height**2)
        z = np.full(SIZE, height)
        positions = np.column_stack([ring * np.cos(angle), ring * np.sin(angle), z])
        places.append(points_near(surface.mesh, positions))
    fixed = np.isin(np.arange(SIZE), FIXED)
    return nodes_at(surface, joined(places), closed, 2), np.tile(fixed, 2)


def unevenness(nodes, fixed):
    """Greatest ratio of the longest to the shortest step of a leg."""
    steps = nodes.by_curve(nodes.step_lengths)
    begins = np.flatnonzero(nodes.by_curve(fixed)[0])
    if not nodes.closed:
        steps, begins = steps[:, :-1], begins[:-1]
    longest = np.maximum.reduceat(steps, begins, axis=1)
    return (longest / np.minimum.reduceat(steps, begins, axis=1)).max()


@pytest.mark.parametrize("closed", [True, False])
@pytest.mark.parametrize("times", [1, 2, 3])
def test_new_nodes_are_even_and_fixed_nodes_stay(sphere, closed, times):
    nodes, fixed = circles(sphere, closed)
    found, former = resampled(sphere, nodes, fixed, times)
    assert len(found.positions) == 2 * (times * SIZE if closed else times * (SIZE - 1) + 1)
    np.testing.assert_array_equal(former[former >= 0], np.flatnonzero(fixed))
    np.testing.assert_array_equal(
        np.flatnonzero(found.by_curve(former)[1] >= 0), times * np.array(FIXED)
    )
    np.testing.assert_array_equal(found.positions[former >= 0], nodes.positions[fixed])
    assert unevenness(nodes, fixed) > 1.4
    assert unevenness(found, former >= 0) < 1.05
    before, after = nodes.step_lengths.sum(), found.step_lengths.sum()
    assert after == pytest.approx(before, rel=0.03)


@pytest.mark.parametrize("closed", [True, False])
def test_moved_nodes_are_even_and_fixed_nodes_stay(sphere, closed):
    nodes, fixed = circles(sphere, closed)
    config = BatchConfig(iterations=1, longest_move=1e-9, contact=False)
    found = relax_batch(sphere, nodes, fixed, 1.0, config)  # respaces them before the one step
    np.testing.assert_array_equal(found.positions[fixed], nodes.positions[fixed])
    assert unevenness(found, fixed) < 1.05


def test_a_long_trace_around_a_thin_edge_gets_more_nodes():
    """Two nodes opposite each other on a thin plate are close, but the trace is long."""
    flat = np.array([20.0, 20.0, 0.05])
    ball = shapes.sphere(5)
    plate = curve_surface(type(ball)(ball.vertices * flat, ball.faces))
    x = np.array([10.0, 14.0, 18.0, 18.0, 14.0, 10.0])
    side = np.array([1.0, 1.0, 1.0, -1.0, -1.0, -1.0])
    z = side * flat[2] * np.sqrt(1.0 - (x / flat[0]) ** 2)
    nodes = nodes_at(plate, points_near(plate.mesh, np.column_stack([x, 0.0 * x, z])), False)
    assert nodes.step_lengths[2] < 0.05 * nodes.step_lengths[1]
    fixed = np.isin(np.arange(6), (0, 5))
    found, _ = resampled(plate, nodes, fixed, 4)
    assert found.positions[:, 0].max() > 19.5
    assert (found.positions[:, 0] > 18.0).sum() >= 5
