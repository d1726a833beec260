"""Tests of `design_curve`: closed forms, invariance, guidance, status and errors."""

import os
import subprocess
import sys
import time
import warnings
from pathlib import Path

import igl
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import nicmm_core as nicmm
from nicmm_core import progress, shapes, surface_designer
from nicmm_core.geometry.curve import resample
from nicmm_core.options import option
from nicmm_core.progress import INTERVAL
from tests.core.checks import (
    apart,
    assert_valid_curve,
    assert_valid_design,
    circle,
    joined,
    mean_edge_length,
    random_surface_points,
)
from tests.oracles.named_curves import nearest_vertices

pytestmark = pytest.mark.usefixtures("one_attempt_each")

ROOT = Path(__file__).parents[2]
CHOSEN = [3, 50, 200, 333]

SAME = 0.005
"""Greatest distance, in diagonals, of two curves that count as the same: a tenth of an edge.

Rounding is amplified over the many steps of a computation.
"""


@pytest.fixture(scope="module")
def plain(body):
    """Reference design on the body, through four vertices."""
    return nicmm.design_curve(body, CHOSEN, order="shortest")


def visited(mesh, vertices, curve):
    """Positions of the control vertices in the order in which a curve visits them."""
    offset = mesh.vertices[vertices][None] - curve.points[curve.control_index][:, None]
    order = np.linalg.norm(offset, axis=2).argmin(axis=1)
    assert sorted(order.tolist()) == list(range(len(vertices)))
    return mesh.vertices[vertices][order]


class TestClosedForms:
    @pytest.mark.slow
    def test_points_of_a_great_circle_give_a_great_circle(self, ball):
        """The points are inside faces; the curve stays within an edge length of the plane."""
        turn = Rotation.from_rotvec([0.3, 0.5, 0.2])
        points = on_unit_sphere(ball, turn.apply(circle([0.0, 1.7, 3.0, 4.6])))
        design = nicmm.design_curve(ball, points)
        assert_valid_design(ball, design, points.positions(ball))
        (curve,) = design.curves
        normal = turn.apply([0.0, 0.0, 1.0])
        assert np.abs(curve.points @ normal).max() < mean_edge_length(ball)
        assert curve.length == pytest.approx(2 * np.pi, rel=0.015)

    def test_points_of_a_circle_in_a_disc_give_the_circle(self, flat_disc):
        radius = 0.5
        controls = circle(0.1 + np.arange(5) * 2 * np.pi / 5, radius)
        design = nicmm.design_curve(flat_disc, controls)
        assert_valid_design(flat_disc, design, controls)
        (curve,) = design.curves
        distance = np.linalg.norm(curve.points, axis=1)
        assert np.abs(distance / radius - 1.0).max() < 0.06
        assert curve.length == pytest.approx(2 * np.pi * radius, rel=0.03)

    def test_the_curve_is_fairer_than_a_zigzag(self, ball):
        """The curve bends less than shortest paths along edges do."""
        chosen = nearest_vertices(ball, circle([0.4, 2.0, 4.0], 0.8) + [0.0, 0.0, 0.6])
        (curve,) = nicmm.design_curve(ball, chosen).curves
        edge = mean_edge_length(ball)
        even, _ = resample(curve.points, round(curve.length / edge))
        # Turning angles per edge length; on a path along edges of triangles they are often 60°.
        step = np.roll(even, -1, axis=0) - even
        step /= np.linalg.norm(step, axis=1, keepdims=True)
        turning = np.arccos(np.clip((step * np.roll(step, -1, axis=0)).sum(axis=1), -1, 1))
        assert np.median(turning) < np.radians(25)
        assert np.degrees(turning.max()) < 75


