"""Tests the field of a curve against closed forms and brute force."""

import numpy as np
import pytest
from scipy import sparse
from scipy.sparse import csgraph

import nicmm_core as nicmm
from nicmm_core import shapes
from nicmm_core.geometry.curve_field import curve_field
from tests.core.checks import (
    circle,
    curve_through,
    flipped,
    joined,
    random_surface_points,
    renumbered,
    scaled,
)

ANGLES = np.arange(40) * 2 * np.pi / 40


def brute_force(points, polyline):
    """Distance in space from points to a closed polyline."""
    start, step = polyline[None], np.roll(polyline, -1, axis=0)[None] - polyline[None]
    offset = points[:, None] - start
    squared = np.maximum((step**2).sum(axis=2), 1e-300)
    along = np.clip((offset * step).sum(axis=2) / squared, 0.0, 1.0)
    return np.linalg.norm(offset - along[:, :, None] * step, axis=2).min(axis=1)


@pytest.mark.parametrize("factor", [1e-3, 1.0, 1e3])
def test_in_the_plane_it_is_the_distance_to_a_circle_negative_inside(flat_disc, factor):
    mesh = scaled(flipped(flat_disc, 1), factor)
    curve = curve_through(mesh, circle(ANGLES, 0.6 * factor) + [0.02 * factor, 0, 0], [0])
    field = curve_field(mesh, curve)
    centre = mesh.vertices - [0.02 * factor, 0, 0]
    expected = np.linalg.norm(centre, axis=1) - 0.6 * factor
    clear = np.abs(expected) > 0.01 * factor  # the polygon lies inside the circle by its sagitta
    np.testing.assert_array_equal(np.sign(field)[clear], np.sign(expected)[clear])
    np.testing.assert_allclose(field, expected, rtol=0, atol=0.03 * factor)


def test_in_the_plane_it_agrees_with_brute_force(flat_disc):
    """Exact beside the curve and first-order elsewhere, if no wave has to turn a corner."""
    angle = ANGLES
    radius = 0.55 + 0.1 * np.sin(3 * angle)
    curve = curve_through(flat_disc, circle(angle) * radius[:, None], [0])
    field = curve_field(flat_disc, curve)
    exact = brute_force(flat_disc.vertices, curve.points)
    edge = flat_disc.mean_edge_length
    np.testing.assert_allclose(np.abs(field), exact, rtol=0, atol=0.35 * edge)
    beside = np.unique(flat_disc.faces[curve.faces])
    np.testing.assert_allclose(np.abs(field)[beside], exact[beside], rtol=0, atol=0.06 * edge)
    polar = np.arctan2(flat_disc.vertices[:, 1], flat_disc.vertices[:, 0])
    inside = np.linalg.norm(flat_disc.vertices, axis=1) < 0.55 + 0.1 * np.sin(3 * polar)
    clear = exact > 0.01  # the curve is a polygon
    np.testing.assert_array_equal(field[clear] < 0.0, inside[clear])


def test_on_a_sphere_the_error_falls_with_the_mesh():
    """For the parallel at height 0.3, the distance is a difference of latitudes."""
    errors = []
    for subdivisions in (2, 3, 4):
        mesh = shapes.sphere(subdivisions)
        height = np.sqrt(1 - 0.3**2)
        curve = curve_through(mesh, circle(ANGLES, height) + [0.0, 0.0, 0.3], [0])
        expected = np.arcsin(0.3) - np.arcsin(np.clip(mesh.vertices[:, 2], -1.0, 1.0))
        errors.append(np.abs(curve_field(mesh, curve) - expected).max())
    assert errors[0] > 1.3 * errors[1] > 1.3 * 1.3 * errors[2]
    assert errors[2] < 0.05


def test_the_smaller_side_is_inside_whichever_way_the_curve_runs(ball):
    low = circle(ANGLES, np.sqrt(1 - 0.4**2)) - [0.0, 0.0, 0.4]
    fields = [curve_field(ball, curve_through(ball, path, [0])) for path in (low, low[::-1])]
    np.testing.assert_allclose(fields[0], fields[1], atol=1e-9)
    far = np.abs(ball.vertices[:, 2] + 0.4) > 0.05
    np.testing.assert_array_equal(fields[0][far] < 0.0, ball.vertices[far, 2] < -0.4)


def vertices_on(mesh, curve):
    here = curve.barycentric > 0.0
    single = here.sum(axis=1) == 1
    return np.unique(mesh.faces[curve.faces[single]][here[single]])


def parts_by_cutting(mesh, curve):
    """Connected parts of the surface without the faces that the curve passes."""
    passed = np.isin(mesh.faces, vertices_on(mesh, curve)).any(axis=1)
    passed[curve.faces] = True
    free = np.flatnonzero(~passed)
    edges = mesh.faces[free][:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2)
    size = (len(mesh.vertices),) * 2
    graph = sparse.coo_array((np.ones(len(edges)), edges.T), shape=size)
    part = csgraph.connected_components(graph, directed=False)[1]
    return part, np.unique(mesh.faces[free])


