"""Tests the nodes of a curve and the surface at them, against closed forms and differences."""

import numpy as np
import pytest
from nicmm_kernels import conormal_derivatives
from scipy.spatial.transform import Rotation

import nicmm_core as nicmm
from nicmm_core import shapes
from nicmm_core.geometry.normals import unsigned_normals
from nicmm_core.geometry.surface_points import SurfacePoints
from nicmm_core.relaxation.curve_nodes import CurveSurface, nodes_at
from tests.core.checks import circle, flipped, points_near, random_surface_points, scaled

ANGLES = np.arange(48) * 2 * np.pi / 48


def circle_on_disc(disc, radius=0.6, closed=True):
    surface = CurveSurface(disc, unsigned_normals(disc))
    return nodes_at(surface, points_near(disc, circle(ANGLES, radius)), closed)


@pytest.mark.parametrize("subdivisions", [2, 4])
def test_vertex_normals_of_a_sphere_are_its_radii(subdivisions):
    ball = shapes.sphere(subdivisions)
    allowed = 0.3 * ball.mean_edge_length**2
    np.testing.assert_allclose(unsigned_normals(ball), ball.vertices, atol=allowed)


@pytest.mark.parametrize("seed", [0, 1])
def test_turning_faces_over_changes_only_signs_of_normals(ball, flat_disc, seed):
    for mesh in (ball, flat_disc):
        normals, turned = unsigned_normals(mesh), unsigned_normals(flipped(mesh, seed))
        np.testing.assert_allclose(np.linalg.norm(turned, axis=1), 1.0)
        np.testing.assert_allclose(np.abs((normals * turned).sum(axis=1)), 1.0, atol=3e-4)


def test_normals_of_a_moebius_strip_are_across_its_rings_everywhere():
    """They are perpendicular to the rulings and to the core, also at the seam."""
    strip = shapes.moebius_strip(96, 4)
    normals = unsigned_normals(strip)
    ring = strip.vertices.reshape(96, 5, 3)
    across = ring[:, -1] - ring[:, 0]
    along = np.cross([0.0, 0.0, 1.0], ring[:, 2])
    for direction in (across, along):
        unit = direction / np.linalg.norm(direction, axis=1, keepdims=True)
        middle = normals.reshape(96, 5, 3)[:, 2]
        np.testing.assert_allclose((middle * unit).sum(axis=1), 0.0, atol=0.05)


def test_steps_and_lengths_of_a_closed_and_an_open_polygon(flat_disc):
    closed, opened = (circle_on_disc(flat_disc, closed=kind) for kind in (True, False))
    side = 2 * 0.6 * np.sin(np.pi / 48)
    np.testing.assert_allclose(closed.lengths, np.full(48, side), rtol=1e-4)
    np.testing.assert_allclose(opened.lengths, closed.lengths[:-1])
    np.testing.assert_allclose(closed.steps.sum(axis=0), 0.0, atol=1e-12)
    np.testing.assert_array_equal(opened.steps[-1], 0.0)
    np.testing.assert_allclose(opened.steps[:-1], closed.steps[:-1])


@pytest.mark.parametrize("closed", [True, False])
def test_sideways_of_a_circle_is_its_radius(flat_disc, closed):
    """The left of an anticlockwise circle is inwards; at open ends only one step counts."""
    nodes = circle_on_disc(flat_disc, closed=closed)
    radius = -nodes.positions / 0.6
    between = slice(None) if closed else slice(1, -1)
    np.testing.assert_allclose(nodes.conormals[between], radius[between], atol=1e-4)
    np.testing.assert_allclose(np.linalg.norm(nodes.conormals, axis=1), 1.0)
    if not closed:
        ends = (nodes.conormals * nodes.steps)[0], nodes.conormals[-1] * nodes.steps[-2]
        np.testing.assert_allclose([end.sum() for end in ends], 0.0, atol=1e-12)


def test_normals_between_vertices_are_the_radii_of_a_sphere(ball):
    surface = CurveSurface(ball, unsigned_normals(ball))
    nodes = nodes_at(surface, random_surface_points(ball, 50, seed=2), True)
    radius = nodes.positions / np.linalg.norm(nodes.positions, axis=1, keepdims=True)
    np.testing.assert_allclose(nodes.normals, radius, atol=5e-3)
    np.testing.assert_allclose(np.linalg.norm(nodes.normals, axis=1), 1.0)


