"""Tests every energy term against closed forms or values by hand, and their common properties."""

import numpy as np
import pytest
import torch
from scipy import sparse
from scipy.spatial.transform import Rotation

import nicmm_core as nicmm
from nicmm_core import shapes
from nicmm_core.geometry.surface_points import locate_control_points
from nicmm_core.paper.finite_elements import build_finite_elements
from nicmm_core.paper.losses import (
    MOST_BENDING,
    EnergySurface,
    LossWeights,
    balanced,
    energy_of,
    energy_surface,
    feature_loss,
    interpolation_loss,
    loss_terms,
    root_delta,
    sdf_loss,
    smoothness_loss,
    total_loss,
)
from nicmm_core.paper.problem import build_problem
from nicmm_core.paper.tensors import sparse_operator, surface_tensors
from nicmm_core.path.virtual_splits import SplitMesh

CPU = torch.device("cpu")


def arrays(mesh, delta_width, controls=(), phi_fea=None):
    """The surface in the unit of the mesh."""
    working, _ = SplitMesh(mesh).assemble(0)
    elements = build_finite_elements(working.vertices, working.faces, working.on_boundary)
    return EnergySurface(
        face_areas=elements.face_areas,
        gradient=lambda phi: elements.gradient @ phi,
        divergence=lambda vectors: elements.divergence @ vectors,
        centroid=lambda phi: elements.centroid @ phi,
        control_vertices=np.array(controls, dtype=np.int64),
        delta_width=delta_width,
        feature_map=phi_fea,
    )


def dense_tensors(elements, arrays):
    """A surface as tensors in double precision, with dense matrices."""

    def operator(matrix):
        dense = torch.as_tensor(matrix.toarray())
        return lambda vector: dense @ vector

    phi_fea = arrays.feature_map
    return EnergySurface(
        face_areas=torch.as_tensor(arrays.face_areas),
        gradient=operator(elements.gradient),
        divergence=operator(elements.divergence),
        centroid=operator(elements.centroid),
        control_vertices=torch.as_tensor(arrays.control_vertices),
        delta_width=arrays.delta_width,
        feature_map=None if phi_fea is None else torch.as_tensor(phi_fea),
    )


@pytest.mark.parametrize("slope", [0.0, 0.5, 1.0, 2.0])
def test_level_set_term_of_a_linear_field(flat_disc, slope):
    """Eq. 3 and 8 give ½ (c² - 1)² times the area, which is zero for an exact distance."""
    surface = arrays(flat_disc, 0.1)
    phi = slope * (flat_disc.vertices @ [0.6, 0.8, 0.0] - 0.2)
    expected = 0.5 * (slope**2 - 1.0) ** 2 * flat_disc.face_areas.sum()
    assert sdf_loss(surface, phi) == pytest.approx(expected, rel=1e-9, abs=1e-12)


def test_interpolation_term_by_hand(small_ball):
    """Eq. 4 is the sum of φ² at the control points."""
    phi = np.full(len(small_ball.vertices), 100.0)
    phi[[3, 40, 111]] = [0.5, -2.0, 0.0]
    surface = arrays(small_ball, 0.1, controls=[3, 40, 111])
    assert interpolation_loss(surface, phi) == pytest.approx(4.25)


def circle_on(mesh, radius):
    """Signed distance to a circle."""
    return np.linalg.norm(mesh.vertices, axis=1) - radius


@pytest.mark.parametrize("radius", [0.4, 0.6])
def test_smoothness_term_of_a_circle(radius):
    """Eq. 5 and 8 converge to ½ ∮ κ² dl = π / R for φ = r - R as mesh and Gaussian are refined."""
    errors = []
    for rings in (12, 24):
        mesh = shapes.disc(rings)
        value = smoothness_loss(arrays(mesh, 1.0 / rings), circle_on(mesh, radius))
        errors.append(abs(value - np.pi / radius) / (np.pi / radius))
    assert errors[1] < 0.03, errors
    assert errors[1] < 0.5 * errors[0], errors