@pytest.mark.slow
@pytest.mark.parametrize("seed", [None, 1])
def test_parts_of_a_body_that_the_curve_cuts_apart_have_different_signs(body, seed):
    mesh = body if seed is None else flipped(body, seed)
    points = random_surface_points(mesh, 4, seed=2)
    design = nicmm.design_curve(mesh, points, order="shortest", method="variational")
    curve = design.curves[0]
    field = curve_field(mesh, curve)
    part, vertices = parts_by_cutting(mesh, curve)
    for label in np.unique(part[vertices]):
        here = vertices[part[vertices] == label]
        assert len(np.unique(np.sign(field[here]))) == 1
    area = np.bincount(mesh.faces.ravel(), np.repeat(mesh.face_areas, 3), len(mesh.vertices))
    assert 0.0 < area[field < 0.0].sum() <= area[field > 0.0].sum()
    # The ends of an edge that the curve crosses once are on different sides.
    on_edge = (curve.barycentric > 0.0).sum(axis=1) == 2
    corners = mesh.faces[curve.faces[on_edge]]
    ends = np.sort(corners[curve.barycentric[on_edge] > 0.0].reshape(-1, 2), axis=1)
    edges, count = np.unique(ends, axis=0, return_counts=True)
    once = field[edges[count == 1]]
    assert (once.prod(axis=1) < 0.0).all() and len(once) > 10


def test_a_curve_that_bounds_nothing_has_a_distance_without_sign(ring):
    """For a meridian of a torus, the distance is |u| times the radius on the outermost parallel."""
    angle = ANGLES
    tube = np.stack([1 + 0.4 * np.cos(angle), 0.02 + 0 * angle, 0.4 * np.sin(angle)], axis=1)
    field = curve_field(ring, curve_through(ring, tube, [0]))
    assert (field >= 0.0).all()
    outer = np.linalg.norm(ring.vertices[:, :2], axis=1) > 1.39
    around = np.arctan2(ring.vertices[outer, 1], ring.vertices[outer, 0])
    near = np.abs(around) < 0.8
    expected = 1.4 * np.abs(around[near] - 0.02 / 1.4)
    np.testing.assert_allclose(field[outer][near], expected, rtol=0.05, atol=0.02)


def test_the_core_of_a_moebius_strip_bounds_nothing():
    strip = shapes.moebius_strip(48, 7)
    core = circle(np.arange(96) * 2 * np.pi / 96)
    field = curve_field(strip, curve_through(strip, core, [0]))
    assert (field > 0.0).all()
    width = np.tile(np.abs(np.linspace(-0.4, 0.4, 8)), 48)
    np.testing.assert_allclose(field, width, atol=0.03)


def test_twice_round_the_core_bounds_a_half_on_a_moebius_strip():
    """A curve beside the core closes after two turns and bounds the part that contains the core."""
    strip = shapes.moebius_strip(48, 7)
    u = np.arange(192) * 4 * np.pi / 192
    radius = 1.0 + 0.21 * np.cos(0.5 * u)
    line = np.stack([radius * np.cos(u), radius * np.sin(u), 0.21 * np.sin(0.5 * u)], axis=1)
    field = curve_field(strip, curve_through(strip, line, [0]))
    width = np.tile(np.abs(np.linspace(-0.4, 0.4, 8)), 48)
    assert len(np.unique(np.sign(field[width < 0.2]))) == 1
    assert len(np.unique(np.sign(field[width > 0.23]))) == 1
    assert field[width < 0.2].max() * field[width > 0.23].max() < 0.0
    np.testing.assert_allclose(np.abs(field), np.abs(width - 0.21), atol=0.03)


@pytest.mark.parametrize("closed", [True, False])
def test_an_open_curve_has_no_inside(flat_disc, closed):
    curve = curve_through(flat_disc, circle(ANGLES, 0.6), [0], closed)
    field = curve_field(flat_disc, curve)
    assert (field < 0.0).any() == closed
    np.testing.assert_allclose(
        field[0], -0.6 if closed else 0.6, rtol=0, atol=0.3 * flat_disc.mean_edge_length
    )


@pytest.mark.slow
def test_a_curve_through_a_vertex_is_zero_there(ball):
    corners = [ball.faces[0, 0], *np.argsort(ball.vertices @ [1.0, 0.5, 0.2])[[100, 400]]]
    curve = nicmm.design_curve(ball, corners, order="shortest", method="variational").curves[0]
    field = curve_field(ball, curve)
    passed = vertices_on(ball, curve)
    assert set(corners) <= set(passed)
    np.testing.assert_array_equal(np.flatnonzero(field == 0.0), passed)
    assert (field < 0.0).any() and (field > 0.0).any()


def test_another_component_is_outside_and_farthest(small_ball, ring):
    mesh = joined(small_ball, ring)
    curve = curve_through(mesh, circle(ANGLES, 0.8) + [0.0, 0.0, 0.6], [0])
    field = curve_field(mesh, curve)
    alone = curve_field(small_ball, curve_through(small_ball, curve.points, [0]))
    np.testing.assert_allclose(field[: len(alone)], alone, atol=0.03)
    np.testing.assert_array_equal(field[len(alone) :], np.abs(field[: len(alone)]).max())


@pytest.mark.slow
def test_numbers_of_vertices_and_faces_do_not_matter(body):
    points = random_surface_points(body, 4, seed=3)
    design = nicmm.design_curve(body, points, order="shortest", method="variational")
    other = renumbered(body, 5)
    positions = design.curves[0].points
    field, again = (curve_field(m, curve_through(m, positions, [0])) for m in (body, other))
    place = np.argsort(np.lexsort(body.vertices.T))
    np.testing.assert_allclose(again[np.lexsort(other.vertices.T)][place], field, atol=1e-3)
