"""Tests of control points in all accepted forms, and of all errors in them."""

import warnings

import numpy as np
import pytest

import nicmm_core as nicmm
from nicmm_core.geometry.surface_points import (
    first_hits,
    locate_control_points,
    locate_points,
    nearest_points,
    weights_at,
)
from tests.core.checks import assert_valid_curve, joined, random_surface_points

SurfacePoints = nicmm.SurfacePoints


def at_corner(mesh, vertices):
    """Vertices as surface points, each in one of its faces."""
    faces, corner = zip(*(np.argwhere(mesh.faces == v)[-1] for v in vertices), strict=True)
    return SurfacePoints(np.array(faces), np.eye(3)[list(corner)])


def test_vertices_positions_and_surface_points_agree(surface):
    chosen = np.random.default_rng(4).choice(len(surface.vertices), size=5, replace=False)
    expected = surface.vertices[chosen]
    for form in (chosen, chosen.tolist(), expected, at_corner(surface, chosen)):
        found = locate_control_points(surface, form, closed=True)
        np.testing.assert_allclose(found.positions(surface), expected, rtol=0, atol=1e-12)
        assert ((found.barycentric == 0.0).sum(axis=1) == 2).all()


def test_points_in_space_find_their_faces(surface):
    points = random_surface_points(surface, 6, seed=5)
    found = locate_control_points(surface, points.positions(surface), closed=True)
    np.testing.assert_array_equal(found.faces, points.faces)
    np.testing.assert_allclose(found.barycentric, points.barycentric, rtol=0, atol=1e-9)


def test_points_slightly_off_the_surface_are_projected(ball):
    centroids = ball.vertices[ball.faces[[3, 300, 900]]].mean(axis=1)
    found = locate_control_points(ball, centroids * (1 + 1e-5), closed=True)
    np.testing.assert_allclose(found.positions(ball), centroids, rtol=0, atol=1e-6)


def test_integers_in_three_columns_are_positions():
    mesh = nicmm.Mesh([[0, 0, 0], [2, 0, 0], [0, 2, 0]], [[0, 1, 2]])
    found = locate_control_points(mesh, [[0, 0, 0], [1, 0, 0], [0, 1, 0]], closed=True)
    np.testing.assert_allclose(found.positions(mesh)[1], [1, 0, 0], atol=1e-12)


def test_nearest_points_in_a_face_without_area_are_on_its_longest_edge():
    vertices = [[0, 0, 0], [3, 0, 0], [1, 0, 0], [0, 5, 5], [1, 5, 5]]
    mesh = nicmm.Mesh(vertices, [[2, 0, 1], [0, 3, 4]])
    positions = np.array([[2.5, 0.2, 0.0], [-1.0, 0.0, 0.0], [1.0, -0.1, 0.0]])
    for among in (None, np.array([0])):
        found, distance = nearest_points(mesh, positions, among)
        np.testing.assert_allclose(found.barycentric.sum(axis=1), 1.0, rtol=0, atol=1e-15)
        assert (found.barycentric >= 0.0).all()
        expected = [[2.5, 0, 0], [0, 0, 0], [1, 0, 0]]
        np.testing.assert_allclose(found.positions(mesh), expected, atol=1e-12)
        np.testing.assert_allclose(distance, [0.2, 1.0, 0.1], atol=1e-12)


def test_distances_whose_squares_overflow_are_infinite(ball):
    """Callers inside the package compare them with a tolerance, and name the argument."""
    _, distance = nearest_points(ball, np.array([[1e200, 0.0, 0.0]]))
    assert distance[0] == np.inf


def test_measured_positions_become_control_points(ball):
    directions = np.array([[0.0, 0.3, 1.0], [1.0, 0.1, -0.2], [-0.5, 1.0, -0.4]])
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    points, distances = nicmm.nearest_points(ball, (2.0 * directions).tolist())
    np.testing.assert_allclose(points.positions(ball), directions, atol=0.03)
    np.testing.assert_allclose(distances, 1.0, rtol=0.02)
    assert_valid_curve(ball, nicmm.design_curve(ball, points).curves[0], points.positions(ball))


