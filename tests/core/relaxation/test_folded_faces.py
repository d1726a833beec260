"""Tests faces that are folded back over others, in the plane, where all curves are known."""

import numpy as np
import pytest

import nicmm_core as nicmm
from nicmm_core import shapes
from nicmm_core.geometry.curve import curve_on_mesh
from nicmm_core.geometry.normals import unsigned_normals
from nicmm_core.geometry.tracing import trace_between, trace_from
from nicmm_core.relaxation.curve_nodes import curve_surface
from nicmm_core.relaxation.discrete_curve import place_nodes, traced_through
from nicmm_core.relaxation.elastic_energy import bending_energy
from tests.core.checks import assert_valid_curve, curve_through, flipped, grid, points_near
from tests.oracles.distances import distances
from tests.oracles.named_curves import nearest_vertices
from tests.oracles.perturbation import perturbed
from tests.oracles.reference_energy import moved_along_conormals

CELLS = 16
STEP = 1.0 / CELLS


def folded(mesh: nicmm.Mesh, column: int = 8, by: float = 1.6) -> nicmm.Mesh:
    """A square in which one column of vertices has been pushed beyond the next one."""
    vertices = mesh.vertices.copy()
    vertices[np.isclose(vertices[:, 0], column * STEP), 0] += by * STEP
    return nicmm.Mesh(vertices, mesh.faces)


@pytest.fixture(scope="module")
def square():
    return grid(CELLS)


@pytest.fixture(scope="module")
def surface(square):
    return curve_surface(folded(square))


def straight_across(square, mesh, height=0.53):
    """A straight curve over the same faces as in the square; in the fold it runs backwards."""
    along = np.linspace(0.1, 0.9, 60)
    positions = np.stack([along, np.full(60, height), np.zeros(60)], axis=1)
    curve = curve_through(square, positions, [0, 59], closed=False)
    places = curve.faces, curve.barycentric
    return curve_on_mesh(mesh, False, *places, curve.control_index)


def test_faces_are_folded_back_where_a_column_was_pushed_over_the_next(square, surface):
    middles = square.vertices[square.faces].mean(axis=1)[:, 0]
    np.testing.assert_array_equal(surface.folded, (middles > 8 * STEP) & (middles < 9 * STEP))
    assert curve_surface(square).folded is None


@pytest.mark.parametrize("seed", [0, 1])
def test_no_face_counts_as_folded_where_faces_are_turned_over(seed, ball):
    assert curve_surface(flipped(ball, seed)).folded is None


def test_moving_vertices_within_a_plane_changes_no_normal(square):
    np.testing.assert_allclose(np.abs(unsigned_normals(folded(square))), [[0.0, 0.0, 1.0]] * 17**2)
    disc = shapes.disc(12)
    rim = np.flatnonzero(np.hypot(*disc.vertices[:, :2].T) > 0.99)
    pushed, count = perturbed(disc, 1, np.random.default_rng(3), rim)
    assert count > 100 and (pushed.face_normals[:, 2] < 0.0).any()
    normals = unsigned_normals(pushed)
    np.testing.assert_allclose(normals, [[0.0, 0.0, normals[0, 2]]] * len(normals), atol=1e-9)


@pytest.mark.parametrize("count", [24, 64, 300])
def test_nodes_keep_out_of_a_fold_and_get_on_evenly(square, surface, count):
    curve = straight_across(square, surface.mesh)
    back = np.diff(curve.points[:, 0]) < -1e-12
    assert back.any()
    nodes = place_nodes(surface, curve, count).nodes
    step = np.diff(nodes.positions[:, 0])
    np.testing.assert_allclose(step, (curve.points[-1] - curve.points[0])[0] / count, rtol=1e-4)
    assert not surface.folded[nodes.places.faces].any()
    assert bending_energy(nodes) < 1e-6


def test_without_a_fold_nodes_are_at_equal_distances(square):
    surface = curve_surface(square)
    nodes = place_nodes(surface, straight_across(square, square), 64).nodes
    np.testing.assert_allclose(nodes.lengths, nodes.lengths.mean(), rtol=1e-4)