def on_unit_sphere(mesh, directions):
    """Points at which rays from the origin meet the faces of a sphere."""
    corners = mesh.vertices[mesh.faces].transpose(0, 2, 1)
    faces, barycentric = [], []
    for direction in directions:
        weights = np.linalg.inv(corners) @ direction
        face = weights.min(axis=1).argmax()
        faces.append(face)
        barycentric.append(np.clip(weights[face], 0, None) / np.clip(weights[face], 0, None).sum())
    return nicmm.SurfacePoints(np.array(faces), np.array(barycentric))


class TestResult:
    def test_points_in_faces_on_edges_and_at_vertices_are_interpolated(self, surface):
        """One point of each kind on every surface; some are in adjacent faces."""
        centre = surface.vertices[surface.faces].mean(axis=1)
        near = np.argsort(np.linalg.norm(centre - centre[40], axis=1))
        faces = near[[0, 12, 25, 26]]
        barycentric = np.array([[0.2, 0.3, 0.5], [0.5, 0.5, 0], [0, 0, 1], [0.9, 0.05, 0.05]])
        points = nicmm.SurfacePoints(faces, barycentric)
        design = nicmm.design_curve(surface, points, order="shortest")
        assert_valid_design(surface, design)
        (curve,) = design.curves
        expected = points.positions(surface)
        offset = expected[None] - curve.points[curve.control_index][:, None]
        order = np.linalg.norm(offset, axis=2).argmin(axis=1)
        assert_valid_curve(surface, curve, expected[order])

    @pytest.mark.slow
    def test_order_is_kept_or_chosen(self, ball):
        chosen = nearest_vertices(ball, circle([0.0, 3.0, 1.5, 4.5], 0.8) + [0.0, 0.0, 0.6])
        given = nicmm.design_curve(ball, chosen, order="given")
        assert_valid_design(ball, given, ball.vertices[chosen])
        shortest = nicmm.design_curve(ball, chosen, order="shortest")
        assert_valid_design(ball, shortest, visited(ball, chosen, shortest.curves[0]))
        assert shortest.curves[0].length < 0.9 * given.curves[0].length

    def test_field_is_in_mesh_units_and_vanishes_along_the_curve(self, body, plain):
        curve = plain.curves[0]
        along = (curve.barycentric * plain.field[body.faces[curve.faces]]).sum(axis=1)
        assert np.median(np.abs(along)) < 0.1 * mean_edge_length(body)
        assert np.abs(plain.field).max() > mean_edge_length(body)
        assert np.abs(plain.field).max() < body.diagonal

    def test_inside_of_the_field_is_the_smaller_side(self, body, plain):
        corner_mean = plain.field[body.faces].mean(axis=1)
        inside = body.face_areas[corner_mean < 0].sum()
        assert 0.0 < inside < 0.55 * body.face_areas.sum()

    def test_other_components_and_lonely_vertices_change_nothing(self, small_ball, body, plain):
        """The field there is that of the outside."""
        both = joined(small_ball, body)
        mesh = nicmm.Mesh(np.concatenate([both.vertices, [[50.0, 0.0, 0.0]]]), both.faces)
        shift = len(small_ball.vertices)
        design = nicmm.design_curve(mesh, np.array(CHOSEN) + shift, order="shortest")
        assert_valid_design(mesh, design)
        (curve,) = design.curves
        assert (curve.faces >= len(small_ball.faces)).all()
        assert apart(curve.points, plain.curves[0].points) < SAME * body.diagonal
        elsewhere = np.ones(len(mesh.vertices), dtype=bool)
        elsewhere[shift:-1] = False
        assert (design.field[elsewhere] == design.field.max()).all()

    @pytest.mark.slow
    def test_neighbouring_control_points_are_kept_apart(self, ball):
        """Two points inside one face, and two of its corners."""
        points = nicmm.SurfacePoints(
            np.full(4, 100),
            np.array([[0.6, 0.2, 0.2], [1, 0, 0], [0, 0, 1], [0.2, 0.2, 0.6]], dtype=float),
        )
        design = nicmm.design_curve(ball, points)
        assert_valid_design(ball, design, points.positions(ball))

    @pytest.mark.slow
    def test_smoothness_makes_it_fairer(self, body):
        energies = [
            nicmm.design_curve(body, CHOSEN, order="shortest", smoothness=s).energy["smooth"]
            for s in (0.03, 3.0)
        ]
        assert energies[1] < 0.8 * energies[0]

    @pytest.mark.slow
    @pytest.mark.parametrize(("smoothness", "count"), [(0.1, 4), (10.0, 4), (1.0, 20)])
    def test_field_does_not_go_flat(self, small_ball, smoothness, count):
        """A field without slope has no bending energy, and its zero set is meaningless."""
        generator = np.random.default_rng(2)
        chosen = generator.choice(len(small_ball.vertices), size=count, replace=False)
        design = nicmm.design_curve(small_ball, chosen, order="shortest", smoothness=smoothness)
        assert_valid_design(small_ball, design)
        # The term is ½ (|∇φ|² - 1)² over an area of 1, so a field without slope has 0.5.
        assert design.energy["sdf"] < 0.35

    @pytest.mark.slow
    def test_all_methods_are_available(self, small_ball):
        for method in option("method").names:
            design = nicmm.design_curve(small_ball, [3, 60, 100], method=method)
            assert_valid_design(small_ball, design, small_ball.vertices[[3, 60, 100]])