def test_smoothness_term_of_a_parallel_of_the_sphere():
    """κ_g = cot θ on the parallel at the angle θ from the pole, and 0 on the equator."""
    mesh = shapes.sphere(4)
    angle = np.arccos(np.clip(mesh.vertices[:, 2], -1, 1))
    surface = arrays(mesh, 0.1)
    for theta in (np.pi / 3, np.pi / 2):
        expected = np.pi * np.sin(theta) / np.tan(theta) ** 2
        found = smoothness_loss(surface, angle - theta)
        assert found == pytest.approx(expected, rel=0.06, abs=0.06)


@pytest.mark.parametrize("slope", [0.2, 2.0, 10.0])
def test_smoothness_term_depends_on_the_curve_and_not_on_the_slope(slope):
    """With φ and the width multiplied by c, |∇φ| G_σ(φ) is the same delta, so Eq. 5 is, too."""
    mesh, radius = shapes.disc(24), 0.5
    phi = circle_on(mesh, radius)
    expected = smoothness_loss(arrays(mesh, 1 / 24), phi)
    found = smoothness_loss(arrays(mesh, slope / 24), slope * phi)
    assert found == pytest.approx(expected, rel=1e-3)


def test_smoothness_term_weighs_by_the_slope_beside_the_curve():
    """With the same width, a slope of 2 gives the same integral: the delta is half as wide."""
    mesh, radius = shapes.disc(48), 0.5
    phi = circle_on(mesh, radius)
    expected = smoothness_loss(arrays(mesh, 2 / 48), phi)
    assert smoothness_loss(arrays(mesh, 2 / 48), 2.0 * phi) == pytest.approx(expected, rel=0.02)


def test_smoothness_term_of_another_function_of_the_distance(flat_disc):
    """Curvature is that of the curve: the straight line x = 0.1 as the zero set of x³ + x."""
    offset = flat_disc.vertices[:, 0] - 0.1
    phi = offset + offset**3
    assert smoothness_loss(arrays(flat_disc, 0.08), phi) < 1e-3
    circle = smoothness_loss(arrays(flat_disc, 0.08), circle_on(flat_disc, 0.5))
    assert circle > 1.0


def test_flat_field_has_a_finite_smoothness_term(flat_disc):
    assert smoothness_loss(arrays(flat_disc, 0.08), np.zeros(len(flat_disc.vertices))) == 0.0


def test_smoothness_term_of_a_straight_line_is_zero(flat_disc):
    phi = flat_disc.vertices[:, 0] - 0.1
    assert smoothness_loss(arrays(flat_disc, 0.08), phi) < 1e-15


@pytest.mark.parametrize("phi_fea", [1.0, 0.5, 2.0])
def test_feature_term_of_a_circle(phi_fea):
    """Eq. 7 and 8 give ½ b² times the length for a constant map b."""
    mesh, radius = shapes.disc(24), 0.5
    phi = np.linalg.norm(mesh.vertices, axis=1) - radius
    surface = arrays(mesh, 1 / 24, phi_fea=np.full(len(mesh.faces), phi_fea))
    expected = 0.5 * phi_fea**2 * 2 * np.pi * radius
    assert feature_loss(surface, phi) == pytest.approx(expected, rel=0.01)


def test_feature_term_of_a_circle_on_the_sphere(ball):
    """Half the length of a parallel, where φ is its signed distance."""
    height = 0.3
    phi = np.arccos(np.clip(ball.vertices[:, 2], -1, 1)) - np.arccos(height)
    surface = arrays(ball, 0.15, phi_fea=np.ones(len(ball.faces)))
    expected = 0.5 * 2 * np.pi * np.sqrt(1 - height**2)
    assert feature_loss(surface, phi) == pytest.approx(expected, rel=0.02)


