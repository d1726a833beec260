"""Tests that uncrossing removes crossings and keeps all nodes and the order of control points."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from nicmm_kernels import reordered

from nicmm_core import shapes
from nicmm_core.courses.uncrossing import remove_crossings
from nicmm_core.relaxation.curve_nodes import curve_surface, nodes_at
from tests.core.checks import crossing_steps, points_near, simple_curves


@pytest.fixture(scope="module")
def surface():
    return curve_surface(shapes.disc(24))


def nodes_on_disc(surface, plane, closed):
    points = points_near(surface.mesh, np.column_stack([plane, np.zeros(len(plane))]))
    return nodes_at(surface, points, closed)


def with_controls(count, numbers):
    visit = np.full(count, -1)
    visit[numbers] = np.arange(len(numbers))
    return visit


def crossings_in_plane(points, closed):
    """Pairs of crossing segments of a polyline (n, 2) in the plane, by signed areas."""
    n = len(points)
    ends = [(i, (i + 1) % n) for i in range(n if closed else n - 1)]

    def side(a, b, c):
        one, other = points[b] - points[a], points[c] - points[a]
        return one[0] * other[1] - one[1] * other[0]

    return [
        (i, j)
        for i, (a, b) in enumerate(ends)
        for j, (c, d) in enumerate(ends[:i])
        if len({a, b, c, d}) == 4
        and side(a, b, c) * side(a, b, d) < 0.0
        and side(c, d, a) * side(c, d, b) < 0.0
    ]


def test_a_figure_of_eight_becomes_a_loop(surface):
    t = 2.0 * np.pi * (np.arange(40) + 0.3) / 40
    eight = np.column_stack([0.7 * np.sin(t), 0.5 * np.sin(2.0 * t)])
    nodes = nodes_on_disc(surface, eight, True)
    assert not simple_curves(surface, nodes)[0]
    # With one control point in each half, the order does not change.
    visit = with_controls(40, [0, 25])
    found, passed, simple = remove_crossings(surface, nodes, visit, any_order=False)
    assert simple_curves(surface, found)[0] and simple[0]
    assert passed[passed >= 0].tolist() == [0, 1]
    # With two in each half, no loop can be passed in the other direction.
    visit = with_controls(40, [0, 8, 25, 33])
    found, passed, simple = remove_crossings(surface, nodes, visit, any_order=False)
    np.testing.assert_array_equal(passed, visit)
    assert not simple_curves(surface, found)[0] and not simple[0]
    found, passed, simple = remove_crossings(surface, nodes, visit, any_order=True)
    assert simple_curves(surface, found)[0] and simple[0]
    assert passed[passed >= 0].tolist() != [0, 1, 2, 3]


@pytest.mark.parametrize("opposite", [False, True])
def test_strands_that_cross_twice_exchange_their_parts(surface, opposite):
    """An open curve along a wave that returns beside it, or goes round and along it once more."""
    x = np.linspace(-0.7, 0.7, 29)
    there = np.column_stack([x, 0.15 * np.cos(2.2 * x / 0.7) + 0.011])
    back = np.column_stack([x[::-1], np.full(29, 0.02)])
    if opposite:
        turn = np.array([[0.8, 0.1]])
        curve = np.concatenate([there, turn, back])
    else:
        around = np.array([[0.8, -0.3], [0.0, -0.6], [-0.8, -0.3]])
        curve = np.concatenate([there, around, back[::-1]])
    nodes = nodes_on_disc(surface, curve, False)
    n = len(curve)
    assert len(crossing_steps(surface, nodes)) == 2
    visit = with_controls(n, [0, 1, 28, 29, n - 2, n - 1])
    found, passed, simple = remove_crossings(surface, nodes, visit, any_order=False)
    assert simple_curves(surface, found)[0] and simple[0]
    assert passed[passed >= 0].tolist() == list(range(6))
    # A control point on each part between the crossings prevents the exchange.
    visit = with_controls(n, [0, 1, 14, 28, 29, n - 15, n - 2, n - 1])
    found, passed, simple = remove_crossings(surface, nodes, visit, any_order=False)
    np.testing.assert_array_equal(passed, visit)


@pytest.mark.slow
@given(st.integers(0, 10**6), st.booleans())
def test_in_any_order_a_polygon_becomes_simple(seed, closed):
    """In the plane, every reordering replaces steps by shorter ones, so repetition terminates."""
    points = np.random.default_rng(seed).random((12, 2))
    control = np.arange(12) % 3 == 0
    control[-1] |= not closed
    order = np.arange(12)
    for _ in range(200):
        crossings = crossings_in_plane(points[order], closed)
        if not crossings:
            break
        sequence = reordered(np.array(crossings[:1]), control[order], closed, any_order=True)
        assert sorted(sequence) == list(range(12)) and sequence[0] == 0
        assert closed or sequence[-1] == 11
        order = order[sequence]
    assert not crossings_in_plane(points[order], closed)


@pytest.mark.slow
@given(st.integers(0, 10**6), st.booleans())
def test_the_order_of_control_points_stays_unless_any_is_allowed(seed, closed):
    generator = np.random.default_rng(seed)
    points = generator.random((16, 2))
    control = generator.random(16) < 0.3
    control[0] = True
    control[-1] |= not closed
    crossings = np.array(crossings_in_plane(points, closed)).reshape(-1, 2)
    sequence = reordered(crossings, control, closed, any_order=False)
    assert sorted(sequence) == list(range(16))
    passed = sequence[control[sequence]].tolist()
    assert passed == np.flatnonzero(control).tolist()


def test_curves_of_a_stack_are_independent(surface):
    t = 2.0 * np.pi * (np.arange(40) + 0.3) / 40
    eight = np.column_stack([0.7 * np.sin(t), 0.5 * np.sin(2.0 * t)])
    circle = 0.6 * np.column_stack([np.cos(t), np.sin(t)])
    points = points_near(
        surface.mesh, np.column_stack([np.concatenate([circle, eight, circle]), np.zeros(120)])
    )
    nodes = nodes_at(surface, points, True, 3)
    visit = np.tile(with_controls(40, [0, 25]), 3)
    found, passed, simple = remove_crossings(surface, nodes, visit, any_order=False)
    assert simple_curves(surface, nodes).tolist() == [True, False, True]
    assert simple_curves(surface, found).all() and simple.all()
    for part in (slice(0, 40), slice(80, 120)):
        np.testing.assert_array_equal(found.positions[part], nodes.positions[part])
        np.testing.assert_array_equal(passed[part], visit[part])
