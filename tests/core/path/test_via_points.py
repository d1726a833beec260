"""Tests that via points determine the course of the curve, and that invalid ones are refused."""

import numpy as np
import pytest

import nicmm_core as nicmm
from nicmm_core import shapes
from nicmm_core.commands import main
from nicmm_core.geometry.surface_points import locate_control_points
from nicmm_core.io.files import read_mesh, write_mesh
from nicmm_core.path import legs
from tests.core.checks import assert_valid_design, circle, initial_loop, joined
from tests.oracles.named_curves import nearest_vertices

pytestmark = pytest.mark.usefixtures("one_attempt_each")


def design(mesh, points, **settings):
    return nicmm.design_curve(mesh, points, **{"method": "variational", **settings})


def windings(curve):
    """Winding numbers of a curve on a torus, around the axis and around the tube."""
    points = np.concatenate([curve.points, curve.points[:1]])
    around = np.unwrap(np.arctan2(points[:, 1], points[:, 0]))
    across = np.unwrap(np.arctan2(points[:, 2], np.hypot(points[:, 0], points[:, 1]) - 1.0))
    return tuple(int(np.rint((a[-1] - a[0]) / (2 * np.pi))) for a in (around, across))


class TestWhichWay:
    @pytest.mark.slow
    def test_open_curve_goes_round_the_other_side_of_a_sphere(self, ball):
        """Only the initial path decides between the two arcs of a great circle."""
        points = nearest_vertices(ball, circle([0.0, 2.0]))
        far = nearest_vertices(ball, circle([4.1]))
        near_side = design(ball, points, closed=False)
        far_side = design(ball, points, closed=False, via_points={0: far})
        for result, angle in ((near_side, 2.0), (far_side, 2.0 - 2 * np.pi)):
            assert_valid_design(ball, result, ball.vertices[points], closed=False)
            along = result.curves[0].points
            turned = np.unwrap(np.arctan2(along[:, 1], along[:, 0]))
            assert turned[-1] - turned[0] == pytest.approx(angle, abs=0.1)
            # Open curves are free near their ends and slightly longer than necessary.
            assert abs(angle) * 0.98 < result.curves[0].length < abs(angle) * 1.2

    @pytest.mark.slow
    def test_loop_goes_through_the_hole_of_a_torus_or_not(self, ring):
        points = nearest_vertices(ring, circle([-0.4, 0.0, 0.4], radius=1.4))
        inside = nearest_vertices(ring, circle([2.0, 3.5, 5.0], radius=1.4))
        beside = design(ring, points)
        round_it = design(ring, points, via_points={2: inside})
        assert_valid_design(ring, beside, ring.vertices[points])
        assert_valid_design(ring, round_it, ring.vertices[points])
        assert windings(beside.curves[0]) == (0, 0)
        assert tuple(map(abs, windings(round_it.curves[0]))) == (1, 0)

    @pytest.mark.slow
    def test_curve_does_not_interpolate_them(self, ball):
        points = nearest_vertices(ball, circle([0.0, 2.0]))
        via = nearest_vertices(ball, [[-0.3, -0.8, 0.5]])
        curve = design(ball, points, closed=False, via_points={0: via}).curves[0]
        assert len(curve.control_index) == 2
        assert np.linalg.norm(curve.points - ball.vertices[via], axis=1).min() > 0.1

    @pytest.mark.parametrize("closed", [True, False])
    def test_path_passes_them_in_order_between_their_control_points(self, ball, closed):
        chosen = np.random.default_rng(3).choice(len(ball.vertices), 8, replace=False)
        points = locate_control_points(ball, chosen[:4], closed)
        via = {0: chosen[4:6], 2: ball.vertices[chosen[6:]]}
        working, loop = initial_loop(ball, points, "given", None, closed, via)
        place = {int(working.input_vertex[v]): i for i, v in enumerate(loop.vertices)}
        expected = chosen[[0, 4, 5, 1, 2, 6, 7, 3]]
        assert (np.diff([place[int(vertex)] for vertex in expected]) > 0).all()
        np.testing.assert_array_equal(working.input_vertex[loop.control_vertices], chosen[:4])

    @pytest.mark.slow
    def test_no_via_points_change_nothing(self, small_ball):
        points = locate_control_points(small_ball, [3, 60, 100], closed=True)
        plain = initial_loop(small_ball, points, "given")[1]
        for nothing in ({}, {1: []}):
            loop = initial_loop(small_ball, points, "given", via_points=nothing)[1]
            np.testing.assert_array_equal(loop.vertices, plain.vertices)

    @pytest.mark.slow
    @pytest.mark.parametrize("closed", [True, False])
    def test_on_the_boundary_they_steer_and_the_curve_keeps_off_it(self, closed):
        """The via point is on the other side of the leg between its two control points."""
        disc = shapes.disc(30)
        rim = nearest_vertices(disc, circle(np.pi / 3 * np.arange(6)))
        found = design(disc, rim[[0, 2, 4]], closed=closed, via_points={0: rim[[3]]})
        assert_valid_design(disc, found, disc.vertices[rim[[0, 2, 4]]], closed)
        plain = design(disc, rim[[0, 2, 4]], closed=closed)

        def leg_to_via_point(curve):
            start, end = curve.control_index[:2]
            away = curve.points[start : end + 1] - disc.vertices[rim[3]]
            return np.linalg.norm(away, axis=1).min()

        assert leg_to_via_point(found.curves[0]) < 0.5 < leg_to_via_point(plain.curves[0])

    @pytest.mark.slow
    def test_impossible_ones_are_named_and_left_out_in_the_advice(self, ball, monkeypatch):
        """Through many points back and forth the path needs more splits than allowed."""
        monkeypatch.setattr(legs, "MOST_PATH_SPLITS", 40)
        chosen = np.random.default_rng(0).choice(len(ball.vertices), 40, replace=False)
        points = locate_control_points(ball, chosen[:3], closed=True)
        with pytest.raises(nicmm.UnreachableError, match=r"leave the via points out.*\[0, 1, 2\]"):
            initial_loop(ball, points, "given", via_points={0: chosen[3:]})