class TestInvariance:
    def test_designer_gives_what_design_curve_gives(self, body, plain):
        """This also holds after other designs on the same Designer."""
        designer = nicmm.Designer(body)
        designer.design(
            [5, 90, 310],
            order="shortest",
            obstacles=np.full(len(body.vertices), 0.9),
            progress=lambda fraction, points: False,
        )
        assert_identical(designer.design(CHOSEN, order="shortest"), plain)

    @pytest.mark.slow
    @pytest.mark.parametrize("scale", [1e-3, 1e3])
    def test_unit_and_place_do_not_matter(self, body, plain, scale):
        shift = scale * np.array([3.0, -2.0, 5.0])
        moved = nicmm.Mesh(scale * body.vertices + shift, body.faces)
        design = nicmm.design_curve(moved, CHOSEN, order="shortest")
        assert_valid_design(moved, design)
        back = (design.curves[0].points - shift) / scale
        assert apart(back, plain.curves[0].points) < SAME * body.diagonal
        np.testing.assert_allclose(
            design.field / scale, plain.field, rtol=0, atol=4 * SAME * body.diagonal
        )

    @pytest.mark.slow
    def test_pose_does_not_matter(self, body, plain):
        turn = Rotation.from_rotvec([0.4, -1.1, 0.7])
        moved = nicmm.Mesh(turn.apply(body.vertices.copy()), body.faces)
        design = nicmm.design_curve(moved, CHOSEN, order="shortest")
        assert_valid_design(moved, design)
        back = turn.inv().apply(design.curves[0].points)
        assert apart(back, plain.curves[0].points) < SAME * body.diagonal

    def test_numbering_does_not_matter(self, body, plain):
        generator = np.random.default_rng(0)
        old = generator.permutation(len(body.vertices))
        new = np.argsort(old)
        faces = new[body.faces][generator.permutation(len(body.faces))]
        faces = np.array([np.roll(face, generator.integers(3)) for face in faces])
        shuffled = nicmm.Mesh(body.vertices[old], faces)
        design = nicmm.design_curve(shuffled, new[CHOSEN], order="shortest")
        assert_valid_design(shuffled, design)
        assert apart(design.curves[0].points, plain.curves[0].points) < SAME * body.diagonal
        np.testing.assert_allclose(
            design.field, plain.field[old], rtol=0, atol=4 * SAME * body.diagonal
        )

    @pytest.mark.slow
    def test_form_of_the_control_points_does_not_matter(self, body, plain):
        design = nicmm.design_curve(body, body.vertices[CHOSEN], order="shortest")
        assert apart(design.curves[0].points, plain.curves[0].points) < SAME * body.diagonal


