"""Tests sign bundles: open curves, loops that bound no region, and one-sided surfaces."""

import numpy as np
import pytest

import nicmm_core as nicmm
from nicmm_core import shapes
from nicmm_core.geometry.surface_points import locate_control_points
from nicmm_core.paper.finite_elements import build_finite_elements
from nicmm_core.paper.problem import build_problem
from nicmm_core.paper.sign_bundle import SignBundle
from tests.core.checks import assert_valid_curve, assert_valid_design, circle
from tests.oracles.checker import judge
from tests.oracles.named_curves import handle_points, nearest_vertices, torus_points

METHODS = ("variational", "nicmm")


def design(mesh, points, **settings):
    return nicmm.design_curve(mesh, points, **{"method": "variational", **settings})


def assert_one_curve(mesh, result, points, closed=True):
    assert_valid_design(mesh, result, closed=closed)
    positions = mesh.vertices[points]
    assert_valid_curve(mesh, result.curves[0], positions, closed=closed)


@pytest.mark.slow
class TestLoopsThatBoundNothing:
    @pytest.mark.parametrize("method", METHODS)
    def test_meridian_of_a_torus(self, ring, method):
        """The meridian is a geodesic, a circle in a plane."""
        points = torus_points(ring, 0, 1, 3)
        result = design(ring, points, method=method)
        assert_one_curve(ring, result, points)
        curve = result.curves[0]
        assert np.abs(curve.points[:, 1]).max() < 0.02
        assert curve.length == pytest.approx(2 * np.pi * 0.4, rel=0.02)

    def test_parallel_of_a_torus(self, ring):
        """The outer parallel is a geodesic as well."""
        points = torus_points(ring, 1, 0, 6)
        result = design(ring, points)
        assert_one_curve(ring, result, points)
        assert np.abs(result.curves[0].points[:, 2]).max() < 0.03

    def test_loop_that_winds_both_ways(self, ring):
        points = torus_points(ring, 1, 1, 6)
        result = design(ring, points)
        assert_one_curve(ring, result, points)
        curve = result.curves[0].points
        around = np.unwrap(np.arctan2(curve[:, 1], curve[:, 0]))
        across = np.unwrap(np.arctan2(curve[:, 2], np.hypot(curve[:, 0], curve[:, 1]) - 1.0))
        for angle in (around, across):
            assert abs(angle[-1] - angle[0]) > 1.8 * np.pi

    @pytest.mark.parametrize("half", [-1.0, 1.0])
    def test_round_each_handle_of_a_double_torus(self, half):
        """A loop through the hole and back on the outside, for each handle."""
        mesh = shapes.double_torus()
        points = handle_points(mesh, half)
        result = design(mesh, points, order="shortest")
        assert_valid_design(mesh, result)
        assert not judge(mesh, result, points, True, "shortest").faults

    def test_round_a_boundary(self):
        """A loop around the hole of an annulus bounds a region only together with the rim."""
        annulus = shapes.annulus()
        points = nearest_vertices(annulus, circle([0.0, 1.5, 3.0, 4.5], radius=0.6))
        assert_one_curve(annulus, design(annulus, points), points)

    def test_core_of_a_moebius_strip(self):
        """After one turn left and right are exchanged; the core is a geodesic."""
        strip = shapes.moebius_strip()
        middle = circle([0.0, 2.0, 4.0])
        points = nearest_vertices(strip, middle)
        result = design(strip, points)
        assert_one_curve(strip, result, points)
        assert result.curves[0].length == pytest.approx(2 * np.pi, rel=0.03)


