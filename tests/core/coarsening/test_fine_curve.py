"""Tests that curves on the coarse mesh are mapped to the fine mesh, through the exact points."""

import numpy as np
import pytest
from scipy.spatial import cKDTree

import nicmm_core as nicmm
from nicmm_core import shapes
from nicmm_core.coarsening.coarse_mesh import build_coarse_mesh
from nicmm_core.coarsening.fine_curve import nodes_on_fine_mesh
from nicmm_core.geometry.normals import unsigned_normals
from nicmm_core.geometry.surface_points import locate_control_points
from nicmm_core.relaxation.curve_nodes import CurveSurface
from nicmm_core.relaxation.discrete_curve import place_nodes
from tests.core.checks import assert_valid_curve

pytestmark = pytest.mark.usefixtures("one_attempt_each")


def curves_through(mesh, chosen, closed):
    """Coarse mesh, a curve on it, and the curve mapped to the fine mesh."""
    normals = unsigned_normals(mesh)
    coarse = build_coarse_mesh(mesh, normals, 600)
    points = locate_control_points(mesh, chosen, closed)
    near = coarse.nearest_points(mesh, points)
    (curve,) = nicmm.design_curve(coarse.mesh, near, closed=closed).curves
    surface = CurveSurface(mesh, normals)
    coarse_surface = CurveSurface(coarse.mesh, unsigned_normals(coarse.mesh))
    nodes = place_nodes(coarse_surface, curve, 256)
    result = nodes_on_fine_mesh(surface, coarse, nodes, points)
    return coarse, curve, None if result is None else result.surface_curve(mesh)


def rough_sphere():
    """A sphere with needles and dents, on which straight traces fail."""
    generator = np.random.default_rng(4)
    fine = shapes.sphere(5)
    return nicmm.Mesh(
        fine.vertices + generator.normal(scale=0.008, size=fine.vertices.shape), fine.faces
    )


@pytest.mark.slow
@pytest.mark.parametrize("closed", [True, False])
@pytest.mark.parametrize(
    "mesh",
    [shapes.sphere(5), shapes.creature(2, faces=200, subdivisions=3), rough_sphere()],
    ids=["sphere", "creature", "rough"],
)
def test_fine_curve_is_valid_and_near(mesh, closed):
    chosen = np.random.default_rng(2).choice(len(mesh.vertices), size=4, replace=False)
    coarse, curve, result = curves_through(mesh, chosen, closed)
    assert result is not None
    assert_valid_curve(mesh, result, closed=closed)
    found = result.points[result.control_index]
    assert np.abs(found - mesh.vertices[chosen]).max() <= 1e-12 * mesh.diagonal
    apart, _ = cKDTree(curve.points).query(result.points)
    assert apart.max() < 2.0 * coarse.mesh.mean_edge_length