@pytest.mark.parametrize(
    ("positions", "message"),
    [
        ([0.0, 1.0, 2.0], r"positions has shape \(3,\); pass three numbers per position"),
        ([["x", "y", "z"]], "positions cannot be read as numbers"),
        ([[0, 0, 0], [0, np.nan, 0]], r"positions\[1\] is NaN or infinite"),
        ([[0, 0, 0], [1e200, 0, 0]], r"positions\[1\] is too far from the mesh"),
    ],
)
def test_bad_positions_are_refused_by_name(ball, positions, message):
    with pytest.raises(nicmm.ArgumentError, match=message):
        nicmm.nearest_points(ball, positions)


def test_coordinates_near_zero_snap_to_edges_and_vertices(ball):
    nearly = np.array([[1.0, 1e-8, 0.0], [0.5, 0.5, 1e-8], [0.3, 0.3, 0.4]])
    nearly /= nearly.sum(axis=1, keepdims=True)
    found = locate_control_points(ball, SurfacePoints(np.array([0, 400, 800]), nearly), closed=True)
    np.testing.assert_array_equal(found.barycentric[0], [1.0, 0.0, 0.0])
    assert found.barycentric[1, 2] == 0.0
    assert (found.barycentric[2] > 0.0).all()
    np.testing.assert_allclose(found.barycentric.sum(axis=1), 1.0, rtol=0, atol=1e-15)


THIRDS = np.full((3, 3), 1 / 3)

BAD_POINTS = {
    "none at all": ([], "control_points has 0 points"),
    "one": ([5], "control_points has 1 point, too few"),
    "two": ([5, 9], "control_points has 2 points"),
    "past the end": ([5, 9, 642], r"control_points\[2\] = 642"),
    "negative": ([5, -1, 9], r"control_points\[1\] = -1"),
    "repeated vertex": ([5, 9, 5], r"control_points\[0\] and control_points\[2\]"),
    "fractional indices": ([0.5, 1.5, 2.5], "control_points has shape"),
    "text": (["a", "b", "c"], "control_points has shape"),
    "none": (None, "control_points has shape"),
    "booleans": ([True, False, True], "control_points has shape"),
    "two columns": (np.zeros((4, 2)), "control_points has shape"),
    "ragged": ([[0, 0, 1], [0, 1]], "control_points"),
    "complex positions": (np.ones((3, 3)) * 1j, "control_points"),
    "NaN position": ([[1, 0, 0], [0, np.nan, 0], [0, 0, 1]], r"control_points\[1\]"),
    "infinite position": ([[1, 0, 0], [0, 1, 0], [0, 0, np.inf]], r"control_points\[2\]"),
    "off the surface": ([[1, 0, 0], [0, 1, 0], [0, 0, 1.1]], r"control_points\[2\] is off"),
    "face past the end": (SurfacePoints(np.array([0, 5, 1280]), THIRDS), r"faces\[2\] = 1280"),
    "negative face": (SurfacePoints(np.array([0, -5, 9]), THIRDS), r"faces\[1\] = -5"),
    "float faces": (SurfacePoints(np.array([0.0, 5.0, 9.0]), THIRDS), "control_points.faces"),
    "faces in two dimensions": (SurfacePoints(np.zeros((3, 1), int), THIRDS), "faces has shape"),
    "too few rows": (SurfacePoints(np.array([0, 5, 9]), THIRDS[:2]), "barycentric has shape"),
    "negative weight": (
        SurfacePoints(np.array([0, 5, 9]), np.array([[1, 0, 0], [1.2, -0.2, 0], [0, 0, 1.0]])),
        r"barycentric\[1\]",
    ),
    "sum not one": (SurfacePoints(np.array([0, 5, 9]), 1.1 * THIRDS), r"barycentric\[0\]"),
    "NaN weight": (SurfacePoints(np.array([0, 5, 9]), np.nan * THIRDS), r"barycentric\[0\]"),
    "text weights": (SurfacePoints(np.array([0, 5, 9]), "abc"), "control_points"),
}


@pytest.mark.parametrize(("points", "message"), BAD_POINTS.values(), ids=BAD_POINTS.keys())
def test_bad_control_points_are_refused_by_name(ball, points, message):
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        with pytest.raises(nicmm.ControlPointError, match=message):
            locate_control_points(ball, points, closed=True)


def test_open_curves_need_two_points(ball):
    assert len(locate_control_points(ball, [5, 9], closed=False)) == 2
    with pytest.raises(nicmm.ControlPointError, match="control_points has 1 point, too few"):
        locate_control_points(ball, [5], closed=False)


