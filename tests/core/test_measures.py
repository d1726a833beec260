"""Tests measures of curves against closed forms."""

import numpy as np
import pytest

import nicmm_core as nicmm
from nicmm_core import shapes
from nicmm_core.geometry.surface_points import nearest_points
from nicmm_core.measures import curvature_samples
from tests.core.checks import circle, random_surface_points

LATITUDE = 0.6


def parallel(mesh):
    """A circle of latitude of the unit sphere, as an offset of the equator."""
    angle = np.linspace(0.0, 2.0 * np.pi, 7)[:-1]
    places = np.stack([np.cos(angle), np.sin(angle), np.zeros(6)], axis=1)
    equator = nicmm.design_curve(mesh, nearest_points(mesh, places)[0]).curves[0]
    [found] = nicmm.offset_curve(mesh, equator, LATITUDE)
    return equator, found


def flat_circle(mesh, radius=0.5, count=12):
    """A curve through points of a circle in a plane."""
    angle = np.arange(count) * 2.0 * np.pi / count
    return nicmm.design_curve(mesh, nearest_points(mesh, circle(angle, radius))[0]).curves[0]


@pytest.mark.slow
def test_a_spherical_cap_has_its_length_and_area():
    errors = []
    for subdivisions in (4, 5):
        mesh = shapes.sphere(subdivisions)
        _, found = parallel(mesh)
        measures = found.measures(mesh)
        errors.append(
            [
                measures["length"] / (2.0 * np.pi * np.cos(LATITUDE)) - 1.0,
                measures["area"] / (2.0 * np.pi * (1.0 - np.sin(LATITUDE))) - 1.0,
            ]
        )
    errors = np.abs(errors)
    assert (errors[1] < 0.5 * errors[0]).all() and (errors[1] < 1e-3).all()
    assert measures["greatest_slope"] < 0.01


@pytest.mark.slow
def test_a_disc_has_its_length_area_and_radius():
    mesh = shapes.disc(48)
    measures = flat_circle(mesh).measures(mesh)
    assert measures["length"] == pytest.approx(np.pi, rel=1e-3)
    assert measures["area"] == pytest.approx(0.25 * np.pi, rel=1e-3)
    assert measures["least_radius"] == pytest.approx(0.5, rel=0.05)
    assert measures["greatest_slope"] == pytest.approx(0.0, abs=1e-9)


@pytest.mark.slow
@pytest.mark.parametrize("subdivisions", [4, 5])
def test_a_circle_of_latitude_has_its_geodesic_curvature(subdivisions):
    mesh = shapes.sphere(subdivisions)
    equator, found = parallel(mesh)
    curvature = np.abs(curvature_samples(mesh, found).curvature)
    np.testing.assert_allclose(curvature, np.tan(LATITUDE), rtol=0.15)
    assert np.median(curvature) == pytest.approx(np.tan(LATITUDE), rel=0.02)
    assert equator.measures(mesh)["least_radius"] > 20.0


def test_conormals_are_on_the_left_and_curvature_is_positive_there():
    mesh = shapes.disc(24)
    curve = flat_circle(mesh)
    samples = curvature_samples(mesh, curve)
    up = np.sign(mesh.face_normals[0, 2])
    orientation = np.sign(np.cross(samples.points[0], samples.points[1])[2]) * up
    assert (samples.curvature * orientation > 0.0).all()
    inwards = (samples.conormals * -samples.points).sum(axis=1) * orientation
    assert (inwards > 0.0).all()


@pytest.mark.slow
def test_lengths_of_legs_add_up(body):
    for closed in (True, False):
        points = random_surface_points(body, 4, 3)
        curve = nicmm.design_curve(body, points, closed=closed, order="shortest").curves[0]
        measures = curve.measures(body)
        assert len(measures["leg_lengths"]) == 4 - (not closed)
        assert sum(measures["leg_lengths"]) == pytest.approx(measures["length"], rel=1e-12)


