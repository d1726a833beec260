"""Tests that a large mesh itself is used only in the relaxation and in passes over its arrays."""

import tracemalloc

import numpy as np
import pytest
from scipy.spatial import cKDTree

import nicmm_core as nicmm
from nicmm_core import shapes
from nicmm_core.coarsening import coarse_start
from tests.core.checks import assert_valid_design, grid

pytestmark = pytest.mark.usefixtures("one_attempt_each")


@pytest.fixture(scope="module")
def large():
    """A body with limbs and 12,802 vertices."""
    return shapes.creature(5, faces=400, subdivisions=3)


def chosen_on(mesh, count, seed=0):
    return np.random.default_rng(seed).choice(len(mesh.vertices), size=count, replace=False)


@pytest.mark.slow
@pytest.mark.parametrize("closed", [True, False])
def test_without_courses_the_curve_is_valid(large, without_courses, closed):
    design = nicmm.design_curve(large, chosen_on(large, 5), closed=closed, order="shortest")
    assert_valid_design(large, design, closed=closed)


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(6))
def test_on_a_square_grid_the_coarse_mesh_gives_the_start(seed):
    square = grid(84)
    inner = np.flatnonzero((np.abs(square.vertices[:, :2] - 0.5) < 0.3).all(axis=1))
    points = np.random.default_rng(seed).choice(inner, size=4, replace=False)
    assert_valid_design(square, nicmm.design_curve(square, points, order="shortest"))


@pytest.mark.slow
def test_memory_follows_the_vertices():
    """Each further vertex takes less than a kilobyte."""

    def peak_on(mesh):
        tracemalloc.start()
        try:
            nicmm.design_curve(mesh, chosen_on(mesh, 4), order="shortest")
            return tracemalloc.get_traced_memory()[1]
        finally:
            tracemalloc.stop()

    small, large = shapes.sphere(5), shapes.sphere(6)
    further = len(large.vertices) - len(small.vertices)
    assert peak_on(large) - peak_on(small) < 1_000 * further


@pytest.mark.slow
def test_a_second_curve_uses_the_same_cells(large, monkeypatch):
    made = []
    build = coarse_start.build_coarse_mesh
    monkeypatch.setattr(
        coarse_start, "build_coarse_mesh", lambda *given: made.append(given) or build(*given)
    )
    designer = nicmm.Designer(large)
    for seed in range(3):
        assert_valid_design(large, designer.design(chosen_on(large, 4, seed), order="shortest"))
    assert len(made) == 1


@pytest.mark.slow
def test_it_is_about_the_curve_without_a_coarse_mesh(monkeypatch):
    mesh = shapes.sphere(5)
    chosen = chosen_on(mesh, 4)
    by_cells = nicmm.design_curve(mesh, chosen, order="shortest").curves[0]
    monkeypatch.setattr(coarse_start, "SMALL", 10**9)
    monkeypatch.setattr(coarse_start, "LARGE", 10**9)
    directly = nicmm.design_curve(mesh, chosen, order="shortest").curves[0]
    apart, _ = cKDTree(directly.points).query(by_cells.points)
    assert 0.0 < apart.max() < 0.02
    assert by_cells.length == pytest.approx(directly.length, rel=2e-3)


@pytest.mark.slow
def test_points_in_one_cell_are_told_apart(large):
    # A vertex and two of its neighbours; the cells are much larger.
    around = np.unique(large.faces[large.vertex_faces[[1000]].indices])
    design = nicmm.design_curve(large, around[:3])
    assert_valid_design(large, design)


@pytest.mark.slow
def test_given_order_and_via_points_hold_on_large_meshes():
    ring = shapes.torus(around=240, across=120)
    # Three points on the outside of a torus; the via point is on the outside of its far side.
    angle = np.arctan2(ring.vertices[:, 1], ring.vertices[:, 0])
    outside = np.linalg.norm(ring.vertices[:, :2], axis=1) > 1.39
    at = [int(np.flatnonzero(outside)[np.abs(angle[outside] - a).argmin()]) for a in (0, 0.5, 1.0)]
    back = int(np.flatnonzero(outside)[np.abs(angle[outside] - 4.0 + 2 * np.pi).argmin()])
    short = nicmm.design_curve(ring, at)
    long = nicmm.design_curve(ring, at, via_points={2: [back]})
    assert_valid_design(ring, long)

    def away(design):
        """Distance of the via point from a curve, relative to the diagonal."""
        to_points = np.linalg.norm(design.curves[0].points - ring.vertices[back], axis=1)
        return to_points.min() / ring.diagonal

    assert away(long) < 0.02 < 0.1 < away(short)


@pytest.mark.slow
def test_maps_reach_the_coarse_mesh(large):
    chosen = chosen_on(large, 4, seed=3)
    free = nicmm.design_curve(large, chosen, order="shortest")
    curve = free.curves[0]
    middle = curve.points[(curve.control_index[0] + curve.control_index[1]) // 2]
    away = np.linalg.norm(large.vertices - middle, axis=1)
    obstacles = (away < 0.05 * large.diagonal).astype(float)
    guided = nicmm.design_curve(large, chosen, order="shortest", obstacles=obstacles)
    assert_valid_design(large, guided)

    def inside(one):
        weight = obstacles[large.faces[one.faces]] * one.barycentric
        return float((weight.sum(axis=1) > 0.5).mean())

    assert inside(guided.curves[0]) < 0.3 * inside(curve)
