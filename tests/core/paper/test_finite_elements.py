"""Tests that operators are exact where linear elements are, and converge elsewhere."""

import igl
import numpy as np
import pytest

from nicmm_core import shapes
from nicmm_core.paper.finite_elements import MOLLIFICATION, build_finite_elements, mollified
from nicmm_core.path.virtual_splits import SplitMesh


def elements_of(mesh):
    working, _ = SplitMesh(mesh).assemble(0)
    return working, build_finite_elements(working.vertices, working.faces, working.on_boundary)


def laplacian(elements):
    """Pointwise Laplacian (n, n) at the vertices."""
    return elements.divergence @ elements.gradient


def test_right_triangle_by_hand():
    vertices = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0]])
    elements = build_finite_elements(vertices, np.array([[0, 1, 2]]), np.ones(3, dtype=bool))
    np.testing.assert_allclose(elements.face_areas, [0.5])
    np.testing.assert_allclose(elements.vertex_areas, [1 / 6] * 3)
    np.testing.assert_allclose(
        elements.gradient.toarray(), [[-1, 1, 0], [-1, 0, 1], [0, 0, 0]], atol=1e-15
    )
    np.testing.assert_allclose(
        elements.stiffness.toarray(), [[1, -0.5, -0.5], [-0.5, 0.5, 0], [-0.5, 0, 0.5]], atol=1e-15
    )


def test_gradient_of_a_linear_function_is_its_tangential_part(surface):
    working, elements = elements_of(surface)
    slope = np.array([0.3, -1.2, 0.7])
    gradient = (elements.gradient @ (working.vertices @ slope)).reshape(3, -1).T
    corner = working.vertices[working.faces]
    normal = np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0])
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    expected = slope - (normal @ slope)[:, None] * normal
    np.testing.assert_allclose(gradient, expected, rtol=0, atol=1e-9)


def test_centroid_values_of_a_linear_function_are_exact(surface):
    working, elements = elements_of(surface)
    slope = np.array([0.3, -1.2, 0.7])
    np.testing.assert_allclose(
        elements.centroid @ (working.vertices @ slope),
        working.vertices[working.faces].mean(axis=1) @ slope,
        rtol=0,
        atol=1e-14,
    )


def test_stiffness_is_the_energy_of_the_gradient(surface):
    """S = Gᵀ A G, although the two are assembled from different formulas."""
    _, elements = elements_of(surface)
    areas = np.tile(elements.face_areas, 3)[:, None]
    product = elements.gradient.T @ (elements.gradient * areas).tocsr()
    scale = abs(elements.stiffness).max()
    assert abs(elements.stiffness - product).max() < 1e-10 * scale


def test_areas_add_up(surface):
    working, elements = elements_of(surface)
    assert elements.face_areas.sum() == pytest.approx(surface.face_areas.sum(), rel=1e-12)
    assert elements.vertex_areas.sum() == pytest.approx(surface.face_areas.sum(), rel=1e-12)
    assert (elements.vertex_areas > 0.0).all()
    assert len(working.vertices) == len(elements.vertex_areas)


def test_divergence_of_the_gradient_is_the_cotangent_laplacian(surface):
    """div ∇ = -A⁻¹ S inside, although the two are assembled from different formulas."""
    working, elements = elements_of(surface)
    found = laplacian(elements).toarray()
    expected = -elements.stiffness.toarray() / elements.vertex_areas[:, None]
    inside = ~working.on_boundary
    scale = np.abs(expected).max()
    np.testing.assert_allclose(found[inside], expected[inside], rtol=0, atol=1e-9 * scale)
    np.testing.assert_array_equal(found[working.on_boundary], 0.0)


def test_divergence_is_the_adjoint_of_the_gradient(flat_disc):
    """∫ φ div v = -∫ ∇φ · v for functions φ that vanish on the boundary."""
    working, elements = elements_of(flat_disc)
    generator = np.random.default_rng(1)
    phi = np.where(working.on_boundary, 0.0, generator.normal(size=len(working.vertices)))
    vector = generator.normal(size=3 * len(working.faces))
    left = (elements.vertex_areas * phi) @ (elements.divergence @ vector)
    right = -(np.tile(elements.face_areas, 3) * (elements.gradient @ phi)) @ vector
    assert left == pytest.approx(right, rel=1e-9)


def test_divergence_of_a_radial_field_by_hand(flat_disc):
    """div (x, y, 0) = 2 and div (-y, x, 0) = 0, in the mean over the area."""
    working, elements = elements_of(flat_disc)
    x, y, _ = working.vertices[working.faces].mean(axis=1).T
    inside = np.linalg.norm(working.vertices, axis=1) < 0.8
    weight = elements.vertex_areas * inside / elements.vertex_areas[inside].sum()
    for vector, expected in (([x, y, 0 * x], 2.0), ([-y, x, 0 * x], 0.0)):
        divergence = elements.divergence @ np.concatenate(vector)
        assert weight @ divergence == pytest.approx(expected, abs=0.02)


