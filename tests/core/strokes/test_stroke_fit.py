"""Tests control points that are fitted to strokes."""

import numpy as np
import pytest
from scipy.spatial import cKDTree

import nicmm_core as nicmm
from nicmm_core import improvement, progress, shapes, start_search
from nicmm_core.geometry.curve import resample
from nicmm_core.geometry.surface_points import nearest_points
from tests.core.checks import random_surface_points

SAMPLES = 300


def stroke_of(curve, noise, seed=0):
    """Samples of a curve, each moved at random by up to the noise."""
    points, _ = resample(curve.points, SAMPLES, curve.closed)
    moves = np.random.default_rng(seed).normal(size=points.shape)
    moves *= (
        noise
        * np.random.default_rng(seed + 1).random((len(points), 1))
        / np.linalg.norm(moves, axis=1, keepdims=True)
    )
    return points + moves


def farthest(curve, stroke):
    """Greatest distance between a curve and a stroke, in both directions."""
    dense, _ = resample(curve.points, 20 * SAMPLES, curve.closed)
    other, _ = resample(stroke, 20 * SAMPLES, curve.closed)
    return max(cKDTree(dense).query(other)[0].max(), cKDTree(other).query(dense)[0].max())


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("closed", [False, True])
@pytest.mark.parametrize("name", ["ball", "body", "ring"])
def test_a_noisy_curve_is_fitted_by_few_points(request, name, closed, seed):
    mesh = request.getfixturevalue(name)
    points = random_surface_points(mesh, 4, seed)
    curve = nicmm.design_curve(mesh, points, closed=closed, order="shortest").curves[0]
    noise = 0.01 * mesh.diagonal
    stroke = stroke_of(curve, noise, seed)
    fitted = nicmm.fit_stroke(mesh, stroke, 2.0 * noise, closed=closed)
    # At most half of those that every tenth sample would need.
    assert 2 + closed <= len(fitted) <= SAMPLES // 20
    found = nicmm.design_curve(mesh, fitted, closed=closed).curves[0]
    assert farthest(found, stroke) <= 2.0 * noise * 1.001


@pytest.mark.slow
@pytest.mark.parametrize("closed", [False, True])
def test_the_curve_through_the_points_has_been_designed_already(body, monkeypatch, closed):
    """It is the curve that another Designer finds."""
    designer = nicmm.Designer(body)
    curve = designer.design(random_surface_points(body, 4, 0), closed=closed).curves[0]
    tolerance = 0.02 * body.diagonal
    points = designer.fit_stroke(stroke_of(curve, 0.5 * tolerance), tolerance, closed)
    own = nicmm.design_curve(body, points, closed=closed)
    searched = []
    monkeypatch.setattr(
        start_search.StartSearch, "first", lambda *given: searched.append(given) or own
    )
    found = designer.design(points, closed=closed)
    np.testing.assert_array_equal(found.curves[0].points, own.curves[0].points)
    assert not searched
    with pytest.raises(TypeError):  # another request is designed
        designer.design(points, closed=closed, smoothness=0.5)
    assert searched


@pytest.mark.slow
def test_the_curve_of_the_caller_counts_even_if_each_design_ends_early(monkeypatch):
    """As where a curve differs from the stroke only before it is relaxed on the given faces."""
    body = shapes.creature(5, faces=200, subdivisions=1)
    curve = nicmm.design_curve(body, random_surface_points(body, 4, 5), order="shortest").curves[0]
    tolerance = 0.02 * body.diagonal
    stroke = stroke_of(curve, 0.5 * tolerance, 5)

    def beaten(self):
        if self.rival is not None:
            self.rival.is_beaten = True
            raise improvement.RivalBeatenError

    monkeypatch.setattr(improvement.Improvement, "_check_rival", beaten)
    fitted = nicmm.fit_stroke(body, stroke, tolerance, closed=True)
    assert farthest(nicmm.design_curve(body, fitted).curves[0], stroke) <= tolerance * 1.001


@pytest.mark.slow
def test_curves_with_normal_bending_stay_near_their_strokes(body):
    designer, tolerance = nicmm.Designer(body), 0.02 * body.diagonal

    def away(seed, **shape):
        points = random_surface_points(body, 4, seed)
        curve = designer.design(points, closed=False, order="shortest").curves[0]
        stroke = stroke_of(curve, 0.5 * tolerance, seed)
        fitted = designer.fit_stroke(stroke, tolerance, **shape)
        design = designer.design(fitted, closed=False, normal_bending=1.0)
        return farthest(design.curves[0], stroke)

    seeds = range(1, 6)
    assert max(away(seed, normal_bending=1.0) for seed in seeds) <= tolerance * 1.001
    assert any(away(seed) > tolerance for seed in seeds)  # the points depend on the shape


@pytest.mark.slow
def test_a_stroke_without_noise_is_followed_closely(ball):
    curve = nicmm.design_curve(ball, [5, 200, 400], closed=False).curves[0]
    tolerance = 1e-3 * ball.diagonal
    fitted = nicmm.fit_stroke(ball, curve.points, tolerance)
    found = nicmm.design_curve(ball, fitted, closed=False).curves[0]
    assert farthest(found, curve.points) <= tolerance * 1.001
    assert np.linalg.norm(fitted[0] - curve.points[0]) <= tolerance
    assert np.linalg.norm(fitted[-1] - curve.points[-1]) <= tolerance


