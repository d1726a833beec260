"""Tests the energy of the narrow band against the losses, and its derivatives."""

from dataclasses import replace

import numpy as np
import pytest

from nicmm_core import shapes
from nicmm_core.geometry.surface_points import locate_control_points
from nicmm_core.paper import variational
from nicmm_core.paper.contour import segment_ends, signs_with_zeros
from nicmm_core.paper.losses import (
    LossWeights,
    balanced,
    energy_surface,
    loss_terms,
    slope,
    total_loss,
)
from nicmm_core.paper.narrow_band import build_narrow_band, evaluate, gauss_newton_system
from nicmm_core.paper.problem import build_problem

WEIGHTS = LossWeights(smooth=0.02, feature=0.4)


@pytest.fixture(scope="module", params=[False, True], ids=["plain", "guided"])
def problem(request, ball):
    obstacles = (ball.vertices[:, 0] > 0.7).astype(float) if request.param else None
    points = locate_control_points(ball, [3, 200, 400, 600], closed=True)
    return build_problem(ball, points, "shortest", obstacles)


def test_whole_surface_has_the_energy_of_the_losses(problem):
    """A band that contains the whole surface has the energy of Eq. 2."""
    phi = problem.initial_distance
    band = build_narrow_band(problem, phi, np.inf)
    assert len(band.unknowns) == len(phi) - len(problem.loop.control_vertices)
    expected = total_loss(loss_terms(energy_surface(problem), phi), WEIGHTS)
    found = evaluate(band, WEIGHTS, phi[band.unknowns]).energy
    assert found == pytest.approx(expected, rel=1e-9)


@pytest.mark.parametrize("half_width_in_edges", [3.0, np.inf])
def test_gradient_is_the_derivative(problem, half_width_in_edges):
    """Compared with central differences along random directions."""
    phi = problem.initial_distance
    band = build_narrow_band(problem, phi, half_width_in_edges * problem.edge_length)
    values = phi[band.unknowns]
    _, gradient = gauss_newton_system(band, WEIGHTS, evaluate(band, WEIGHTS, values))
    generator = np.random.default_rng(0)
    for _ in range(4):
        direction = generator.normal(size=len(values))
        step = 1e-6 * problem.edge_length * direction
        rise = evaluate(band, WEIGHTS, values + step).energy
        rise -= evaluate(band, WEIGHTS, values - step).energy
        assert rise / 2.0 == pytest.approx(gradient @ step, rel=1e-4)


@pytest.mark.slow
def test_hessian_is_symmetric_and_positive_semidefinite(problem):
    band = build_narrow_band(problem, problem.initial_distance, 3.0 * problem.edge_length)
    values = problem.initial_distance[band.unknowns]
    hessian, _ = gauss_newton_system(band, WEIGHTS, evaluate(band, WEIGHTS, values))
    dense = hessian.toarray()
    np.testing.assert_allclose(dense, dense.T, rtol=0, atol=1e-12 * np.abs(dense).max())
    eigenvalues = np.linalg.eigvalsh(dense)
    assert eigenvalues[0] > -1e-10 * eigenvalues[-1]


@pytest.mark.slow
def test_hessian_is_that_of_a_perfect_fit(ball):
    """Up to the known terms of nonzero residuals, the Gauss–Newton Hessian is the exact one."""
    points = locate_control_points(ball, [3, 200, 400], closed=True)
    problem = build_problem(ball, points, "shortest")
    weights = LossWeights(smooth=0.0)
    band = build_narrow_band(problem, problem.initial_distance, np.inf)
    values = problem.initial_distance[band.unknowns]
    residuals = evaluate(band, weights, values)
    hessian, _ = gauss_newton_system(band, weights, residuals)
    generator = np.random.default_rng(1)
    direction = generator.normal(size=len(values))
    step = 1e-5 * problem.edge_length * direction
    _, before = gauss_newton_system(band, weights, evaluate(band, weights, values - step))
    _, after = gauss_newton_system(band, weights, evaluate(band, weights, values + step))
    # Gauss–Newton leaves out 2 (|∇φ|² - 1) |∇δ|² in faces where the slope is below 1.
    left_out = 2.0 * weights.sdf * band.face_areas * np.minimum(residuals.slope, 0.0)
    exact = direction @ (after - before) / 2e-5 / problem.edge_length
    missing = left_out @ ((band.gradient @ direction).reshape(3, -1) ** 2).sum(axis=0)
    assert direction @ (hessian @ direction) + missing == pytest.approx(exact, rel=1e-5)


def test_band_follows_the_curve_and_not_the_mesh(problem):
    """Half the width gives about half the unknowns; bending acts on inner faces only."""
    h = problem.edge_length
    narrow = build_narrow_band(problem, problem.distance, 2.0 * h)
    wide = build_narrow_band(problem, problem.distance, 4.0 * h)
    assert 1.4 < len(wide.unknowns) / len(narrow.unknowns) < 2.6
    assert 0 < len(wide.inner) < len(wide.face_areas)