def assert_identical(first, second):
    np.testing.assert_array_equal(first.field, second.field)
    assert (first.status, first.iterations, first.energy) == (
        second.status,
        second.iterations,
        second.energy,
    )
    for one, other in zip(first.curves, second.curves, strict=True):
        for name in ("faces", "barycentric", "points", "control_index"):
            np.testing.assert_array_equal(getattr(one, name), getattr(other, name))


PAINTED_RADIUS = 0.3


@pytest.fixture(scope="module")
def designer(ball):
    return nicmm.Designer(ball)


@pytest.fixture(scope="module")
def parallel(ball):
    """Three vertices near a parallel."""
    angles = np.arange(3) * 2 * np.pi / 3
    return nearest_vertices(ball, circle(angles, 0.7) + [0.0, 0.0, np.sqrt(1 - 0.7**2)])


@pytest.fixture(scope="module")
def neutral(ball, designer, parallel):
    """Curve with a map on which nothing is painted."""
    return designer.design(parallel, obstacles=np.zeros(len(ball.vertices))).curves[0]


@pytest.fixture(scope="module")
def middle(ball, neutral, parallel):
    """Point of the neutral curve that is farthest from its control points."""
    offset = neutral.points[:, None] - ball.vertices[parallel]
    return neutral.points[np.linalg.norm(offset, axis=2).min(axis=1).argmax()]


class TestGuidance:
    """Tests with a region painted on the free curve or beside it."""

    def painted(self, mesh, centre):
        return (np.linalg.norm(mesh.vertices - centre, axis=1) < PAINTED_RADIUS).astype(float)

    def length_inside(self, mesh, curve, weights):
        """Length of the curve, weighted by the map."""
        value = (curve.barycentric * weights[mesh.faces[curve.faces]]).sum(axis=1)
        return np.linalg.norm(curve.steps, axis=1) @ (0.5 * (value + np.roll(value, -1)))

    def test_obstacle_pushes_the_curve_away(self, ball, designer, parallel, neutral, middle):
        weights = self.painted(ball, middle)
        design = designer.design(parallel, obstacles=weights)
        assert_valid_design(ball, design, ball.vertices[parallel])
        before = self.length_inside(ball, neutral, weights)
        assert before > PAINTED_RADIUS
        assert self.length_inside(ball, design.curves[0], weights) < 0.7 * before

    @pytest.mark.slow
    def test_alignment_attracts_the_curve(self, ball, designer, parallel, neutral, middle):
        centre = middle - [0.0, 0.0, 0.35]
        weights = self.painted(ball, centre / np.linalg.norm(centre))
        design = designer.design(parallel, alignment=weights)
        assert_valid_design(ball, design, ball.vertices[parallel])
        before = self.length_inside(ball, neutral, weights)
        assert before > 0.0
        assert self.length_inside(ball, design.curves[0], weights) > 1.2 * before

    def test_both_maps_together(self, ball, designer, parallel, neutral, middle):
        obstacles, alignment = self.painted(ball, middle), self.painted(ball, -middle)
        design = designer.design(parallel, obstacles=obstacles, alignment=alignment)
        assert_valid_design(ball, design, ball.vertices[parallel])
        assert design.energy["fea"] > 0.0
        before = self.length_inside(ball, neutral, obstacles)
        assert self.length_inside(ball, design.curves[0], obstacles) < 0.7 * before

    def test_without_maps_there_is_no_feature_energy(self, plain):
        assert plain.energy["fea"] == 0.0


