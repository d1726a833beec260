"""Tests of the input channels of the network and of the feature map."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import nicmm_core as nicmm
from nicmm_core.geometry.surface_points import locate_control_points
from nicmm_core.maps.guidance import BASELINE
from nicmm_core.paper.problem import build_problem
from tests.core.checks import random_surface_points


def pairwise_distances(points):
    """Distances between the first 60 points, enough to determine a shape."""
    return np.linalg.norm(points[:60, None] - points[None, :60], axis=2)


def test_indicator_is_one_at_the_control_points_and_small_elsewhere(ball):
    points = random_surface_points(ball, 4, seed=0)
    problem = build_problem(ball, points)
    indicator = problem.features[:, 6]
    controls = problem.loop.control_vertices
    np.testing.assert_allclose(indicator[controls], 1.0, rtol=0, atol=1e-9)
    offset = problem.working.vertices[:, None] - problem.working.vertices[controls]
    far = np.linalg.norm(offset, axis=2).min(axis=1) > 0.8
    assert far.sum() > 20
    assert np.abs(indicator[far]).max() < 0.2


@pytest.mark.slow
def test_channels_are_position_normal_indicator_and_distance(body):
    points = locate_control_points(body, [3, 50, 200, 333], closed=True)
    problem = build_problem(body, points, order="shortest")
    working = problem.working
    assert problem.features.shape == (len(working.vertices), 8)
    assert np.isfinite(problem.features).all()
    position, normal = problem.features[:, :3], problem.features[:, 3:6]
    # Positions keep their shape; the unit is the square root of the area, the origin the centroid.
    unit = np.sqrt(working.face_areas.sum())
    np.testing.assert_allclose(
        pairwise_distances(unit * position), pairwise_distances(working.vertices), atol=1e-9
    )
    centroid = working.face_areas @ position[working.faces].mean(axis=1)
    np.testing.assert_allclose(centroid, 0.0, atol=1e-9)
    # Normals match the positions and point outwards.
    np.testing.assert_allclose(np.linalg.norm(normal, axis=1), 1.0)
    corner = position[working.faces]
    across = np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0])
    assert ((across * normal[working.faces[:, 0]]).sum(axis=1) > 0).mean() > 0.95
    np.testing.assert_array_equal(problem.features[:, 7], problem.initial_distance)


@pytest.mark.slow
def test_maps_add_a_ninth_channel(small_ball):
    points = locate_control_points(small_ball, [3, 50, 120], closed=True)
    zeros = np.zeros(len(small_ball.vertices))
    for maps in ({"obstacles": zeros}, {"alignment": zeros}):
        problem = build_problem(small_ball, points, **maps)
        assert problem.features.shape[1] == 9
        np.testing.assert_array_equal(problem.features[:, 8], problem.feature_map)
        np.testing.assert_array_equal(problem.feature_map, BASELINE)


@pytest.mark.slow
def test_map_weights_are_interpolated_at_inserted_points(small_ball):
    """A control point in a face with three painted vertices is painted itself."""
    weights = np.zeros(len(small_ball.vertices))
    weights[small_ball.faces[10]] = 1.0
    points = random_surface_points(small_ball, 3, seed=0)
    points.faces[1] = 10
    problem = build_problem(small_ball, points, order="shortest", obstacles=weights)
    where = np.flatnonzero(problem.loop.order == 1)[0]
    at_point = problem.feature_map[problem.loop.control_vertices[where]]
    assert at_point == pytest.approx(problem.feature_map.max())


@pytest.mark.slow
def test_turned_and_moved_surface_has_the_same_positions_and_normals(body):
    """At input vertices; not on a ball or similar shapes, whose principal axes are undetermined."""
    points = locate_control_points(body, [3, 50, 200, 333], closed=True)
    turn = Rotation.from_rotvec([0.4, -1.1, 0.7])
    moved = nicmm.Mesh(turn.apply(body.vertices.copy()) + [3.0, 1.0, -2.0], body.faces)
    channels = []
    for mesh in (body, moved):
        problem = build_problem(mesh, points, "shortest")
        inputs = problem.working.input_vertex
        channels.append(problem.features[np.argsort(inputs)[(inputs < 0).sum() :], :6])
    assert len(channels[0]) == len(body.vertices)
    np.testing.assert_allclose(channels[1], channels[0], rtol=0, atol=1e-8)