@pytest.mark.slow
def test_a_smaller_tolerance_takes_more_points():
    mesh = shapes.sphere(4)
    angle = np.linspace(0.0, 4.0, 400)
    height = 0.3 * np.sin(5.0 * angle)
    circle = np.sqrt(1.0 - height**2)
    wave = np.stack([circle * np.cos(angle), circle * np.sin(angle), height], axis=1)
    coarse, fine = (len(nicmm.fit_stroke(mesh, wave, each)) for each in (0.1, 0.01))
    assert coarse < fine


def test_a_short_straight_stroke_has_two_points(ball):
    start, end = ball.vertices[[5, 60]]
    line = start + np.linspace(0.0, 1.0, 50)[:, None] * (end - start)
    line /= np.linalg.norm(line, axis=1, keepdims=True)
    assert len(nicmm.fit_stroke(ball, line, 0.05)) == 2


@pytest.mark.slow
def test_the_same_stroke_gives_the_same_points(body):
    curve = nicmm.design_curve(body, random_surface_points(body, 3, 1), closed=False).curves[0]
    stroke = stroke_of(curve, 0.01 * body.diagonal)
    one, other = (nicmm.fit_stroke(body, stroke, 0.02 * body.diagonal) for _ in range(2))
    np.testing.assert_array_equal(one, other)


@pytest.mark.slow
def test_points_on_the_surface_are_returned(body):
    curve = nicmm.design_curve(body, random_surface_points(body, 3, 1), closed=False).curves[0]
    fitted = nicmm.fit_stroke(body, stroke_of(curve, 0.01 * body.diagonal), 0.02 * body.diagonal)
    assert nearest_points(body, fitted)[1].max() < 1e-9 * body.diagonal


@pytest.mark.parametrize(
    ("given", "error", "words"),
    [
        ({"tolerance": 0.0}, nicmm.ArgumentError, "tolerance is 0.0"),
        ({"tolerance": np.nan}, nicmm.ArgumentError, "tolerance is nan"),
        ({"points": np.zeros((5, 2))}, nicmm.ArgumentError, "shape \\(5, 2\\)"),
        ({"points": np.full((5, 3), np.inf)}, nicmm.ArgumentError, "NaN or infinite"),
        ({"points": np.zeros((5, 3))}, nicmm.ArgumentError, "1 different points"),
        ({"points": "line"}, nicmm.ArgumentError, "cannot be read as numbers"),
        ({"points": [[3.0, 0.0, 0.0], [0.0, 3.0, 0.0]]}, nicmm.ControlPointError, "off the surf"),
        ({"points": 1e200 * np.eye(3)}, nicmm.ControlPointError, "inf off the surface"),
        ({"closed": 2}, nicmm.ArgumentError, "closed is 2"),
    ],
)
def test_what_cannot_be_used_is_refused(ball, given, error, words):
    arguments = {"points": ball.vertices[[5, 60, 100]], "tolerance": 0.1, **given}
    with pytest.raises(error, match=words):
        nicmm.fit_stroke(ball, **arguments)


def test_a_stroke_from_one_part_to_another_is_refused():
    one = shapes.sphere(2)
    faces = np.concatenate([one.faces, one.faces + len(one.vertices)])
    mesh = nicmm.Mesh(np.concatenate([one.vertices, one.vertices + [2.2, 0.0, 0.0]]), faces)
    line = np.stack([np.linspace(-0.9, 3.1, 80), np.zeros(80), np.zeros(80)], axis=1)
    line[:, 2] = np.sqrt(np.maximum(1.0 - np.minimum(line[:, 0] ** 2, (line[:, 0] - 2.2) ** 2), 0))
    with pytest.raises(nicmm.UnreachableError, match="no curve was found"):
        nicmm.fit_stroke(mesh, line, 0.15)


@pytest.mark.slow
def test_a_fit_can_be_cancelled_and_shows_its_curve(body, monkeypatch):
    monkeypatch.setattr(progress, "INTERVAL", 0.0)
    points = random_surface_points(body, 4, 1)
    curve = nicmm.design_curve(body, points, closed=True, order="shortest").curves[0]
    stroke = stroke_of(curve, 0.01 * body.diagonal)
    fractions, lines = [], []

    def watch(fraction, line):
        fractions.append(fraction)
        lines.append(line)
        return len(fractions) < 40

    found = nicmm.fit_stroke(body, stroke, 0.02 * body.diagonal, closed=True, progress=watch)
    assert len(fractions) == 40 and found.shape == (0, 3)
    assert fractions == sorted(fractions)
    assert any(map(len, lines))


def test_the_progress_of_a_fit_must_be_callable(ball):
    stroke = np.eye(3)
    with pytest.raises(nicmm.ArgumentError, match="progress"):
        nicmm.fit_stroke(ball, stroke, 0.1, progress=1)
