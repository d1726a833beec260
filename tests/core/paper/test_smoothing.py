"""Tests the smoother: a minimiser that is zero at control points, and their response fields."""

import numpy as np
import pytest

import nicmm_core as nicmm
from nicmm_core.geometry.surface_points import locate_control_points
from nicmm_core.paper import sparse_solver
from nicmm_core.paper.finite_elements import build_finite_elements
from nicmm_core.paper.problem import build_problem
from nicmm_core.paper.smoothing import build_smoother, mixed_factorised
from nicmm_core.paper.zero_set import zero_set
from nicmm_core.path.virtual_splits import SplitMesh
from tests.core.checks import assert_valid_curve

CONTROLS = np.array([3, 40, 111])
LENGTH = 0.3


@pytest.fixture(scope="module")
def elements(small_ball):
    working, _ = SplitMesh(small_ball).assemble(0)
    return build_finite_elements(working.vertices, working.faces, working.on_boundary)


@pytest.fixture(scope="module")
def smoother(elements):
    return build_smoother(elements, CONTROLS, LENGTH)


@pytest.fixture
def noise(elements):
    return np.random.default_rng(3).normal(size=len(elements.vertex_areas))


def bending(elements, field):
    return elements.vertex_areas @ (elements.divergence @ elements.gradient @ field) ** 2


def test_smoothed_field_is_zero_at_the_control_points(smoother, noise):
    np.testing.assert_array_equal(smoother.smoothed(noise)[CONTROLS], 0.0)
    np.testing.assert_array_equal(smoother.interpolating(noise)[CONTROLS], 0.0)


def test_response_is_one_at_its_own_point_and_zero_at_the_others(smoother):
    np.testing.assert_allclose(smoother.response[CONTROLS], np.eye(3), rtol=0, atol=1e-12)


def test_response_fades_away_from_its_point(smoother, small_ball):
    far = np.linalg.norm(small_ball.vertices - small_ball.vertices[CONTROLS[0]], axis=1) > 1.5
    assert np.abs(smoother.response[far, 0]).max() < 0.1


def test_control_points_with_the_same_response(elements, smoother, noise):
    """As two control points on an extremely thin surface have."""
    twice = build_smoother(elements, np.append(CONTROLS, CONTROLS[-1]), LENGTH)
    np.testing.assert_allclose(twice.smoothed(noise), smoother.smoothed(noise), rtol=0, atol=1e-9)


def test_smoothing_bends_less(elements, smoother, noise):
    assert bending(elements, smoother.smoothed(noise)) < 0.1 * bending(elements, noise)


def test_longer_length_bends_less(elements, noise):
    bendings = [
        bending(elements, build_smoother(elements, CONTROLS, length).smoothed(noise))
        for length in (0.1, 0.2, 0.4)
    ]
    assert bendings[0] > bendings[1] > bendings[2]


def test_no_length_changes_nothing(elements, noise):
    noise[CONTROLS] = 0.0
    np.testing.assert_allclose(
        build_smoother(elements, CONTROLS, 1e-4).smoothed(noise), noise, rtol=0, atol=1e-6
    )


def test_smoothed_field_is_the_minimiser(elements, smoother, noise):
    """It minimises ∫ (φ - f)² + ℓ⁴ (Δφ)² among the fields that are zero at the control points."""

    def energy(field):
        return elements.vertex_areas @ (field - noise) ** 2 + LENGTH**4 * bending(elements, field)

    best = smoother.smoothed(noise)
    generator = np.random.default_rng(8)
    for size in (1e-3, 1e-1, 1.0):
        change = size * generator.normal(size=len(noise))
        change[CONTROLS] = 0.0
        assert energy(best + change) > energy(best)
        # At a minimum the energy is the same for a change and its opposite.
        assert energy(best + change) == pytest.approx(energy(best - change), rel=1e-6)


def test_interpolating_leaves_a_field_that_is_zero_already(smoother, noise):
    noise[CONTROLS] = 0.0
    np.testing.assert_array_equal(smoother.interpolating(noise), noise)


@pytest.mark.parametrize("length", [0.02, 0.2])
def test_the_mixed_system_solves_the_same(ball, length):
    working, _ = SplitMesh(ball).assemble(0)
    elements = build_finite_elements(working.vertices, working.faces, working.on_boundary)
    right = np.random.default_rng(0).normal(size=(len(working.vertices), 2))
    stiffness, areas = elements.stiffness, elements.vertex_areas
    found = mixed_factorised(elements, length)(right)
    bent = stiffness @ ((stiffness @ found) / areas[:, None])
    np.testing.assert_allclose(areas[:, None] * found + length**4 * bent, right, atol=1e-9)


@pytest.mark.slow
def test_a_vertex_of_thousands_of_edges_fills_no_matrix(monkeypatch):
    sizes = []
    plain = sparse_solver.linalg.splu
    monkeypatch.setattr(
        sparse_solver.linalg,
        "splu",
        lambda matrix, *rest, **named: sizes.append(matrix.nnz) or plain(matrix, *rest, **named),
    )
    rim = 3000
    angle = 2.0 * np.pi * np.arange(rim) / rim
    vertices = np.column_stack([np.cos(angle), np.sin(angle), np.zeros(rim)])
    vertices = np.concatenate([vertices, [[0.0, 0.0, 1.0], [0.0, 0.0, -1.0]]])
    start, end = np.arange(rim), (np.arange(rim) + 1) % rim
    faces = [np.column_stack([start, end, np.full(rim, rim)])]
    faces.append(np.column_stack([end, start, np.full(rim, rim + 1)]))
    mesh = nicmm.Mesh(vertices, np.concatenate(faces))
    chosen = [0, 900, 2000]
    problem = build_problem(mesh, locate_control_points(mesh, chosen, closed=True))
    (curve,) = zero_set(mesh, problem, problem.initial_distance)
    assert_valid_curve(mesh, curve, mesh.vertices[chosen])
    assert max(sizes) < 100 * len(vertices)