class TestProgress:
    def test_progress_sees_fractions_and_points_and_changes_nothing(self, body, plain):
        calls = []
        began = time.perf_counter()
        design = nicmm.design_curve(
            body, CHOSEN, order="shortest", progress=lambda *call: calls.append(call)
        )
        seconds = time.perf_counter() - began
        assert calls
        fractions = [fraction for fraction, _ in calls]
        assert all(0.0 <= fraction <= 1.0 for fraction in fractions)
        assert fractions == sorted(fractions)
        for _, points in calls:
            assert points.ndim == 2 and points.shape[1] == 3
            assert np.isfinite(points).all()
        assert len(calls[-1][1]) > 3
        # At most a few calls per second, and one for the first curve.
        assert len(calls) <= 2 + seconds / INTERVAL
        # Only False stops a design; `append` returns None.
        assert_identical(design, plain)

    def test_false_cancels_and_the_curve_so_far_is_valid(self, body, monkeypatch):
        monkeypatch.setattr(progress, "INTERVAL", 0.0)
        calls = []

        def stop(fraction, points):
            calls.append(fraction)
            return fraction <= surface_designer.START_FRACTION

        design = nicmm.design_curve(body, CHOSEN, order="shortest", progress=stop)
        assert sum(fraction > surface_designer.START_FRACTION for fraction in calls) == 1
        assert design.status is nicmm.Status.CANCELLED
        assert 0 < design.iterations < 200
        (curve,) = design.curves
        assert_valid_curve(body, curve, visited(body, CHOSEN, curve))

    def test_errors_of_the_progress_function_reach_the_caller(self, small_ball, monkeypatch):
        monkeypatch.setattr(progress, "INTERVAL", 0.0)

        class OwnError(Exception):
            pass

        def fail(fraction, points):
            raise OwnError

        with pytest.raises(OwnError):
            nicmm.design_curve(small_ball, [3, 60, 100], progress=fail)

    def test_every_status_says_something_else(self):
        texts = [str(status) for status in nicmm.Status]
        assert len(set(texts)) == len(texts)
        assert all(len(text) > 20 for text in texts)


N = 162
BAD_CALLS = {
    "too few points": ({"control_points": [3, 60]}, nicmm.ControlPointError, "^control_points"),
    "repeated point": (
        {"control_points": [3, 60, 3]},
        nicmm.ControlPointError,
        r"^control_points\[0\]",
    ),
    "vertex out of range": (
        {"control_points": [3, 60, N]},
        nicmm.ControlPointError,
        r"^control_points\[2\]",
    ),
    "off the surface": (
        {"control_points": [[1, 0, 0], [0, 1, 0], [0, 0, 2]]},
        nicmm.ControlPointError,
        r"^control_points\[2\] is off",
    ),
    "method": ({"method": "magic"}, nicmm.ArgumentError, "^method is 'magic'"),
    "method a list": ({"method": ["elastic"]}, nicmm.ArgumentError, "^method"),
    "order": ({"order": "longest"}, nicmm.ArgumentError, "^order is 'longest'"),
    "order none": ({"order": None}, nicmm.ArgumentError, "^order"),
    "smoothness zero": ({"smoothness": 0.0}, nicmm.ArgumentError, "^smoothness"),
    "smoothness negative": ({"smoothness": -1.0}, nicmm.ArgumentError, "^smoothness"),
    "smoothness NaN": ({"smoothness": float("nan")}, nicmm.ArgumentError, "^smoothness"),
    "smoothness infinite": ({"smoothness": float("inf")}, nicmm.ArgumentError, "^smoothness"),
    "smoothness beyond numbers": ({"smoothness": 1e300}, nicmm.ArgumentError, "^smoothness"),
    "smoothness text": ({"smoothness": "much"}, nicmm.ArgumentError, "^smoothness"),
    "smoothness array": ({"smoothness": np.ones(2)}, nicmm.ArgumentError, "^smoothness"),
    "obstacles too short": ({"obstacles": np.zeros(N - 1)}, nicmm.ArgumentError, "^obstacles"),
    "obstacles in columns": ({"obstacles": np.zeros((N, 1))}, nicmm.ArgumentError, "^obstacles"),
    "obstacles negative": (
        {"obstacles": np.linspace(-0.1, 1, N)},
        nicmm.ArgumentError,
        r"^obstacles\[0\]",
    ),
    "obstacles above one": (
        {"obstacles": np.linspace(0, 1.1, N)},
        nicmm.ArgumentError,
        r"^obstacles\[\d+\]",
    ),
    "obstacles text": ({"obstacles": ["a"] * N}, nicmm.ArgumentError, "^obstacles"),
    "obstacles complex": ({"obstacles": np.zeros(N) * 1j}, nicmm.ArgumentError, "^obstacles"),
    "alignment NaN": ({"alignment": np.full(N, np.nan)}, nicmm.ArgumentError, r"^alignment\[0\]"),
    "alignment ragged": ({"alignment": [[0.0], [0, 1]]}, nicmm.ArgumentError, "^alignment"),
    "alignment a number": ({"alignment": 0.5}, nicmm.ArgumentError, "^alignment"),
    "progress no function": ({"progress": 5}, nicmm.ArgumentError, "^progress"),
}