def test_divergence_is_complete_in_inner_faces(problem):
    """There, curvature is that of the whole surface; on other faces it is not computed."""
    phi = problem.initial_distance
    band = build_narrow_band(problem, phi, 3.0 * problem.edge_length)
    elements = problem.elements
    direction = (elements.gradient @ phi).reshape(3, -1)
    direction /= slope((direction**2).sum(axis=0))
    everywhere = elements.centroid @ (elements.divergence @ direction.ravel())
    gradient = (band.gradient @ phi[band.unknowns]).reshape(3, -1)
    gradient /= slope((gradient**2).sum(axis=0))
    faces = np.flatnonzero(np.abs(elements.centroid @ phi) < 3.0 * problem.edge_length)
    scale = np.abs(everywhere).max()
    np.testing.assert_allclose(
        band.divergence @ gradient.ravel(), everywhere[faces[band.inner]], atol=1e-9 * scale
    )
    np.testing.assert_array_equal(problem.elements.face_areas[faces], band.face_areas)


def test_bending_depends_on_the_curve_and_not_on_the_slope(problem):
    """With φ and the width multiplied by 2, |∇φ| G_σ(φ) is the same delta."""
    phi = problem.distance
    bend = LossWeights(sdf=0.0, smooth=1.0, feature=0.0)
    band = build_narrow_band(problem, phi, 4.0 * problem.edge_length)
    expected = evaluate(band, bend, phi[band.unknowns]).energy
    twice = replace(band, delta_width=2.0 * band.delta_width)
    found = evaluate(twice, bend, 2.0 * phi[band.unknowns]).energy
    assert expected > 1.0
    assert found == pytest.approx(expected, rel=1e-3)


@pytest.mark.slow
@pytest.mark.parametrize("term", ["sdf", "smooth", "feature"])
def test_gradient_of_each_term_is_the_derivative(term):
    """On a random field, also where the slope is far from 1."""
    mesh = shapes.sphere(2)
    points = locate_control_points(mesh, [3, 60, 100], closed=True)
    problem = build_problem(mesh, points, alignment=np.linspace(0.0, 1.0, len(mesh.vertices)))
    weights = LossWeights(**{"sdf": 0.0, "smooth": 0.0, "feature": 0.0, term: 1.0})
    band = build_narrow_band(problem, problem.initial_distance, np.inf)
    generator = np.random.default_rng(0)
    h = problem.edge_length
    values = problem.initial_distance[band.unknowns]
    values = values + 0.3 * h * generator.normal(size=len(values))
    hessian, gradient = gauss_newton_system(band, weights, evaluate(band, weights, values))
    assert hessian.shape == (len(values), len(values))
    direction = generator.normal(size=len(values))
    step = 1e-6 * h * direction
    rise = evaluate(band, weights, values + step).energy
    rise -= evaluate(band, weights, values - step).energy
    assert rise / 2.0 == pytest.approx(gradient @ step, rel=1e-4)


def test_hessian_of_bending_is_that_of_the_residuals(problem):
    """JᵀJ with the Jacobian of the residuals by differences, along random directions."""
    bend = LossWeights(sdf=0.0, smooth=1.0, feature=0.0)
    phi = problem.initial_distance
    band = build_narrow_band(problem, phi, 3.0 * problem.edge_length)
    values = phi[band.unknowns]
    hessian, _ = gauss_newton_system(band, bend, evaluate(band, bend, values))
    areas = band.face_areas[band.inner]
    generator = np.random.default_rng(2)
    for _ in range(3):
        direction = generator.normal(size=len(values))
        step = 1e-6 * problem.edge_length
        ahead, behind = (
            evaluate(band, bend, values + sign * step * direction).bending for sign in (1, -1)
        )
        change = (ahead - behind) / (2.0 * step)
        expected = areas @ change**2
        assert direction @ (hessian @ direction) == pytest.approx(expected, rel=1e-4)


def test_unknowns_leave_out_the_control_points(problem):
    band = build_narrow_band(problem, problem.initial_distance, 4.0 * problem.edge_length)
    assert not np.isin(problem.loop.control_vertices, band.unknowns).any()
    assert (np.diff(band.unknowns) > 0).all()
    assert (np.linalg.eigvalsh(band.damping.toarray())[0]) > 0.0


@pytest.mark.slow
@pytest.mark.slow
@pytest.mark.parametrize("seed", [0, 1, 2])
def test_bending_is_counted_along_the_whole_curve(body, seed):
    """The curve that the solver finds lies in inner faces."""
    chosen = np.random.default_rng(seed).choice(len(body.vertices), 4, replace=False)
    points = locate_control_points(body, chosen, closed=bool(seed % 2))
    problem = build_problem(body, points, "shortest", closed=bool(seed % 2))
    field = variational.solve(problem, balanced(LossWeights(), problem)).field
    half_width = variational.CONVERGENCE.half_width * problem.edge_length
    band = build_narrow_band(problem, field, half_width)
    faces = np.flatnonzero(np.abs(problem.elements.centroid @ field) < half_width)
    sign = signs_with_zeros(field, problem.loop.control_vertices)
    crossed, start, end = segment_ends(
        problem.vertices, problem.working.faces, field, sign, problem.bundle
    )
    length = np.linalg.norm(end - start, axis=1)
    counted = np.isin(crossed, faces[band.inner])
    assert length[counted].sum() > 0.95 * length.sum()
