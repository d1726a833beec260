"""Tests that the dual of Voronoi cells is a mesh of the same surface, for any fine mesh."""

import numpy as np
import pytest

import nicmm_core as nicmm
from nicmm_core import shapes
from nicmm_core.coarsening.coarse_mesh import build_coarse_mesh
from nicmm_core.geometry.mesh import unique_edges
from nicmm_core.geometry.normals import unsigned_normals
from nicmm_core.geometry.surface_points import SurfacePoints
from nicmm_core.paper.finite_elements import build_finite_elements
from tests.core.checks import euler_characteristic, grid


def coarse_mesh(mesh, count):
    return build_coarse_mesh(mesh, unsigned_normals(mesh), count)


@pytest.mark.parametrize(
    ("mesh", "characteristic"),
    [
        (shapes.sphere(5), 2),
        (shapes.torus(around=120, across=60), 0),
        (shapes.double_torus(subdivisions=3), -2),
        (shapes.creature(2, faces=200, subdivisions=3), 2),
    ],
    ids=["sphere", "torus", "double torus", "creature"],
)
def test_closed_surfaces_keep_their_topology(mesh, characteristic):
    coarse = coarse_mesh(mesh, 800).mesh
    _, count = unique_edges(coarse.faces)
    assert (count == 2).all()
    assert euler_characteristic(coarse.faces) == characteristic
    assert len(coarse.vertices) < len(mesh.vertices) / 3


def test_a_disc_stays_a_disc(flat_disc):
    coarse = coarse_mesh(shapes.disc(60), 500).mesh
    assert euler_characteristic(coarse.faces) == 1


@pytest.mark.parametrize("origin", [0.0, 1e4])
def test_on_a_square_grid_three_seeds_in_a_row_are_a_face_with_area(origin):
    """On a face without area gradients would not be finite."""
    square = grid(63)
    square = nicmm.Mesh(square.vertices + origin, square.faces)
    coarse = coarse_mesh(square, 2048)
    corners = square.vertices[coarse.seed][coarse.mesh.faces]
    sides = corners[:, 1:] - corners[:, :1]
    without = np.linalg.norm(np.cross(sides[:, 0], sides[:, 1]), axis=1) < 1e-9
    assert without.any()
    moved = np.linalg.norm(coarse.mesh.vertices - square.vertices[coarse.seed], axis=1)
    assert 0.0 < moved.max() < 1e-2 * coarse.mesh.mean_edge_length
    fields = build_finite_elements(
        coarse.mesh.vertices, coarse.mesh.faces, np.zeros(len(coarse.seed), dtype=bool)
    )
    assert np.isfinite(fields.gradient.data).all()


def test_cells_cover_the_mesh_and_belong_to_their_seeds():
    ball = shapes.sphere(4)
    mesh = nicmm.Mesh(np.append(ball.vertices, [[2.0, 0.0, 0.0]], axis=0), ball.faces)
    coarse = coarse_mesh(mesh, 300)
    assert (coarse.cell[:-1] >= 0).all()
    assert coarse.cell[-1] == -1  # no face has this vertex
    assert (coarse.cell[coarse.seed] == np.arange(len(coarse.seed))).all()
    assert (coarse.mesh.vertices == mesh.vertices[coarse.seed]).all()


def test_two_sides_of_a_plate_have_cells_of_their_own():
    flat = shapes.sphere(5)
    plate = nicmm.Mesh(flat.vertices * [1.0, 1.0, 0.002], flat.faces)
    coarse = coarse_mesh(plate, 300)
    assert euler_characteristic(coarse.mesh.faces) == 2
    # No cell extends through the plate: except at the rim, its vertices lie on the seed's side.
    middle = np.linalg.norm(plate.vertices[:, :2], axis=1) < 0.8
    sides = np.sign(plate.vertices[:, 2])
    assert (sides[middle] == sides[coarse.seed[coarse.cell[middle]]]).all()


def test_needles_do_not_spoil_the_cells(ball):
    generator = np.random.default_rng(0)
    fine = shapes.sphere(5)
    shifted = fine.vertices + generator.normal(scale=0.008, size=fine.vertices.shape)
    rough = nicmm.Mesh(shifted / np.linalg.norm(shifted, axis=1, keepdims=True), fine.faces)
    coarse = coarse_mesh(rough, 400).mesh
    corner = coarse.vertices[coarse.faces]
    sides = np.linalg.norm(corner - np.roll(corner, 1, axis=1), axis=2)
    height = 2.0 * coarse.face_areas / sides.max(axis=1)
    assert (height / sides.max(axis=1)).min() > 0.15
    assert euler_characteristic(coarse.faces) == 2


def test_same_mesh_same_cells():
    mesh = shapes.sphere(4)
    one, other = (coarse_mesh(mesh, 200) for _ in range(2))
    assert np.array_equal(one.seed, other.seed)
    assert np.array_equal(one.mesh.faces, other.mesh.faces)


def test_values_in_cells_keep_the_greatest():
    mesh = shapes.sphere(4)
    coarse = coarse_mesh(mesh, 200)
    values = np.random.default_rng(1).random(len(mesh.vertices))
    greatest = coarse.greatest_in_cells(values)
    for vertex in (0, 7, 50):
        assert greatest[vertex] == values[coarse.cell == vertex].max()


def test_points_are_found_in_their_cells():
    mesh = shapes.sphere(5)
    coarse = coarse_mesh(mesh, 500)
    chosen = np.random.default_rng(0).choice(len(mesh.faces), size=20, replace=False)
    points = SurfacePoints(chosen, np.full((20, 3), 1.0 / 3.0))
    found = coarse.nearest_points(mesh, points)
    apart = np.linalg.norm(found.positions(coarse.mesh) - points.positions(mesh), axis=1)
    # The height of a spherical cap over a face with sides of about 0.2 radii.
    assert apart.max() < 0.02
    assert found.barycentric.min() >= 0.0
    np.testing.assert_allclose(found.barycentric.sum(axis=1), 1.0)