class TestErrors:
    @pytest.mark.parametrize(("change", "error", "message"), BAD_CALLS.values(), ids=BAD_CALLS)
    def test_bad_arguments_are_refused_by_name(self, small_ball, change, error, message):
        arguments = {"control_points": [3, 60, 100], **change}
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            with pytest.raises(error, match=message):
                nicmm.design_curve(small_ball, **arguments)

    def test_designer_refuses_the_same(self, small_ball):
        with pytest.raises(nicmm.ArgumentError, match="^method"):
            nicmm.Designer(small_ball).design([3, 60, 100], method="magic")

    def test_mesh_must_be_a_mesh(self, small_ball):
        for wrong in (None, (small_ball.vertices, small_ball.faces)):
            with pytest.raises(nicmm.ArgumentError, match="^mesh"):
                nicmm.design_curve(wrong, [3, 60, 100])

    def test_every_error_is_of_one_family(self):
        for name in ("MeshError", "ControlPointError", "UnreachableError", "ArgumentError"):
            assert issubclass(getattr(nicmm, name), nicmm.NicmmError)

    def test_points_on_two_components_are_unreachable(self, small_ball):
        mesh = joined(small_ball, small_ball)
        with pytest.raises(nicmm.UnreachableError, match=r"^control_points\[0\]"):
            nicmm.design_curve(mesh, [3, 60, N + 5])

    @pytest.mark.slow
    def test_a_loop_that_would_have_to_cross_itself_is_unreachable(self, flat_disc):
        rim = nearest_vertices(flat_disc, circle(np.pi / 2 * np.array([0, 2, 1, 3])))
        with pytest.raises(nicmm.UnreachableError, match="^control_points"):
            nicmm.design_curve(flat_disc, rim)

    @pytest.mark.slow
    def test_arguments_are_not_changed(self, small_ball):
        vertices, faces = small_ball.vertices.copy(), small_ball.faces.copy()
        points = random_surface_points(small_ball, 3, seed=1)
        given = points.faces.copy(), points.barycentric.copy()
        maps = np.linspace(0, 1, N), np.linspace(1, 0, N)
        nicmm.design_curve(small_ball, points, obstacles=maps[0], alignment=maps[1])
        np.testing.assert_array_equal(small_ball.vertices, vertices)
        np.testing.assert_array_equal(small_ball.faces, faces)
        np.testing.assert_array_equal(points.faces, given[0])
        np.testing.assert_array_equal(points.barycentric, given[1])
        np.testing.assert_array_equal(maps[0], np.linspace(0, 1, N))
        np.testing.assert_array_equal(maps[1], np.linspace(1, 0, N))

    def test_nothing_is_printed_and_nobody_is_warned(self, small_ball, capfd):
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            nicmm.design_curve(small_ball, [3, 60, 100], obstacles=np.zeros(N))
            with pytest.raises(nicmm.ControlPointError):
                nicmm.design_curve(small_ball, [3])
        assert capfd.readouterr() == ("", "")


