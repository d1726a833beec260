"""Tests that divisions of straight edges are undone, and that points and curves find back."""

import numpy as np
import pytest

import nicmm_core as nicmm
from nicmm_core import shapes
from nicmm_core.geometry.surface_points import SurfacePoints, nearest_points
from nicmm_core.repair.clean_surface import clean_surfaces
from nicmm_core.repair.nonmanifold import manifold
from nicmm_core.repair.straight_edges import straightened
from tests.core.checks import curve_through, grid, random_surface_points
from tests.oracles import same_surface
from tests.oracles.checker import judge_curve
from tests.oracles.defects import defective_meshes


@pytest.fixture(params=["faces without area", "T-junctions", "fans"])
def mapped(request):
    if request.param == "fans":
        mesh = dict(defective_meshes())["fans without area"]
    else:
        mesh = same_surface.changed(shapes.sphere(3), request.param, 2).mesh
    return manifold(clean_surfaces(mesh)[0], np.arange(len(mesh.faces)), connected=False)


def test_the_result_is_the_mesh_without_divisions(mapped):
    assert len(mapped.mesh.faces) == len(shapes.sphere(3).faces)
    np.testing.assert_allclose(
        mapped.mesh.face_areas.sum(), mapped.manifold.face_areas.sum(), rtol=1e-9
    )


def test_corners_of_parts_lie_at_their_vertices(mapped):
    parts = mapped.in_mesh
    there = np.einsum(
        "fcd,fdk->fck", parts.corners, mapped.mesh.vertices[mapped.mesh.faces[parts.parent]]
    )
    given = mapped.manifold.vertices[mapped.manifold.faces]
    np.testing.assert_allclose(there, given, atol=1e-12)


def test_points_keep_their_positions(mapped):
    points = random_surface_points(mapped.original, 300, seed=4)
    moved = mapped.points_to(points)
    np.testing.assert_allclose(
        moved.positions(mapped.mesh), points.positions(mapped.original), atol=1e-12
    )


def test_curves_keep_their_course_and_find_back(mapped):
    given, parent = mapped.original, mapped.in_mesh.parent
    angles = np.linspace(0.0, 2.0 * np.pi, 40, endpoint=False)
    circle = np.stack([np.cos(angles), np.sin(angles), 0.1 * np.sin(3 * angles)], axis=1)
    divided = mapped.manifold.faces[np.bincount(parent)[parent] > 1][0]
    # The circle passes through a divided face.
    first, second = mapped.manifold.vertices[divided][:2] * [[0.9], [1.0]]
    second = second - first * (first @ second) / (first @ first)
    tip = np.cross(first, second)
    axes = np.stack([each / np.linalg.norm(each) for each in (first, second, tip)])
    circle = circle @ axes / np.linalg.norm(circle, axis=1, keepdims=True)
    curve = curve_through(mapped.mesh, circle, [0, 10, 20])
    back = mapped.curve_back(curve)
    assert len(back.points) > len(curve.points)
    np.testing.assert_allclose(
        back.points[back.control_index], curve.points[curve.control_index], atol=1e-9
    )
    assert abs(back.length - curve.length) < 1e-9
    exact = SurfacePoints(back.faces, back.barycentric)[back.control_index]
    across = mapped.clean.removed_faces.led_across(back, exact)
    if mapped.clean.removed.any():  # at T-junctions, faces on both sides share no vertices
        assert not judge_curve(given, across).faults
    again = mapped.curve_to(across)
    np.testing.assert_allclose(
        again.points[again.control_index], curve.points[curve.control_index], atol=1e-6
    )
    assert abs(again.length - curve.length) < 1e-6


def test_a_field_is_linear_along_divided_edges(mapped):
    height = mapped.mesh.vertices[:, 1].copy()
    height[~mapped.mesh.referenced] = 100.0
    np.testing.assert_allclose(
        mapped.field_back(height), mapped.original.vertices[:, 1], atol=1e-12
    )


def test_vertices_of_regular_meshes_stay():
    """The vertex of a grid lies straight between its neighbours, but no division put it there."""
    mesh = grid(4)
    assert straightened(mesh, np.zeros((0, 3), dtype=np.int64))[0] is mesh


def test_a_vertex_with_other_faces_stays():
    """A vertex on a straight edge, with three faces on one side of it."""
    mesh = nicmm.Mesh(
        [[0, 0, 0], [1, 0, 0], [2, 0, 0], [1, -1, 0], [0.5, 1, 0], [1.5, 1, 0]],
        [[0, 3, 1], [1, 3, 2], [0, 1, 4], [4, 1, 5], [1, 2, 5]],
    )
    assert straightened(mesh, np.array([[1, 0, 2]]))[0] is mesh
    on_mesh, away = nearest_points(mesh, mesh.vertices[[1]])
    assert away[0] < 1e-12 and on_mesh.faces[0] >= 0
