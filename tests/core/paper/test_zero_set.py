"""Tests zero sets that need no repair."""

import numpy as np
import pytest

from nicmm_core.geometry.surface_points import locate_control_points
from nicmm_core.paper.problem import build_problem
from nicmm_core.paper.zero_set import zero_set

ENDS = np.array([[-0.6, 0.03, 0.0], [0.6, 0.03, 0.0]])


@pytest.mark.slow
def test_zero_sets_of_the_initial_distances_are_one_curve(flat_disc):
    lane = (np.abs(flat_disc.vertices[:, 1]) < 0.05).astype(float)
    points = locate_control_points(flat_disc, ENDS, closed=False)
    problem = build_problem(flat_disc, points, closed=False, alignment=lane)
    for field in (problem.initial_distance, problem.distance):
        as_it_is, repaired = (zero_set(flat_disc, problem, field, kept) for kept in (True, False))
        assert as_it_is.is_simple_curve(flat_disc, closed=False)
        assert repaired.breaking_vertices == 0
        assert as_it_is.curves[0].length == pytest.approx(repaired.curves[0].length)