@pytest.mark.slow
class TestOpenCurves:
    @pytest.mark.parametrize("method", METHODS)
    def test_arc_of_a_great_circle(self, ball, method):
        points = nearest_vertices(ball, circle([0.0, 1.6, 3.0]))
        result = design(ball, points, closed=False, method=method)
        assert_one_curve(ball, result, points, closed=False)

    def test_points_of_a_great_circle_give_its_arc(self):
        mesh = shapes.sphere(4)
        points = nearest_vertices(mesh, circle([0.0, np.pi / 2, np.pi]))
        curve = design(mesh, points, closed=False).curves[0]
        assert np.abs(curve.points[:, 2]).max() < 0.01
        assert curve.length == pytest.approx(np.pi, rel=0.01)

    def test_two_points_are_enough(self, flat_disc):
        """The curve is nearly the straight line between them."""
        points = nearest_vertices(flat_disc, [[-0.6, 0.1, 0.0], [0.5, -0.2, 0.0]])
        result = design(flat_disc, points, closed=False)
        assert_one_curve(flat_disc, result, points, closed=False)
        ends = flat_disc.vertices[points]
        straight = np.linalg.norm(ends[1] - ends[0])
        assert result.curves[0].length == pytest.approx(straight, rel=0.08)

    def test_starts_at_the_first_point_and_ends_at_the_last(self, surface):
        points = np.random.default_rng(8).choice(len(surface.vertices), 3, replace=False)
        result = design(surface, points, closed=False)
        assert_one_curve(surface, result, points, closed=False)
        index = result.curves[0].control_index
        assert index[0] == 0 and index[-1] == len(result.curves[0].points) - 1

    def test_shortest_order_may_start_anywhere(self, ball):
        points = nearest_vertices(ball, circle([1.0, 0.0, 2.0, 0.5]))
        curve = design(ball, points, closed=False, order="shortest").curves[0]
        visited = curve.points[curve.control_index]
        angles = np.arctan2(visited[:, 1], visited[:, 0])
        assert (np.diff(angles) > 0).all() or (np.diff(angles) < 0).all()

    def test_field_is_a_distance_without_sign(self, ball):
        points = nearest_vertices(ball, circle([0.0, 1.6, 3.0]))
        result = design(ball, points, closed=False)
        assert (result.field >= 0.0).all()
        np.testing.assert_allclose(result.field[points], 0.0, atol=1e-12)


class TestOperators:
    def test_a_change_of_signs_at_vertices_changes_nothing(self, small_ball):
        """One sign per vertex, the same at all of its corners, gives the ordinary operators."""
        generator = np.random.default_rng(5)
        sign = generator.choice([-1, 1], size=len(small_ball.vertices))
        bundle = SignBundle(sign[small_ball.faces], sign, np.zeros(0, dtype=np.int64))
        boundary = np.zeros(len(sign), dtype=bool)
        surface = (small_ball.vertices, small_ball.faces, boundary)
        plain, turned = build_finite_elements(*surface), build_finite_elements(*surface, bundle)
        phi = generator.normal(size=len(sign))
        for name in ("gradient", "centroid"):
            np.testing.assert_allclose(
                getattr(turned, name) @ (sign * phi), getattr(plain, name) @ phi, atol=1e-9
            )
        fields = generator.normal(size=3 * len(small_ball.faces))
        np.testing.assert_allclose(
            turned.divergence @ fields, sign * (plain.divergence @ fields), atol=1e-9
        )

    @pytest.mark.slow
    def test_distance_to_the_path_is_smooth_across_it(self, ring):
        """|∇φ₀| is 1 on both sides of a meridian, across which φ₀ changes its sign."""
        points = locate_control_points(ring, torus_points(ring, 0, 1, 3), closed=True)
        problem = build_problem(ring, points)
        assert problem.bundle is not None
        slope = np.linalg.norm(
            (problem.elements.gradient @ problem.distance).reshape(3, -1), axis=0
        )
        touching = np.isin(problem.working.faces, problem.loop.vertices).any(axis=1)
        # The heat method smooths the distance over about an edge length.
        assert np.median(slope[touching]) == pytest.approx(1.0, abs=0.2)

    def test_a_loop_that_bounds_needs_no_bundle(self, ball):
        points = locate_control_points(ball, [3, 200, 400], closed=True)
        assert build_problem(ball, points).bundle is None