def moebius_strip():
    around, across = 30, 4
    turn = np.repeat(np.arange(around) * 2 * np.pi / around, across)
    width = np.tile(np.linspace(-0.3, 0.3, across), around)
    radius = 1 + width * np.cos(turn / 2)
    vertices = np.stack(
        [radius * np.cos(turn), radius * np.sin(turn), width * np.sin(turn / 2)], axis=1
    )
    index = np.arange(around * across).reshape(around, across)
    following = np.concatenate([index[1:], index[:1, ::-1]])
    quads = (index[:, :-1], following[:, :-1], index[:, 1:], following[:, 1:])
    a, b, c, d = (part.ravel() for part in quads)
    return vertices, np.concatenate([np.stack([a, b, c], 1), np.stack([c, b, d], 1)])


def broken_meshes():
    """Arrays that are formally valid meshes, and control points."""
    ball = shapes.sphere(2)
    tetrahedron = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]])
    sides = np.array([[0, 2, 1], [0, 1, 3], [1, 2, 3], [0, 3, 2]])
    flat_face, merged, nearly = (ball.vertices.copy() for _ in range(3))
    a, b, c = ball.faces[5]
    flat_face[b] = flat_face[a]
    merged[50] = merged[49]
    nearly[c] = 0.5 * (nearly[a] + nearly[b]) + 1e-13 * nearly[c]
    flipped = ball.faces.copy()
    flipped[::3] = flipped[::3, ::-1]
    doubled = np.concatenate([ball.faces, ball.faces[:1]])
    fan = np.array([[0.0, 0, 0], [0, 0, 1], [1, 0, 0.5], [-1, 0, 0.5], [0, 1, 0.5]])
    bow = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [-1, 0, 0], [0, -1, 0]])
    line = np.arange(4.0)[:, None] * [[1.0, 0.0, 0.0]]
    chosen = [3, 60, 100]
    return {
        "one triangle": (tetrahedron[:3], [[0, 1, 2]], [0, 1, 2]),
        "tetrahedron": (tetrahedron, sides, [0, 1, 2, 3]),
        "face without area": (flat_face, ball.faces, chosen),
        "face without area at a control point": (flat_face, ball.faces, [int(a), 60, 100]),
        "two vertices at one place": (merged, ball.faces, chosen),
        "needle": (nearly, ball.faces, chosen),
        "flipped faces": (ball.vertices, flipped, chosen),
        "doubled face": (ball.vertices, doubled, chosen),
        "doubled triangle": (tetrahedron[:3], [[0, 1, 2], [0, 2, 1]], [0, 1, 2]),
        "edge of three faces": (fan, [[0, 1, 2], [0, 1, 3], [0, 1, 4]], [2, 3, 4]),
        "faces that meet in a vertex": (bow, [[0, 1, 2], [0, 3, 4]], [1, 2, 3]),
        "all on a line": (line, [[0, 1, 2], [1, 2, 3]], [0, 1, 2]),
        "all at one place": (np.zeros((4, 3)), [[0, 1, 2], [1, 2, 3]], [0, 1, 2]),
        "one-sided": (*moebius_strip(), [1, 41, 81]),
        "one-sided, points nearby": (*moebius_strip(), [1, 9, 18]),
    }


IMPOSSIBLE = ("faces that meet in a vertex", "all at one place")
"""Broken meshes on which no simple closed curve passes the points."""


