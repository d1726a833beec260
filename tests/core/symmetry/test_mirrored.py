"""Tests of the mirror images of designs, and of the parts of meshes on one side of a plane."""

from dataclasses import replace

import numpy as np
import pytest

import nicmm_core as nicmm
from nicmm_core import shapes
from nicmm_core.geometry.mirror import Plane
from nicmm_core.symmetry.half_mesh import half_mesh
from nicmm_core.symmetry.reflection import asymmetry
from tests.core.checks import apart, assert_valid_design, joined, random_surface_points
from tests.core.symmetry.symmetric_meshes import FLIP, MIRROR, points_on_right, symmetric_creature


@pytest.fixture(scope="module")
def creature():
    return symmetric_creature(2)


@pytest.fixture(scope="module")
def right(creature):
    return nicmm.design_curve(creature, points_on_right(creature, 3, 4))


@pytest.mark.slow
@pytest.mark.parametrize("closed", [True, False])
def test_mirror_image_is_a_valid_design(creature, closed):
    points = points_on_right(creature, 3, 4)
    design = nicmm.design_curve(creature, points, closed=closed)
    image = nicmm.mirrored(creature, design, MIRROR)
    assert_valid_design(creature, image, FLIP * creature.vertices[points], closed)
    assert image.status is design.status
    assert image.energy["smooth"] == pytest.approx(design.energy["smooth"], rel=0.01)
    if closed:
        away = apart(FLIP * image.curves[0].points, design.curves[0].points)
        assert away < 1e-12 * creature.diagonal


@pytest.mark.slow
@pytest.mark.parametrize("name", ["sphere", "torus", "disc", "cube"])
def test_where_the_triangulation_is_not_symmetric(name):
    mesh = getattr(shapes, name)()
    design = nicmm.design_curve(mesh, random_surface_points(mesh, 4, 1), order="shortest")
    plane = ((0.0, 0.0, 0.0), (1.0, 2.0, 0.5 if name == "sphere" else 0.0))
    if name == "cube":
        plane = ((0.0, 0.0, 0.0), (1.0, 1.0, 0.0))
    image = nicmm.mirrored(mesh, design, plane)
    (curve,) = image.curves
    assert_valid_design(mesh, image, curve.points[curve.control_index])
    back = nicmm.mirrored(mesh, image, plane)
    assert apart(back.curves[0].points, design.curves[0].points) < 2e-3 * mesh.diagonal


def test_design_continues_from_the_mirror_image(creature, right):
    designer = nicmm.Designer(creature)
    image = designer.mirrored(right, MIRROR)
    (curve,) = image.curves
    points = curve.points[curve.control_index]
    design = designer.design(points, start=image)
    assert design.status is nicmm.Status.CONVERGED
    assert apart(design.curves[0].points, curve.points) < 0.01 * creature.diagonal


@pytest.mark.slow
def test_mirror_image_on_another_component(right, creature):
    shifted = nicmm.Mesh(FLIP * (creature.vertices + [3.0, 0.0, 0.0]), creature.faces)
    moved = nicmm.Mesh(creature.vertices + [3.0, 0.0, 0.0], creature.faces)
    both = joined(moved, shifted)
    design = nicmm.design_curve(both, points_on_right(creature, 3, 4))
    image = nicmm.mirrored(both, design, MIRROR)
    assert (image.curves[0].faces >= len(creature.faces)).all()


def test_refused(creature, right):
    with pytest.raises(nicmm.ArgumentError, match="plane"):
        nicmm.mirrored(creature, right, ((0, 0, 0), (0, 0, 0)))
    with pytest.raises(nicmm.ArgumentError, match="design"):
        nicmm.mirrored(creature, right.curves[0], MIRROR)
    with pytest.raises(nicmm.CurveError, match="away from the surface"):
        nicmm.mirrored(creature, right, ((2.0, 0.0, 0.0), (1.0, 0.0, 0.0)))
    with pytest.raises(nicmm.CurveError, match="another mesh"):
        nicmm.mirrored(nicmm.Mesh(2.0 * creature.vertices, creature.faces), right, MIRROR)
    with pytest.raises(nicmm.CurveError, match="0 curves"):
        nicmm.mirrored(creature, replace(right, curves=[]), MIRROR)


def test_asymmetry_of_a_shifted_curve(right):
    """The distance of a curve to its image in a plane at a distance is at most twice that."""
    (curve,) = right.curves
    normal = np.array(MIRROR[1])
    far = Plane(curve.points.max(axis=0) + normal, normal)
    assert asymmetry(curve, far) >= 2.0


def test_half_of_a_sphere(ball):
    plane = Plane(np.array([0.1, 0.0, 0.0]), np.array([0.6, 0.0, 0.8]))
    half = half_mesh(ball, plane)
    other = half_mesh(ball, Plane(plane.point, -plane.normal))
    total = half.mesh.face_areas.sum() + other.mesh.face_areas.sum()
    assert total == pytest.approx(ball.face_areas.sum(), rel=1e-12)
    heights = plane.heights(half.mesh.vertices)
    assert heights.min() >= -1e-5
    np.testing.assert_array_equal(half.on_plane, np.abs(heights) <= 1e-6 * ball.diagonal)
    # The only boundary is the circle on the plane.
    boundary = np.unique(half.mesh.unpaired_edges[0])
    np.testing.assert_array_equal(boundary, np.flatnonzero(half.on_plane))
    weights = half.weights_to(ball, ball.vertices[:, 1])
    np.testing.assert_allclose(weights, half.mesh.vertices[:, 1], atol=1e-12)
    assert half_mesh(ball, Plane(np.array([0.0, 0.0, 2.0]), np.array([0.0, 0.0, 1.0]))) is None