def test_normals_take_the_side_of_their_face(ball):
    mesh = flipped(ball, 5)
    nodes = nodes_at(
        CurveSurface(mesh, unsigned_normals(mesh)), random_surface_points(mesh, 50, 3), True
    )
    own = mesh.face_normals[nodes.places.faces]
    assert ((nodes.normals * own).sum(axis=1) > 0.9).all()


def test_without_a_map_every_place_has_importance_one(ball):
    surface = CurveSurface(ball, unsigned_normals(ball))
    places = random_surface_points(ball, 5, seed=1)
    np.testing.assert_array_equal(nodes_at(surface, places, True).phi_fea, 1.0)


def test_a_linear_map_is_read_exactly(body):
    """φ_fea is 2 + g · x at every point of every face."""
    gradient = np.array([0.1, -0.2, 0.3])
    surface = CurveSurface(body, unsigned_normals(body), 2.0 + body.vertices @ gradient, 1.0)
    nodes = nodes_at(surface, random_surface_points(body, 30, seed=4), True)
    np.testing.assert_allclose(nodes.phi_fea, 2.0 + nodes.positions @ gradient)


@pytest.mark.parametrize("factor", [1e-3, 1.0, 1e3])
def test_derivatives_are_those_of_small_moves_inside_the_faces(body, factor):
    mesh = flipped(scaled(body, factor), 6)
    wave = np.sin(3.0 * body.vertices[:, 0]) + body.vertices[:, 1] ** 2
    surface = CurveSurface(mesh, unsigned_normals(mesh), 1.0 + wave, 1.0)
    places = random_surface_points(mesh, 40, seed=7)
    nodes = nodes_at(surface, places, True)
    # Conormals have components out of the planes of the faces, which cannot be followed here.
    corner = mesh.vertices[mesh.faces[places.faces]]
    edges = np.stack([corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0]], axis=2)
    change = np.einsum("nij,nj->ni", np.linalg.pinv(edges), nodes.conormals)
    change = np.concatenate([-change.sum(axis=1, keepdims=True), change], axis=1)
    step = 1e-5 * factor
    ahead, behind = (
        nodes_at(surface, SurfacePoints(places.faces, places.barycentric + sign * step * change), 1)
        for sign in (1.0, -1.0)
    )
    turn, drift = conormal_derivatives(surface.for_kernels, nodes.for_kernels)
    expected = (ahead.normals - behind.normals) / (2.0 * step)
    np.testing.assert_allclose(turn, expected, rtol=0, atol=1e-6 * np.abs(expected).max())
    expected = (ahead.phi_fea - behind.phi_fea) / (2.0 * step)
    np.testing.assert_allclose(drift, expected, rtol=0, atol=1e-6 * np.abs(expected).max())


def test_on_a_sphere_normals_turn_with_the_move(ball):
    """The derivative of x / |x| in a tangent direction is that direction."""
    mesh = shapes.sphere(4)
    surface = CurveSurface(mesh, unsigned_normals(mesh))
    nodes = nodes_at(surface, points_near(mesh, circle(ANGLES) + [0, 0, 0.01]), True)
    turn, drift = conormal_derivatives(surface.for_kernels, nodes.for_kernels)
    np.testing.assert_allclose(turn, nodes.conormals, atol=0.06)
    np.testing.assert_array_equal(drift, 0.0)


def test_normals_and_sideways_turn_with_the_surface(body):
    turn = Rotation.from_rotvec([1.0, 0.2, -0.7])
    posed = nicmm.Mesh(turn.apply(body.vertices.copy()), body.faces)
    places = random_surface_points(body, 30, seed=9)
    here, there = (
        nodes_at(CurveSurface(mesh, unsigned_normals(mesh)), places, True) for mesh in (body, posed)
    )
    np.testing.assert_allclose(there.normals, turn.apply(here.normals), atol=1e-12)
    np.testing.assert_allclose(there.conormals, turn.apply(here.conormals), atol=1e-12)
