"""Tests that divisions of straight edges are undone, and that points and curves find back."""

import numpy as np
import pytest

import nicmm_core as nicmm
from nicmm_core import shapes
from nicmm_core.geometry.surface_points import nearest_points
from nicmm_core.repair.clean_surface import Cleaning, clean_surface
from nicmm_core.repair.nonmanifold import manifold
from nicmm_core.repair.straight_edges import straightened
from tests.core.checks import curve_through, grid, random_surface_points
from tests.oracles import same_surface
from tests.oracles.checker import judge_curve
from tests.oracles.defects import defective_meshes


@pytest.fixture(params=["faces without area", "T-junctions", "fans"])
def straight(request):
    if request.param == "fans":
        mesh = dict(defective_meshes())["fans without area"]
    else:
        mesh = same_surface.changed(shapes.sphere(3), request.param, 2).mesh
    mapped = manifold(clean_surface(mesh, Cleaning.FULL), np.arange(len(mesh.faces)), False)
    return straightened(mapped.mesh, mapped.divisions)


def test_the_result_is_the_mesh_without_divisions(straight):
    assert len(straight.mesh.faces) == len(shapes.sphere(3).faces)
    np.testing.assert_allclose(
        straight.mesh.face_areas.sum(), straight.original.face_areas.sum(), rtol=1e-9
    )


def test_corners_of_parts_lie_at_their_vertices(straight):
    there = np.einsum(
        "fcd,fdk->fck",
        straight.corners,
        straight.mesh.vertices[straight.mesh.faces[straight.parent]],
    )
    given = straight.original.vertices[straight.original.faces]
    np.testing.assert_allclose(there, given, atol=1e-12)


def test_points_keep_their_positions(straight):
    points = random_surface_points(straight.original, 300, seed=4)
    moved = straight.points_to(points)
    np.testing.assert_allclose(
        moved.positions(straight.mesh), points.positions(straight.original), atol=1e-12
    )


def test_curves_keep_their_course_and_find_back(straight):
    angles = np.linspace(0.0, 2.0 * np.pi, 40, endpoint=False)
    circle = np.stack([np.cos(angles), np.sin(angles), 0.1 * np.sin(3 * angles)], axis=1)
    divided = straight.original.faces[np.bincount(straight.parent)[straight.parent] > 1][0]
    # The circle passes through a divided face.
    first, second = straight.original.vertices[divided][:2] * [[0.9], [1.0]]
    second = second - first * (first @ second) / (first @ first)
    tip = np.cross(first, second)
    axes = np.stack([each / np.linalg.norm(each) for each in (first, second, tip)])
    circle = circle @ axes / np.linalg.norm(circle, axis=1, keepdims=True)
    curve = curve_through(straight.mesh, circle, [0, 10, 20])
    back = straight.curve_back(curve)
    assert not judge_curve(straight.original, back).faults
    assert len(back.points) > len(curve.points)
    np.testing.assert_allclose(
        back.points[back.control_index], curve.points[curve.control_index], atol=1e-9
    )
    assert abs(back.length - curve.length) < 1e-9
    again = straight.curve_to(back)
    np.testing.assert_allclose(again.points, back.points, atol=1e-9)


def test_a_field_is_linear_along_divided_edges(straight):
    height = straight.mesh.vertices[:, 1].copy()
    height[~straight.mesh.referenced] = 100.0
    there = straight.field_back(height)
    used = straight.original.referenced
    np.testing.assert_allclose(there[used], straight.original.vertices[used, 1], atol=1e-12)


def test_vertices_of_regular_meshes_stay():
    """The vertex of a grid lies straight between its neighbours, but no division put it there."""
    mesh = grid(4)
    assert straightened(mesh, np.zeros((0, 3), dtype=np.int64)) is None


def test_a_vertex_with_other_faces_stays():
    """A vertex on a straight edge, with three faces on one side of it."""
    mesh = nicmm.Mesh(
        [[0, 0, 0], [1, 0, 0], [2, 0, 0], [1, -1, 0], [0.5, 1, 0], [1.5, 1, 0]],
        [[0, 3, 1], [1, 3, 2], [0, 1, 4], [4, 1, 5], [1, 2, 5]],
    )
    assert straightened(mesh, np.array([[1, 0, 2]])) is None
    on_mesh, away = nearest_points(mesh, mesh.vertices[[1]])
    assert away[0] < 1e-12 and on_mesh.faces[0] >= 0