def test_constants_have_no_gradient_and_no_laplacian(surface):
    working, elements = elements_of(surface)
    ones = np.ones(len(working.vertices))
    for operator in (elements.gradient, elements.stiffness, laplacian(elements)):
        assert np.abs(operator @ ones).max() < 1e-11 * abs(operator).max()
    np.testing.assert_allclose(elements.centroid @ ones, 1.0)


def test_stiffness_is_positive_with_constants_as_its_only_kernel(small_ball):
    _, elements = elements_of(small_ball)
    eigenvalues = np.linalg.eigvalsh(elements.stiffness.toarray())
    assert abs(eigenvalues[0]) < 1e-12
    assert eigenvalues[1] > 1e-3


def test_laplacian_of_a_paraboloid_is_four(flat_disc):
    """Δ(x² + y²) = 4 away from the boundary, in the mean over the area."""
    working, elements = elements_of(flat_disc)
    values = laplacian(elements) @ (working.vertices**2).sum(axis=1)
    inside = np.linalg.norm(working.vertices, axis=1) < 0.8
    weight = elements.vertex_areas * inside
    assert (weight * values).sum() / weight.sum() == pytest.approx(4.0, rel=0.02)


def test_laplacian_of_a_linear_function_vanishes_on_the_flat_disc(flat_disc):
    """Also on the boundary, where the rows of the Laplacian are zero."""
    working, elements = elements_of(flat_disc)
    values = laplacian(elements) @ working.vertices[:, 0]
    assert np.abs(values).max() < 1e-9
    assert np.abs(elements.stiffness @ working.vertices[:, 0]).max() > 1e-2
    assert abs(laplacian(elements)[np.flatnonzero(working.on_boundary)]).sum() == 0.0


def test_harmonics_of_the_sphere_converge():
    """Δz = -2z, and the energy of xy is 6 ∫ (xy)²; errors decrease with the edge length."""
    field_error, quotient_error = [], []
    for subdivisions in (1, 2, 3):
        working, elements = elements_of(shapes.sphere(subdivisions))
        x, y, z = working.vertices.T
        mass = elements.vertex_areas
        residual = laplacian(elements) @ z + 2.0 * z
        field_error.append(np.sqrt((mass @ residual**2) / (mass @ z**2)))
        quotient_error.append(
            abs((x * y) @ elements.stiffness @ (x * y) / (mass @ (x * y) ** 2) - 6)
        )
    assert field_error[1] < 0.65 * field_error[0] and field_error[2] < 0.65 * field_error[1]
    # Energies converge with second order: halving the edges gives a quarter of the error.
    assert quotient_error[1] < 0.35 * quotient_error[0]
    assert quotient_error[2] < 0.35 * quotient_error[1]


class TestMollification:
    def test_meshes_without_slivers_keep_their_lengths(self, surface):
        lengths = igl.edge_lengths(surface.vertices, surface.faces)
        np.testing.assert_array_equal(mollified(lengths), lengths)

    @pytest.mark.parametrize("excess", [0.0, 1e-9, 1e-3])
    def test_the_longest_side_is_as_much_shorter_as_is_asked(self, excess):
        lengths = np.array([[1.0, 1.0, 1.0], [2.0 + excess, 1.0, 1.0]])
        longer = mollified(lengths)
        np.testing.assert_allclose(longer - lengths, (longer - lengths)[0, 0], rtol=1e-6)
        slack = longer.sum(axis=1) - 2.0 * longer.max(axis=1)
        np.testing.assert_allclose(slack.min(), MOLLIFICATION * lengths.mean(), rtol=1e-6)

    @pytest.mark.parametrize("height", [0.0, 1e-15, 1e-12, 1e-9])
    def test_operators_of_slivers_are_finite_and_keep_constants(self, height):
        vertices = np.array([[0.0, 0, 0], [1, 0, 0], [0.4, height, 0], [0.4, -1, 0]])
        faces = np.array([[0, 1, 2], [1, 0, 3]])
        lengths = mollified(igl.edge_lengths(vertices, faces))
        stiffness = -igl.cotmatrix_intrinsic(lengths, faces)
        assert np.isfinite(stiffness.data).all()
        scale = np.abs(stiffness.data).max()
        np.testing.assert_allclose(stiffness @ np.ones(4), 0.0, atol=1e-12 * scale)