def test_a_trace_over_a_fold_stays_straight(square, surface):
    curve = place_nodes(surface, straight_across(square, surface.mesh), 64)
    again = traced_through(surface, curve, curve.nodes)
    assert again is not None
    result = again.surface_curve(surface.mesh)
    assert_valid_curve(surface.mesh, result, closed=False)
    np.testing.assert_allclose(result.points[:, 1], 0.53, atol=1e-6)


def test_a_long_way_without_folds_is_lost_though_the_mesh_has_some():
    """Longer traces are accepted only over folds, and not around the rim of a sheet."""
    plate = shapes.cube(8)
    low = plate.vertices * [1.0, 1.0, 0.01]
    mesh = nicmm.Mesh(low, plate.faces)
    points = points_near(mesh, [[0.3, 0.0, 0.005], [0.3, 0.0, -0.005]])
    start, end = (nicmm.SurfacePoints(points.faces[[k]], points.barycentric[[k]]) for k in (0, 1))
    plane = np.array([[0.0, 0.0, 1.0]])
    none = np.zeros(len(mesh.faces), dtype=bool)
    assert not trace_between(mesh, start, end, plane, np.array([0.015]), none).reached.any()


@pytest.mark.parametrize("distance", [0.5, 1.0, 2.5, 4.0])
def test_a_move_that_comes_to_a_fold_ends_behind_it(surface, distance):
    """Points move by the same distance in space as they would without the fold."""
    mesh = surface.mesh
    height = np.linspace(0.2, 0.8, 9)
    start = points_near(mesh, np.stack([np.full(9, 0.45), height, 0.0 * height], axis=1))
    before = start.positions(mesh)
    direction = np.tile([1.0, 0.0, 0.0], (9, 1))
    length = np.full(9, distance * STEP)
    ends, blocked, _ = trace_from(mesh, start, direction, length, surface.folded)
    assert not blocked.any()
    np.testing.assert_allclose(
        ends.positions(mesh) - before, direction * length[:, None], atol=1e-5
    )
    assert not surface.folded[ends.faces].any()


def test_a_move_over_a_fold_can_be_undone(square, surface):
    nodes = place_nodes(surface, straight_across(square, surface.mesh), 64).nodes
    step = np.full(len(nodes.positions), 0.7 * STEP)
    step[[0, -1]] = 0.0
    there = moved_along_conormals(surface, nodes, step)
    back = moved_along_conormals(surface, there, -step)
    np.testing.assert_allclose(back.positions[2:-2], nodes.positions[2:-2], atol=1e-3 * STEP)


@pytest.mark.slow
@pytest.mark.parametrize("rings", [16, 32])
@pytest.mark.parametrize("seed", range(2))
def test_on_a_degraded_disc_it_is_the_curve_of_the_clean_one(rings, seed):
    """Displacing vertices within a plane, even across edges, does not change the surface."""
    clean = shapes.disc(rings)
    generator = np.random.default_rng(seed)
    angles = np.array([0.0, 1.5, 3.1, 4.6]) + generator.uniform(-0.3, 0.3, 4)
    radii = generator.uniform(0.4, 0.6, 4)
    places = radii[:, None] * np.stack([np.cos(angles), np.sin(angles), 0 * angles], axis=1)
    points = nearest_vertices(clean, places)
    rim = np.flatnonzero(np.hypot(*clean.vertices[:, :2].T) > 0.99)
    degraded, _ = perturbed(clean, 1, generator, np.concatenate([points, rim]))
    assert (degraded.face_normals[:, 2] < 0.0).any()
    one, other = (nicmm.design_curve(mesh, points) for mesh in (clean, degraded))
    assert other.energy["smooth"] == pytest.approx(one.energy["smooth"], rel=0.01)
    mean, _ = distances(other.curves[0], one.curves[0])
    assert mean < 3e-3 * clean.diagonal
    assert_valid_curve(degraded, other.curves[0], degraded.vertices[points])
