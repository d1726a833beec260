"""Tests `feasibility`, which decides independently of the core whether a curve exists."""

import numpy as np
import pytest

import nicmm_core as nicmm
from nicmm_core import shapes
from nicmm_core.geometry.surface_points import locate_points
from tests.oracles.defects import defective_meshes
from tests.oracles.feasibility import (
    edge_connected_parts,
    every_order_possible,
    usable_faces,
    why_impossible,
)

MESHES = dict(defective_meshes())


def why(mesh, vertices, obstacles=None):
    return why_impossible(mesh, at(mesh, vertices), obstacles)


def at(mesh, vertices):
    return locate_points(mesh, np.asarray(vertices), "points")


def test_components():
    mesh = MESHES["components"]
    assert "different parts" in why(mesh, [0, len(mesh.vertices) - 1])
    assert why(mesh, [0, 1, 2]) == ""


def test_triangles_that_share_no_vertices_are_joined_by_their_places():
    assert len(np.unique(edge_connected_parts(MESHES["soup"]))) == 1
    assert len(np.unique(edge_connected_parts(MESHES["touching boxes"]))) == 2


def test_one_common_vertex_joins_nothing():
    mesh = MESHES["hour glass"]
    shared = np.flatnonzero(np.bincount(mesh.faces.ravel()) > 6)[-1]
    assert why(mesh, [0, len(mesh.vertices) - 1])
    assert why(mesh, [0, shared]) == ""
    assert why(mesh, [shared, len(mesh.vertices) - 1]) == ""


def test_sheets_are_joined_by_their_common_edge():
    mesh = MESHES["three sheets along an edge"]
    assert why(mesh, np.arange(0, len(mesh.vertices), 20)) == ""


def test_two_points_at_one_place():
    mesh = MESHES["seam"]
    half = len(mesh.vertices) // 2
    on_both = np.flatnonzero(mesh.referenced[:half] & mesh.referenced[half:])
    assert "one place" in why(mesh, [on_both[0], on_both[0] + half])


def test_obstacles_enclose_and_separate():
    ball = shapes.sphere(3)
    height = ball.vertices[:, 2]
    top, bottom = int(height.argmax()), int(height.argmin())
    beside = int(np.abs(height).argmin())
    belt = (np.abs(height) < 0.3).astype(float)
    assert "inside an obstacle" in why(ball, [top, beside], belt)
    assert "different parts" in why(ball, [top, bottom], belt)
    assert why(ball, [top, bottom], 0.9 * belt) == ""
    assert usable_faces(ball, None).all() and not usable_faces(ball, belt).all()


@pytest.mark.parametrize(("count", "possible"), [(3, True), (4, False)])
def test_orders_of_points_on_the_boundary(count, possible):
    disc = shapes.disc(4)
    radius = np.linalg.norm(disc.vertices, axis=1)
    rim = np.flatnonzero(radius > 0.99)[:: 24 // 5][:count]
    inside = np.flatnonzero(radius < 0.6)[:6]
    assert every_order_possible(disc, at(disc, np.concatenate([rim, inside]))) == possible


def test_twins_of_a_face_do_not_close_a_surface():
    corner = nicmm.Mesh(np.eye(3), [[0, 1, 2], [1, 0, 2]])
    middle = nicmm.SurfacePoints(np.zeros(4, int), np.tile([[0.5, 0.5, 0.0]], (4, 1)))
    assert not every_order_possible(corner, middle)
    assert not every_order_possible(corner, at(corner, [0, 1, 2, 0]))