def test_feature_term_weighs_the_map_where_the_curve_runs(flat_disc):
    """With a map of 2 and 1 on the two halves, a diameter gets the mean of the squares."""
    left = flat_disc.vertices[flat_disc.faces].mean(axis=1)[:, 0] < 0.0
    surface = arrays(flat_disc, 0.08, phi_fea=np.where(left, 2.0, 1.0))
    phi = flat_disc.vertices[:, 1] - 0.01
    assert feature_loss(surface, phi) == pytest.approx(0.5 * (4.0 + 1.0), rel=0.03)
    assert feature_loss(arrays(flat_disc, 0.08), phi) == 0.0


@pytest.mark.parametrize("width", [0.01, 0.3, 5.0])
def test_delta_integrates_to_one(width):
    values = torch.linspace(-10 * width, 10 * width, 20001, dtype=torch.float64)
    assert torch.trapezoid(root_delta(values, width) ** 2, values).item() == pytest.approx(1.0)
    assert root_delta(values, width).argmax() == 10000


def test_total_is_the_weighted_sum():
    terms = {
        name: torch.tensor(v)
        for name, v in zip(("sdf", "int", "smooth", "fea"), (1.0, 10.0, 100.0, 1000.0), strict=True)
    }
    weights = LossWeights(sdf=2.0, interpolation=3.0, smooth=4.0, feature=5.0)
    assert total_loss(terms, weights).item() == 2.0 + 30.0 + 400.0 + 5000.0


@pytest.fixture(scope="module")
def problem(body):
    return problem_on(body)


def problem_on(mesh):
    points = locate_control_points(mesh, [3, 50, 200, 333], closed=True)
    obstacles = np.zeros(len(mesh.vertices))
    obstacles[100:140] = 0.7
    return build_problem(mesh, points, "shortest", obstacles)


def terms_of(problem, factor=0.9):
    """Terms of a generic field; all of them are nonzero."""
    return energy_of(problem, factor * problem.initial_distance + 0.01)


@pytest.mark.slow
@pytest.mark.parametrize("scale", [1e-3, 1.0, 1e3])
def test_no_term_depends_on_the_unit_or_the_pose(body, problem, scale):
    turn = Rotation.from_rotvec([0.4, -1.1, 0.7]).as_matrix()
    moved = nicmm.Mesh(scale * (body.vertices @ turn.T + [3.0, -2.0, 5.0]), body.faces)
    expected, found = terms_of(problem), terms_of(problem_on(moved))
    assert set(found) == {"sdf", "int", "smooth", "fea"}
    for name, value in expected.items():
        assert value > 0.0
        assert found[name] == pytest.approx(value, rel=1e-3), name


def test_interpolation_vanishes_for_the_initial_field(problem):
    assert interpolation_loss(energy_surface(problem), problem.initial_distance) == 0.0


@pytest.mark.slow
def test_energy_without_a_map_has_no_feature_term(small_ball):
    points = locate_control_points(small_ball, [3, 60, 100], closed=True)
    problem = build_problem(small_ball, points)
    terms = energy_of(problem, problem.initial_distance)
    assert terms.keys() == {"sdf", "int", "smooth", "fea"}
    assert terms["fea"] == 0.0 and terms["smooth"] > 0.0
    assert all(type(value) is float for value in terms.values())


def test_weight_of_bending_is_bounded(problem):
    """λ_smooth times the term at φ₀ is at most the bound; smaller weights stay."""
    bending = energy_of(problem, problem.initial_distance)["smooth"]
    for product in (0.5, 2.0):
        given = LossWeights(smooth=product * MOST_BENDING / bending, feature=0.7)
        used = balanced(given, problem)
        assert used.smooth * bending == pytest.approx(min(product, 1.0) * MOST_BENDING)
        assert (used.sdf, used.interpolation, used.feature) == (1.0, 5000.0, 0.7)


