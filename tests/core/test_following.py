"""Live drawing: `Designer.follow` by bounded work, and `Designer.resume` from an older curve."""

from dataclasses import replace

import numpy as np
import pytest

import nicmm_core as nicmm
from nicmm_core.design import FOLLOWING
from nicmm_core.geometry.surface_points import nearest_points
from tests.core.checks import assert_valid_curve, circle

ANGLES = np.array([0.0, 1.3, 2.5, 3.6, 5.0])
MOST_CALLS = 40


def on_ball(ball, heights, angles=ANGLES):
    """Points inside faces near the equator."""
    positions = circle(angles) + np.outer(heights, [0.0, 0.0, 1.0])
    positions /= np.linalg.norm(positions, axis=1, keepdims=True)
    return nearest_points(ball, positions)[0]


def to_rest(designer, points, **arguments):
    """Follow until the curve rests; return the last design and how many calls it took."""
    for calls in range(1, MOST_CALLS):
        design = designer.follow(points, **arguments)
        if design.status is not nicmm.Status.ITERATION_LIMIT:
            return design, calls
    raise AssertionError(f"not at rest after {MOST_CALLS} calls")


START = np.array([0.1, -0.2, 0.15, 0.0, -0.1])


@pytest.mark.parametrize("closed", [True, False])
def test_every_frame_is_a_curve_through_the_points_by_bounded_work(ball, closed):
    designer = nicmm.Designer(ball)
    designer.design(on_ball(ball, START), closed=closed)
    for step in range(1, 9):
        points = on_ball(ball, START + [0, 0.04 * step, 0, 0, 0])
        design = designer.follow(points, closed=closed)
        assert_valid_curve(ball, design.curves[0], points.positions(ball), closed)
        # And one iteration more where strands push each other.
        assert design.iterations <= FOLLOWING + 1
    assert to_rest(designer, points, closed=closed)[0].status is nicmm.Status.CONVERGED


def test_it_comes_to_rest_where_the_design_does(ball):
    far = on_ball(ball, START + [0, 0.15, 0, 0, 0])
    designer = nicmm.Designer(ball)
    designer.design(on_ball(ball, START))
    one = designer.follow(far, iterations=1)
    assert one.status is nicmm.Status.ITERATION_LIMIT
    followed, calls = to_rest(designer, far, iterations=1)
    assert calls > 1
    anew = nicmm.design_curve(ball, far)
    assert followed.curves[0].length == pytest.approx(anew.curves[0].length, rel=2e-3)


def test_at_rest_nothing_is_done(ball):
    designer = nicmm.Designer(ball)
    design = designer.design(on_ball(ball, START))
    assert designer.follow(on_ball(ball, START)).curves[0] is design.curves[0]


def test_design_goes_on_from_an_unfinished_curve(ball):
    designer = nicmm.Designer(ball)
    designer.design(on_ball(ball, START))
    far = on_ball(ball, START + [0, 0.15, 0, 0, 0])
    assert designer.follow(far, iterations=1).status is nicmm.Status.ITERATION_LIMIT
    assert designer.design(far).status is nicmm.Status.CONVERGED


def test_smoothness_may_change(ball):
    designer = nicmm.Designer(ball)
    before = designer.design(on_ball(ball, START)).curves[0]
    after = to_rest(designer, on_ball(ball, START), smoothness=0.1)[0].curves[0]
    assert after.length < before.length


def test_nothing_to_follow(ball):
    """No curve yet, a jump, another number of points, another way of closing, or another map."""
    designer, points = nicmm.Designer(ball), on_ball(ball, START)
    assert designer.follow(points) is None
    designer.design(points)
    assert designer.follow(on_ball(ball, START + [0, 0.3, 0, 0, 0])) is None
    assert designer.follow(points[np.arange(4)]) is None
    assert designer.follow(points, closed=False) is None
    weights = np.zeros(len(ball.vertices))
    assert designer.follow(points, alignment=weights) is None
    assert designer.follow(points) is not None


@pytest.mark.parametrize("bad", [0, -1, 2.5, None])
def test_iterations_are_checked(ball, bad):
    with pytest.raises(nicmm.ArgumentError, match="iterations is"):
        nicmm.Designer(ball).follow(on_ball(ball, START), iterations=bad)


def test_resumed_curve_stays_at_rest(ball):
    """In a new Designer, as after a file was opened again."""
    points = on_ball(ball, START)
    curve = nicmm.design_curve(ball, points).curves[0]
    designer = nicmm.Designer(ball)
    assert designer.resume(curve)
    again = to_rest(designer, points)[0].curves[0]
    assert again.length == pytest.approx(curve.length, rel=1e-3)
    assert designer.resume(curve)
    moved = on_ball(ball, START + [0, 0.02, 0, 0, 0])
    assert_valid_curve(ball, to_rest(designer, moved)[0].curves[0], moved.positions(ball))


def test_resumed_with_a_point_more_or_less(ball):
    points = on_ball(ball, START)
    curve = nicmm.design_curve(ball, points).curves[0]
    middle = int(curve.control_index[:2].mean())
    more = np.insert(curve.control_index, 1, middle)
    designer = nicmm.Designer(ball)
    for index in (more, curve.control_index[[0, 2, 3, 4]]):
        assert designer.resume(replace(curve, control_index=index))
        controls = nicmm.SurfacePoints(curve.faces[index], curve.barycentric[index])
        followed = to_rest(designer, controls)[0].curves[0]
        assert_valid_curve(ball, followed, controls.positions(ball))
        if len(index) > len(points):
            assert followed.length == pytest.approx(curve.length, rel=1e-3)


def test_resumed_beside_obstacles(ball):
    """Beside them it goes on; a curve that enters them is left, and the next design is anew."""
    points = on_ball(ball, START)
    north = (ball.vertices[:, 2] > 0.5).astype(float)
    designer = nicmm.Designer(ball)
    curve = designer.design(points, obstacles=north).curves[0]
    assert designer.resume(curve, obstacles=north)
    assert designer.follow(points, obstacles=north) is not None
    curve = designer.design(points).curves[0]
    between = circle([0.65])[0]  # the first two points
    island = (np.linalg.norm(ball.vertices - between, axis=1) < 0.3).astype(float)
    assert not designer.resume(curve, obstacles=island)
    assert designer.follow(points, obstacles=island) is None
    round_it = designer.design(points, obstacles=island).curves[0]
    assert round_it.length > 1.01 * curve.length


def test_resume_refuses_what_is_no_curve_here(ball, small_ball):
    curve = nicmm.design_curve(ball, on_ball(ball, START)).curves[0]
    designer = nicmm.Designer(small_ball)
    with pytest.raises(nicmm.CurveError, match="not on this mesh"):
        designer.resume(curve)
    lost = replace(curve, control_index=np.array([0, -1, 5]))
    with pytest.raises(nicmm.CurveError, match="control_index"):
        nicmm.Designer(ball).resume(lost)
