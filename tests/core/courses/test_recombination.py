"""Tests that legs of courses are combined into better courses through the same points."""

import numpy as np
import pytest

from nicmm_core.courses.recombination import recombined
from nicmm_core.geometry.surface_points import joined
from nicmm_core.relaxation.curve_nodes import curve_surface, nodes_at
from tests.core.checks import grid, points_near

ANGLES = np.array([0.0, 1.4, 3.3, 4.7])
RADIUS = 0.35
CONTROLS = 0.5 + RADIUS * np.stack([np.cos(ANGLES), np.sin(ANGLES)], axis=1)
"""Four points on a circle in a plane; their third coordinate is zero."""

PER_LEG = 12

STRICTLY_INSIDE = 1e-7
"""Distance up to which `points_near` moves a point to the inside of a face."""


def course(mesh, bulges, closed):
    """Nodes of a course along the circle; each leg bulges outwards by a share of the radius."""
    ends = np.append(ANGLES, 2.0 * np.pi)[: len(bulges) + 1]
    share = np.arange(PER_LEG) / PER_LEG
    angle = ends[:-1, None] + share * np.diff(ends)[:, None]
    radius = RADIUS * (1.0 + np.asarray(bulges)[:, None] * np.sin(np.pi * share) ** 2)
    angle, radius = angle.ravel(), radius.ravel()
    if not closed:
        angle, radius = np.append(angle, ends[-1]), np.append(radius, RADIUS)
    flat = 0.5 + radius[:, None] * np.stack([np.cos(angle), np.sin(angle)], axis=1)
    return points_near(mesh, np.column_stack([flat, 0.0 * angle]))


def courses(closed, bulges):
    mesh = grid(40)
    surface = curve_surface(mesh)
    places = joined([course(mesh, each, closed) for each in bulges])
    nodes = nodes_at(surface, places, closed, len(bulges))
    visit = np.full(nodes.per_curve, -1)
    at = PER_LEG * np.arange(4)
    visit[at] = np.arange(4)
    return surface, nodes, np.tile(visit, len(bulges))


@pytest.mark.parametrize("closed", [True, False])
def test_the_best_legs_of_two_courses_are_combined(closed):
    """One course has a detour in its first leg, the other one in its third leg."""
    count = 4 if closed else 3
    bulges = np.zeros((2, count))
    bulges[0, 0] = bulges[1, 2] = 0.3
    surface, nodes, visit = courses(closed, bulges)
    new, new_visit = recombined(surface, nodes, visit, np.ones(nodes.curves, bool), 1.0, 4)
    before = nodes.by_curve(nodes.step_lengths).sum(axis=1)
    after = new.by_curve(new.step_lengths).sum(axis=1)
    arc = RADIUS * (2.0 * np.pi if closed else ANGLES[-1])
    assert before.min() > 1.02 * arc
    assert after[0] == pytest.approx(arc, rel=0.005)  # the first one is the cheapest
    assert new.per_curve == len(new_visit) // new.curves


@pytest.mark.parametrize("closed", [True, False])
def test_new_courses_pass_the_points_in_the_order_of_the_best_course(closed):
    generator = np.random.default_rng(0)
    surface, nodes, visit = courses(closed, generator.uniform(-0.2, 0.2, (5, 4 if closed else 3)))
    new, new_visit = recombined(surface, nodes, visit, np.ones(nodes.curves, bool), 1.0, 6)
    assert 1 <= new.curves <= 6
    for number in range(new.curves):
        own = new.by_curve(new_visit)[number]
        at = np.flatnonzero(own >= 0)
        np.testing.assert_array_equal(own[at], np.arange(4))
        positions = new.positions.reshape(new.curves, -1, 3)[number, at]
        np.testing.assert_allclose(positions[:, :2], CONTROLS, atol=STRICTLY_INSIDE)


def test_courses_that_run_beside_each_other_are_not_combined():
    """Their combinations would run beside both of them."""
    bulges = np.zeros((2, 4))
    bulges[0, 0] = bulges[1, 2] = 0.02
    surface, nodes, visit = courses(True, bulges)
    assert recombined(surface, nodes, visit, np.ones(nodes.curves, bool), 1.0, 4) is None


def test_two_points_leave_nothing_to_combine():
    mesh = grid(10)
    surface = curve_surface(mesh)
    places = points_near(mesh, np.array([[0.2, 0.2, 0.0], [0.5, 0.5, 0.0], [0.8, 0.8, 0.0]]))
    nodes = nodes_at(surface, places, closed=False)
    assert recombined(surface, nodes, np.array([0, -1, 1]), np.ones(1, bool), 1.0, 4) is None


def test_a_leg_in_the_other_direction_counts_as_the_same_leg():
    """A course and a better one in another order share two legs, in opposite directions."""
    surface, nodes, visit = courses(True, np.zeros((1, 4)))
    other_order = np.array([0, 2, 1, 3])
    mesh = surface.mesh
    ends = np.concatenate([CONTROLS[other_order], CONTROLS[:1]])
    share = (np.arange(PER_LEG) / PER_LEG)[:, None]
    legs = [start + share * (end - start) for start, end in zip(ends[:-1], ends[1:], strict=True)]
    flat = np.concatenate(legs)
    crossed = points_near(mesh, np.column_stack([flat, 0.0 * flat[:, 0]]))
    both = nodes_at(surface, joined([nodes.places, crossed]), True, 2)
    other_visit = np.full(nodes.per_curve, -1)
    other_visit[PER_LEG * np.arange(4)] = other_order
    new, new_visit = recombined(
        surface, both, np.append(visit, other_visit), np.ones(2, bool), 1.0, 8
    )
    np.testing.assert_array_equal(new_visit[new_visit >= 0].reshape(-1, 4)[0], np.arange(4))