def test_sparse_operator_and_its_gradient_equal_the_dense_matrix():
    matrix = sparse.random_array((40, 30), density=0.2, rng=np.random.default_rng(0))
    operator = sparse_operator(matrix, CPU)
    generator = torch.Generator().manual_seed(1)
    vector = torch.randn(30, generator=generator, requires_grad=True)
    weight = torch.randn(40, generator=generator)
    (operator(vector) @ weight).backward()
    dense = matrix.toarray()
    np.testing.assert_allclose(
        operator(vector).detach(), dense @ vector.detach().numpy(), rtol=1e-5, atol=1e-6
    )
    np.testing.assert_allclose(vector.grad, dense.T @ weight.numpy(), rtol=1e-5, atol=1e-6)


def test_sparse_operator_does_not_change_when_the_matrix_is_sorted():
    """SciPy sorts the indices of a matrix in place when it is multiplied, for example."""
    data = np.array([1.0, 2.0, 3.0, 4.0])
    indices, rows = (np.array(part, dtype=np.int32) for part in ([3, 0, 2, 1], [0, 2, 4]))
    matrix = sparse.csr_array((data, indices, rows), shape=(2, 4))
    assert not matrix.has_sorted_indices
    operator = sparse_operator(matrix, CPU)
    vector = torch.tensor([1.0, 10.0, 100.0, 1000.0])
    before = operator(vector)
    matrix.sort_indices()
    assert matrix.indices.tolist() == [0, 3, 1, 2]
    assert operator(vector).tolist() == before.tolist() == [1002.0, 340.0]


def generic_field(mesh):
    return mesh.vertices[:, 2] + 0.1 * mesh.vertices[:, 0] ** 2


def test_gradients_of_all_terms_are_those_of_differences(small_ball):
    """Derivatives of PyTorch, compared with finite differences in NumPy, in double precision."""
    phi_fea = np.linspace(0.5, 2.0, 320)
    surface = arrays(small_ball, 0.3, controls=[3, 40, 111], phi_fea=phi_fea)
    working, _ = SplitMesh(small_ball).assemble(0)
    elements = build_finite_elements(working.vertices, working.faces, working.on_boundary)
    start = generic_field(small_ball)
    phi = torch.as_tensor(start).requires_grad_()
    tensors = loss_terms(dense_tensors(elements, surface), phi)
    direction = np.random.default_rng(0).normal(size=len(start))
    for name, value in loss_terms(surface, start).items():
        assert tensors[name].item() == pytest.approx(value, rel=1e-12), name
        (slope,) = torch.autograd.grad(tensors[name], phi, retain_graph=True)
        step = 1e-6
        ahead, behind = (
            loss_terms(surface, start + sign * step * direction)[name] for sign in (1, -1)
        )
        difference = (ahead - behind) / (2 * step)
        assert slope.numpy() @ direction == pytest.approx(difference, rel=1e-5), name
        assert abs(difference) > 1e-6


@pytest.mark.slow
def test_single_precision_operators_give_the_same_terms_and_gradients(problem):
    """The tensors of pretraining, compared with dense matrices in double precision."""
    double = dense_tensors(problem.elements, energy_surface(problem))
    gradients = []
    for surface, kind in ((double, torch.float64), (surface_tensors(problem, CPU), torch.float32)):
        phi = torch.as_tensor(problem.initial_distance, dtype=kind).requires_grad_()
        total = total_loss(loss_terms(surface, phi), LossWeights())
        total.backward()
        gradients.append((total.item(), phi.grad.double().numpy()))
    (exact, exact_gradient), (found, found_gradient) = gradients
    assert found == pytest.approx(exact, rel=1e-4)
    expected = total_loss(energy_of(problem, problem.initial_distance), LossWeights())
    assert exact == pytest.approx(expected, rel=1e-12)
    scale = np.abs(exact_gradient).max()
    assert scale > 0.0
    np.testing.assert_allclose(found_gradient, exact_gradient, rtol=0, atol=1e-4 * scale)