@pytest.mark.slow
@pytest.mark.parametrize("name", broken_meshes())
def test_broken_meshes_give_a_valid_curve_or_a_typed_error(name):
    vertices, faces, chosen = broken_meshes()[name]
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        try:
            mesh = nicmm.Mesh(vertices, faces)
            design = nicmm.design_curve(mesh, chosen)
        except nicmm.NicmmError as error:
            assert len(str(error)) > 20
            assert name in IMPOSSIBLE
            return
    assert name not in IMPOSSIBLE
    assert np.isfinite(design.field).all()
    (curve,) = design.curves
    assert_valid_curve(mesh, curve, mesh.vertices[chosen])


@pytest.mark.parametrize(("shift", "scale"), [(1e6, 1.0), (0.0, 1e-9), (0.0, 1e9)])
def test_neither_size_nor_place_is_a_defect(small_ball, shift, scale):
    chosen = [3, 60, 100]
    mesh = nicmm.Mesh(scale * small_ball.vertices + shift, small_ball.faces)
    assert_valid_design(mesh, nicmm.design_curve(mesh, chosen), mesh.vertices[chosen])


def python(program):
    """Run a program in a new interpreter that can import this package."""
    path = os.pathsep.join([str(ROOT), os.environ.get("PYTHONPATH", "")])
    return subprocess.run(
        [sys.executable, "-c", program],
        env={**os.environ, "PYTHONPATH": path},
        capture_output=True,
        text=True,
        check=False,
    )


WITHOUT_TORCH = """
import sys
sys.modules["torch"] = None  # makes its import fail
import nicmm_core as nicmm
from nicmm_core import shapes
mesh = shapes.sphere(2)
maps = {"obstacles": [0.0] * 100 + [0.5] * 62}
for method in METHODS:
    for given in ({}, maps):
        design = nicmm.design_curve(mesh, [3, 60, 100], method=method, **given)
        usable = (nicmm.Status.CONVERGED, nicmm.Status.ITERATION_LIMIT)
        assert len(design.curves) == 1 and design.status in usable, (method, design.status)
"""


@pytest.mark.slow
def test_no_method_needs_torch():
    result = python(WITHOUT_TORCH.replace("METHODS", repr(option("method").names)))
    assert result.returncode == 0, result.stderr + result.stdout
    assert (result.stdout, result.stderr) == ("", "")


@pytest.mark.slow
def test_a_changed_map_gives_the_curve_that_a_new_designer_finds(ball, parallel):
    """A Designer keeps no curve, so earlier designs with other maps have no effect."""
    designer = nicmm.Designer(ball)
    for height in (0.3, 0.5, None):
        lane = None
        if height is not None:
            lane = (np.abs(ball.vertices[:, 2] - height) < 0.06).astype(float)
        again = designer.design(parallel, alignment=lane).curves[0]
        anew = nicmm.design_curve(ball, parallel, alignment=lane).curves[0]
        np.testing.assert_array_equal(again.points, anew.points)


@pytest.mark.parametrize(
    ("method", "finer", "most"),
    [
        ("elastic", 0, 0.03),
        ("elastic", 1, 0.03),
        pytest.param("variational", 0, 0.06, marks=pytest.mark.slow),
    ],
)
def test_a_lane_beside_a_straight_way_is_followed(flat_disc, method, finer, most):
    """The curve follows the middle of the lane, on the disc and on one that is twice as fine."""
    mesh = nicmm.Mesh(*igl.upsample(flat_disc.vertices, flat_disc.faces, finer))
    x, y, _ = mesh.vertices.T
    lane = ((np.abs(y - 0.12) < 0.09) & (np.abs(x) < 0.45)).astype(float)
    ends = nearest_vertices(mesh, np.array([[-0.8, 0.0, 0.0], [0.8, 0.0, 0.0]]))
    design = nicmm.design_curve(mesh, ends, closed=False, method=method, alignment=lane)
    assert_valid_design(mesh, design, mesh.vertices[ends], closed=False)
    points = design.curves[0].points
    middle = np.abs(points[:, 0]) < 0.3
    assert np.abs(points[middle, 1] - 0.12).mean() < most