def test_the_same_point_named_from_two_faces_is_a_repetition(ball):
    first, second = np.argwhere(ball.faces == 17)[:2]
    points = SurfacePoints(
        np.array([first[0], 700, second[0]]), np.eye(3)[[first[1], 0, second[1]]]
    )
    with pytest.raises(nicmm.ControlPointError, match="same point"):
        locate_control_points(ball, points, closed=True)


def test_vertex_without_a_face_is_off_the_surface():
    mesh = nicmm.Mesh(np.eye(4, 3), [[0, 1, 2]])
    with pytest.raises(nicmm.ControlPointError, match=r"control_points\[1\] = 3"):
        locate_control_points(mesh, [0, 3, 1], closed=True)


def test_points_on_two_components_are_unreachable(small_ball, ring):
    mesh = joined(small_ball, ring)
    with pytest.raises(nicmm.UnreachableError, match=r"control_points\[0\].*control_points\[2\]"):
        locate_control_points(mesh, [3, 7, len(small_ball.vertices) + 1], closed=True)


def test_point_in_a_face_without_area_is_refused_or_placed():
    # The second face has no area and lies along an edge of the first.
    mesh = nicmm.Mesh([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0.5, 0, 0]], [[0, 1, 2], [0, 3, 1]])
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        try:
            found = locate_control_points(
                mesh, [[0.25, 0, 0], [0.5, 0.25, 0], [0, 0.5, 0]], closed=True
            )
        except nicmm.ControlPointError as error:
            assert "control_points[0]" in str(error)
        else:
            assert np.isfinite(found.barycentric).all()
            np.testing.assert_allclose(found.positions(mesh)[0], [0.25, 0, 0], atol=1e-9)


def test_first_hits_of_rays(ball):
    """Rays from outside, from inside and past the mesh; directions need not be unit vectors."""
    origins = np.array([[3.0, 0.1, 0.2], [0.0, 0.0, 0.0], [3.0, 2.0, 0.0]])
    directions = np.array([[-2.0, 0.0, 0.0], [0.1, 0.2, 0.9], [-1.0, 0.0, 0.0]])
    points, along = first_hits(ball, origins, directions)
    np.testing.assert_array_equal(points.faces >= 0, [True, True, False])
    np.testing.assert_array_equal(np.isinf(along), [False, False, True])
    assert along[0] == pytest.approx(1.0, abs=0.05)
    met = origins[:2] + along[:2, None] * directions[:2]
    hit = points[np.arange(2)]
    np.testing.assert_allclose(hit.positions(ball), met, atol=1e-6)
    assert (hit.barycentric >= 0.0).all()
    np.testing.assert_allclose(hit.barycentric.sum(axis=1), 1.0, atol=1e-15)


@pytest.mark.parametrize("away", [0.0, 1.0, 5.0])
@pytest.mark.parametrize("size", [1e-3, 1.0, 1e3])
def test_points_are_the_same_by_position_and_by_coordinates(body, size, away):
    """Also far from the origin, where positions have greater rounding errors."""
    mesh = nicmm.Mesh(size * (body.vertices + away), body.faces)
    generator = np.random.default_rng(1)
    faces = generator.integers(len(mesh.faces), size=200)
    given = SurfacePoints(faces, generator.dirichlet(np.ones(3), 200))
    points = locate_points(mesh, given, "points")
    np.testing.assert_allclose(points.barycentric, given.barycentric, atol=1e-12)
    again = locate_points(mesh, points.positions(mesh), "points")
    np.testing.assert_array_equal(again.faces, points.faces)
    np.testing.assert_array_equal(again.barycentric, points.barycentric)
    assert (points.barycentric.sum(axis=1) == 1.0).all()


def test_weights_with_respect_to_other_vertices_sum_to_one_where_these_repeat():
    """As in a face of which two vertices were joined, which counts as one vertex there."""
    corners = np.array([[4, 7, 9]] * 3)
    weights = np.array([[0.25, 0.75, 0.0], [0.0, 1.0, 0.0], [0.5, 0.0, 0.5]])
    others = np.array([[7, 4, 9], [7, 7, 4], [4, 9, 9]])
    expected = [[0.75, 0.25, 0.0], [1.0, 0.0, 0.0], [0.5, 0.5, 0.0]]
    np.testing.assert_array_equal(weights_at(corners, weights, others), expected)
