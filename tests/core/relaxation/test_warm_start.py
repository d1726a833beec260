"""Tests that a curve moves to nearby control points with the nodes that it has."""

import numpy as np
import pytest

import nicmm_core as nicmm
from nicmm_core.geometry.normals import unsigned_normals
from nicmm_core.geometry.surface_points import locate_control_points
from nicmm_core.relaxation.curve_nodes import CurveSurface
from nicmm_core.relaxation.discrete_curve import without_short_segments
from nicmm_core.relaxation.relaxing import RelaxationConfig, relax
from nicmm_core.relaxation.warm_start import WARM, with_moved_controls
from tests.core.checks import apart

CHOSEN = [12, 80, 41, 150]


@pytest.mark.slow
def test_a_dragged_curve_keeps_its_nodes(ball):
    """The start is the returned curve, with the same number of nodes."""
    surface = CurveSurface(ball, unsigned_normals(ball))
    start = nicmm.design_curve(ball, CHOSEN, order="shortest").curves[0]
    first = relax(surface, start, 1.0, RelaxationConfig())
    result = without_short_segments(ball, first.discrete_curve)
    np.testing.assert_array_equal(result.points, first.curve.points)
    places = locate_control_points(ball, first.curve.points[first.curve.control_index], True)
    moved = with_moved_controls(surface, first.discrete_curve, places)
    again = relax(surface, moved, 1.0, WARM)
    assert len(again.discrete_curve.nodes.positions) == len(first.discrete_curve.nodes.positions)
    assert again.iterations <= 2
    assert apart(again.curve.points, first.curve.points) < 1e-2