BAD = {
    "no mapping": ([57], nicmm.ArgumentError, "via_points is a list"),
    "an array": (np.array([57.0, 3.0]), nicmm.ArgumentError, "via_points is a ndarray"),
    "no such control point": ({3: [57]}, nicmm.ArgumentError, r"via_points\[3\].*0 … 2"),
    "negative": ({-1: [57]}, nicmm.ArgumentError, r"via_points\[-1\]"),
    "key is text": ({"1": [57]}, nicmm.ArgumentError, r"via_points\['1'\]"),
    "key is a truth value": ({True: [57]}, nicmm.ArgumentError, r"via_points\[True\]"),
    "vertex out of range": ({1: [57, 999]}, nicmm.ControlPointError, r"via_points\[1\]\[1\] = 999"),
    "a number": ({1: 57}, nicmm.ControlPointError, r"via_points\[1\] has shape \(\)"),
    "off the surface": (
        {1: [[3.0, 0, 0]]},
        nicmm.ControlPointError,
        r"via_points\[1\]\[0\] is off",
    ),
    "a control point": (
        {1: [57, 3]},
        nicmm.ControlPointError,
        r"control_points\[0\] and via_points\[1\]\[1\] are the same",
    ),
    "twice": ({0: [57], 1: [57]}, nicmm.ControlPointError, r"via_points\[0\]\[0\] and via_points"),
}


class TestErrors:
    @pytest.mark.parametrize(("via", "error", "message"), BAD.values(), ids=BAD.keys())
    def test_bad_ones_are_refused(self, small_ball, via, error, message):
        with pytest.raises(error, match=message):
            design(small_ball, [3, 60, 100], via_points=via)

    def test_last_point_of_an_open_curve_has_no_leg(self, small_ball):
        with pytest.raises(nicmm.ArgumentError, match=r"via_points\[2\].*0 … 1"):
            design(small_ball, [3, 60, 100], closed=False, via_points={2: [57]})

    def test_shortest_order_is_refused(self, small_ball):
        with pytest.raises(nicmm.ArgumentError, match="via_points needs order"):
            design(small_ball, [3, 60, 100], order="shortest", via_points={1: [57]})

    def test_other_component_is_refused(self, small_ball):
        mesh = joined(small_ball, nicmm.Mesh(small_ball.vertices + 3.0, small_ball.faces))
        with pytest.raises(nicmm.UnreachableError, match=r"via_points\[1\]\[0\] lie on different"):
            design(mesh, [3, 60, 100], via_points={1: [200]})


class TestCommandLine:
    @pytest.fixture
    def mesh_file(self, small_ball, tmp_path):
        path = tmp_path / "ball.off"
        write_mesh(path, small_ball)
        return path

    @pytest.mark.slow
    def test_option_reaches_the_design(self, mesh_file, tmp_path):
        output = tmp_path / "curve.csv"
        arguments = ["design", str(mesh_file), "--points", "3,60,100", "-o", str(output)]
        arguments += ["--method", "variational"]
        assert main([*arguments, "--via", "1:57,80", "--via", "2:20"]) == 0
        written = np.loadtxt(output, delimiter=",", skiprows=1)[:, 4:]
        (expected,) = design(
            read_mesh(mesh_file), [3, 60, 100], via_points={1: [57, 80], 2: [20]}
        ).curves
        np.testing.assert_allclose(written, expected.points, rtol=0, atol=1e-6)

    @pytest.mark.parametrize("via", ["57", "1:", "one:57", "1:57;80"])
    def test_unreadable_option_ends_with_2(self, mesh_file, tmp_path, capsys, via):
        arguments = ["design", str(mesh_file), "--points", "3,60,100", "--via", via]
        assert main([*arguments, "-o", str(tmp_path / "curve.csv")]) == 2
        assert "--via" in capsys.readouterr().err

    def test_leg_named_twice_ends_with_2(self, mesh_file, tmp_path, capsys):
        arguments = ["design", str(mesh_file), "--points", "3,60,100"]
        arguments += ["--via", "1:57", "--via", "1:80", "-o", str(tmp_path / "curve.csv")]
        assert main(arguments) == 2
        assert "twice" in capsys.readouterr().err