def test_an_open_curve_and_one_around_a_tube_enclose_no_area(ring):
    open_curve = nicmm.design_curve(ring, [0, 100], closed=False).curves[0]
    assert open_curve.measures(ring)["area"] is None
    around = nicmm.design_curve(ring, [0, 6, 12]).curves[0]  # across the tube
    assert around.measures(ring)["area"] is None


@pytest.mark.slow
def test_measures_scale_with_the_mesh(ball):
    points = ball.vertices[[5, 200, 400, 600]]
    before = nicmm.design_curve(ball, points).curves[0].measures(ball)
    large = nicmm.Mesh(100.0 * ball.vertices, ball.faces)
    after = nicmm.design_curve(large, 100.0 * points).curves[0].measures(large)
    for name, power in (("length", 1), ("area", 2), ("least_radius", 1), ("greatest_slope", 0)):
        assert after[name] == pytest.approx(100.0**power * before[name], rel=1e-6)


@pytest.mark.slow
def test_measures_do_not_depend_on_shared_vertices(ball):
    points = ball.vertices[[5, 200, 400, 600]]
    before = nicmm.design_curve(ball, points).curves[0].measures(ball)
    corners = ball.vertices[ball.faces].reshape(-1, 3)
    soup = nicmm.Mesh(corners, np.arange(len(corners)).reshape(-1, 3))
    after = nicmm.design_curve(soup, points).curves[0].measures(soup)
    for name in ("length", "area", "least_radius"):
        assert after[name] == pytest.approx(before[name], rel=1e-6)


@pytest.mark.slow
def test_the_distance_to_an_obstacle_is_that_along_the_surface():
    mesh = shapes.sphere(5)
    equator, found = parallel(mesh)
    obstacles = (mesh.vertices[:, 2] < -0.3).astype(float)
    for curve, height in ((equator, 0.0), (found, LATITUDE)):
        away = curve.measures(mesh, obstacles=obstacles)["distance_to_obstacle"]
        # The obstacle ends at a vertex up to an edge below its height.
        assert np.arcsin(0.3) + height < away < np.arcsin(0.3) + height + 0.04
    assert equator.measures(mesh)["distance_to_obstacle"] is None
    nothing = equator.measures(mesh, obstacles=np.zeros(len(mesh.vertices)))
    assert nothing["distance_to_obstacle"] is None


@pytest.mark.slow
def test_slopes_are_measured_from_the_plane_across_a_direction():
    mesh = shapes.sphere(5)
    _, found = parallel(mesh)
    assert found.measures(mesh, up=(1.0, 0.0, 0.0))["greatest_slope"] > 1.5
    assert found.measures(mesh, up=(0.0, 0.0, -5.0))["greatest_slope"] < 0.01


@pytest.mark.slow
def test_corners_are_left_out_of_the_curvature():
    mesh = shapes.disc(24)
    square = np.array([[0.5, 0.5, 0.0], [-0.5, 0.5, 0.0], [-0.5, -0.5, 0.0], [0.5, -0.5, 0.0]])
    places = nearest_points(mesh, square)[0]
    curve = nicmm.design_curve(mesh, places, corners=range(4)).curves[0]
    assert curve.measures(mesh)["least_radius"] < 0.2
    assert curve.measures(mesh, corners=range(4))["least_radius"] > 5.0


@pytest.mark.parametrize(
    ("given", "words"),
    [
        ({"up": (0.0, 0.0, 0.0)}, "up is"),
        ({"up": "north"}, "up cannot be read"),
        ({"obstacles": [1.0]}, "obstacles has shape"),
        ({"corners": [9]}, "corners\\[0\\]"),
    ],
)
def test_arguments_that_cannot_be_used_are_refused(ball, given, words):
    curve = nicmm.design_curve(ball, [5, 200, 400]).curves[0]
    with pytest.raises(nicmm.ArgumentError, match=words):
        curve.measures(ball, **given)


def test_a_curve_on_another_mesh_is_refused(ball, ring):
    curve = nicmm.design_curve(ball, [5, 200, 400]).curves[0]
    with pytest.raises(nicmm.CurveError, match="curve"):
        curve.measures(ring)
