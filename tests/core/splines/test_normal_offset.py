"""Tests points that are offset from the surface along interpolated normals."""

import numpy as np
import pytest

import nicmm_core as nicmm
from nicmm_core import shapes
from nicmm_core.splines.normal_offset import offset_points
from tests.core.checks import random_surface_points
from tests.oracles import same_surface


@pytest.mark.parametrize("height", [0.0, 0.05, -0.05])
def test_points_of_a_sphere_move_along_its_radii(ball, height):
    points = random_surface_points(ball, 50, seed=0)
    place = points.positions(ball)
    moved = offset_points(ball, points.faces, points.barycentric, height)
    np.testing.assert_allclose(np.linalg.norm(moved - place, axis=1), abs(height), atol=1e-12)
    radial = place / np.linalg.norm(place, axis=1, keepdims=True)
    np.testing.assert_allclose(moved, place + height * radial, atol=0.02 * abs(height))


def test_height_is_exact_over_a_plane(flat_disc):
    points = random_surface_points(flat_disc, 20, seed=1)
    moved = offset_points(flat_disc, points.faces, points.barycentric, 0.3)
    place = points.positions(flat_disc)
    np.testing.assert_allclose(moved - place, np.tile([0.0, 0.0, 0.3], (20, 1)), atol=1e-12)


def test_direction_is_continuous_over_an_edge():
    """Tested at a point of an edge, given in either of its faces."""
    cube = shapes.cube(2)
    edge, neighbour = 0, 0
    for face in range(len(cube.faces)):
        for side in range(3):
            other = cube.face_neighbours[face, side]
            if cube.face_normals[face] @ cube.face_normals[other] < 0.5:
                edge, neighbour = face, other
                shared = np.delete(cube.faces[face], side)
                break
    seen = [
        offset_points(cube, np.array([face]), (0.5 * np.isin(cube.faces[face], shared))[None], 0.1)
        for face in (edge, neighbour)
    ]
    np.testing.assert_allclose(seen[0], seen[1], atol=1e-12)


def test_face_normal_counts_where_normals_cancel():
    """At a vertex where a sheet is folded flat onto itself."""
    vertices = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [1, 1, 0], [0.5, 1, 0]])
    mesh = nicmm.Mesh(vertices, np.array([[0, 1, 2], [1, 0, 4]]))
    middle = np.full((2, 3), 1.0 / 3.0)
    moved = offset_points(mesh, np.array([0, 1]), middle, 0.1)
    np.testing.assert_allclose(np.abs(moved[:, 2]), 0.1)


@pytest.mark.parametrize("name", ["half of the faces turned", "soup", "turned, doubled soup"])
def test_points_of_a_changed_mesh_move_to_the_same_side(ball, name):
    mesh = same_surface.changed(ball, name, 3).mesh
    points = random_surface_points(mesh, 100, seed=2)
    place = points.positions(mesh)
    moved = offset_points(mesh, points.faces, points.barycentric, 0.1)
    radial = place / np.linalg.norm(place, axis=1, keepdims=True)
    side = np.sign(((moved - place) * radial).sum(axis=1)[0])
    np.testing.assert_allclose(moved, place + 0.1 * side * radial, atol=0.002)


def test_faces_without_area_give_finite_positions():
    vertices = np.array([[0.0, 0, 0], [1, 0, 0], [2, 0, 0], [0, 1, 0]])
    mesh = nicmm.Mesh(vertices, np.array([[0, 1, 2], [0, 2, 3]]))
    flat = offset_points(mesh, np.array([0]), np.array([[0.0, 1.0, 0.0]]), 0.1)
    assert np.isfinite(flat).all()
    assert np.linalg.norm(flat - vertices[1]) <= 0.1 + 1e-12
