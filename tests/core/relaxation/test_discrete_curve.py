"""Tests that curves with nodes stay simple, on the mesh, and through their points in order."""

import numpy as np
import pytest
from nicmm_kernels import CurveRelaxation

import nicmm_core as nicmm
from nicmm_core import shapes
from nicmm_core.geometry.normals import unsigned_normals
from nicmm_core.geometry.surface_points import SurfacePoints, in_faces
from nicmm_core.relaxation.curve_nodes import CurveSurface, nodes_at
from nicmm_core.relaxation.discrete_curve import (
    curve_from_kernels,
    is_simple,
    place_nodes,
    traced_through,
    without_short_segments,
)
from nicmm_core.relaxation.elastic_energy import bending_energy
from nicmm_core.relaxation.relaxing import level_rules
from nicmm_core.relaxation.rules import relaxation_rules
from tests.core.checks import (
    assert_lies_on_surface,
    assert_valid_curve,
    assert_visits,
    circle,
    curve_through,
    flipped,
    grid,
    scaled,
)
from tests.oracles.reference_energy import moved_along_conormals

ANGLES = np.arange(40) * 2 * np.pi / 40
CONTROLS = [5, 14, 29]


def surface_of(mesh):
    return CurveSurface(mesh, unsigned_normals(mesh))


def on_level(surface, curve, count):
    """The curve at the beginning of a level: its nodes are respaced, and new ones smoothed."""
    relaxation = CurveRelaxation(surface.for_kernels, curve.for_kernels)
    relaxation.begin_level(
        relaxation_rules(surface, 1.0, count, 2.0, contact=True, steps=8, single=True),
        level_rules(surface, count, 1.6, 1e-3, is_traced=True),
    )
    return curve_from_kernels(surface, relaxation.arrays)


def ring_on(mesh, closed=True, radius=0.6):
    return curve_through(mesh, circle(ANGLES, radius), CONTROLS if closed else [0, 9, 39], closed)


def distance_to(points, polyline, closed):
    """Greatest distance from points to a polyline."""
    end = np.roll(polyline, -1, axis=0)[None] if closed else polyline[None, 1:]
    start = polyline[None] if closed else polyline[None, :-1]
    step, offset = end - start, points[:, None] - start
    squared = np.maximum((step**2).sum(axis=2), 1e-300)
    along = np.clip((offset * step).sum(axis=2) / squared, 0.0, 1.0)
    return np.linalg.norm(offset - along[:, :, None] * step, axis=2).min(axis=1).max()


@pytest.mark.parametrize("closed", [True, False])
@pytest.mark.parametrize("count", [10, 64, 300])
def test_nodes_are_points_of_the_same_curve_at_equal_distances_on_each_leg(ball, closed, count):
    curve = ring_on(ball, closed, radius=1.0)
    exact = place_nodes(surface_of(ball), curve, count)
    result = exact.surface_curve(ball)
    assert_valid_curve(ball, result, curve.points[curve.control_index], closed)
    assert result.length == pytest.approx(curve.length, rel=1e-5)
    assert distance_to(result.points, curve.points, closed) < 1e-5
    np.testing.assert_array_equal(result.points[exact.node_index], exact.nodes.positions)
    assert (np.diff(exact.node_index) > 0).all()
    n = len(exact.nodes.positions)
    assert n == pytest.approx(count, abs=3) or count < 18
    bounds = [*exact.control_nodes, n] if closed else exact.control_nodes
    place = np.append(exact.node_index, len(result.points))
    arc = np.concatenate([[0.0], np.cumsum(np.linalg.norm(result.steps, axis=1))])
    arc = arc if closed else np.append(arc, arc[-1])
    for first, last in zip(bounds[:-1], bounds[1:], strict=True):
        assert last - first >= 6
        lengths = np.diff(arc[place[first : last + 1]])
        np.testing.assert_allclose(lengths, lengths.mean(), rtol=1e-3)


def test_the_first_control_point_is_the_first_node(ball):
    curve = ring_on(ball)
    exact = place_nodes(surface_of(ball), curve, 50)
    assert exact.control_nodes[0] == exact.node_index[0] == 0
    np.testing.assert_array_equal(
        exact.nodes.positions[exact.control_nodes], curve.points[curve.control_index]
    )


@pytest.mark.slow
def test_control_points_at_vertices_are_there_once(ball):
    curve = nicmm.design_curve(ball, [12, 80, 41], method="variational").curves[0]
    exact = place_nodes(surface_of(ball), curve, 64)
    assert_valid_curve(ball, exact.surface_curve(ball), ball.vertices[[12, 80, 41]])
    again = on_level(surface_of(ball), exact, 100)
    assert_valid_curve(ball, again.surface_curve(ball), ball.vertices[[12, 80, 41]])


def test_nodes_exactly_at_points_of_edges_keep_the_order():
    """A square on a grid whose sides cross mesh edges exactly where nodes are placed."""
    mesh = grid(8)
    low, high = 0.203125, 0.703125
    corners = np.array([[low, 0.1875], [high, 0.1875], [high, 0.6875], [low, 0.6875]])
    curve = curve_through(mesh, np.pad(corners, ((0, 0), (0, 1))), np.arange(4))
    # Nodes are inside faces, on diagonals and at vertices of the grid, without any rounding.
    for count in (32, 64, 128, 256):
        result = place_nodes(surface_of(mesh), curve, count).surface_curve(mesh)
        assert_valid_curve(mesh, result, curve.points[curve.control_index])
        assert result.length == pytest.approx(2.0, rel=1e-4)


@pytest.mark.parametrize("counts", [(64, 64), (256, 64), (41, 40)])
def test_spacing_nodes_anew_leaves_the_curve_where_it_is(ring, counts):
    angle = ANGLES
    place = np.stack([np.cos(angle), np.sin(angle), 0.2 * np.sin(3 * angle)], axis=1)
    place[:, :2] *= 1.3
    curve = curve_through(ring, place, CONTROLS)
    surface = surface_of(ring)
    again = on_level(surface, place_nodes(surface, curve, counts[0]), counts[1]).surface_curve(ring)
    assert_valid_curve(ring, again, curve.points[curve.control_index])
    assert again.length == pytest.approx(curve.length, rel=1e-5)
    assert distance_to(again.points, curve.points, True) < 1e-5


@pytest.mark.parametrize("factor", [1e-3, 1.0, 1e3])
def test_nodes_of_a_circle_move_sideways_to_a_smaller_one(flat_disc, factor):
    mesh = scaled(flat_disc, factor)
    surface = surface_of(mesh)
    curve = curve_through(mesh, circle(ANGLES, 0.6 * factor), CONTROLS)
    nodes = place_nodes(surface, curve, 60).nodes
    step = np.full(len(nodes.positions), 0.1 * factor)
    step[::7] = 0.0
    moved = moved_along_conormals(surface, nodes, step)
    before, after = (np.linalg.norm(n.positions, axis=1) for n in (nodes, moved))
    np.testing.assert_allclose(before - after, step, atol=5e-3 * factor)
    np.testing.assert_array_equal(moved.positions[::7], nodes.positions[::7])
    outwards = moved_along_conormals(surface, nodes, -7.0 * step)
    assert np.linalg.norm(outwards.positions, axis=1).max() < factor


@pytest.mark.slow
@pytest.mark.parametrize("closed", [True, False])
@pytest.mark.parametrize("seed", [None, 3])
def test_a_traced_curve_passes_its_nodes_and_lies_on_the_mesh(body, closed, seed):
    """On a section of the body, with nodes moved slightly to either side."""
    mesh = body if seed is None else flipped(body, seed)
    surface = surface_of(mesh)
    exact = place_nodes(surface, section(mesh, closed), 80)
    step = 0.02 * np.sin(np.arange(len(exact.nodes.positions)))
    step[exact.control_nodes] = 0.0
    nodes = moved_along_conormals(surface, exact.nodes, step)
    new = traced_through(surface, exact, nodes)
    result = new.surface_curve(mesh)
    assert_lies_on_surface(mesh, result)
    assert_visits(mesh, result, exact.nodes.positions[exact.control_nodes])
    np.testing.assert_array_equal(result.points[new.node_index], nodes.positions)
    assert new.node_index[0] == 0 and (np.diff(new.node_index) > 0).all()
    if not closed:
        assert new.node_index[-1] == len(result.points) - 1


def section(mesh, closed=True):
    """A curve around the body near a level set of the x coordinate."""
    x = mesh.vertices[:, 0]
    points = [int(np.argmin(np.abs(x - x.mean()) + 10 * side)) for side in sides(mesh)]
    design = nicmm.design_curve(mesh, points, closed=closed, order="shortest", method="variational")
    return design.curves[0]


def sides(mesh):
    """Angle of each vertex from three directions around the x axis."""
    y = mesh.vertices[:, 1:] - mesh.vertices[:, 1:].mean(axis=0)
    angle = np.arctan2(y[:, 1], y[:, 0])
    return [np.abs(np.angle(np.exp(1j * (angle - k * 2 * np.pi / 3)))) for k in range(3)]


def test_unmoved_nodes_give_an_exact_curve_again_of_no_more_length(ball):
    surface = surface_of(ball)
    exact = place_nodes(surface, ring_on(ball, radius=1.0), 100)
    again = traced_through(surface, exact, exact.nodes)
    assert_valid_curve(ball, again.surface_curve(ball))
    length = exact.surface_curve(ball).length
    assert again.surface_curve(ball).length == pytest.approx(length, rel=1e-3)


def test_nodes_too_far_apart_for_a_straight_way_are_lost():
    """Two consecutive nodes are on opposite sides of a hole in the disc."""
    mesh = shapes.annulus(12, 0.4)
    surface = surface_of(mesh)
    exact = place_nodes(surface, ring_on(mesh), 60)
    n = len(exact.nodes.positions)
    chosen = SurfacePoints(exact.nodes.places.faces.copy(), exact.nodes.places.barycentric.copy())
    node = int(np.setdiff1d(np.arange(n), exact.control_nodes)[20])
    far = (node + n // 2) % n
    chosen.faces[node], chosen.barycentric[node] = chosen.faces[far], chosen.barycentric[far]
    assert traced_through(surface, exact, nodes_at(surface, chosen, True)) is None


def test_a_curve_that_crosses_itself_is_not_simple(flat_disc):
    eight = np.stack([0.6 * np.sin(ANGLES), 0.4 * np.sin(2 * ANGLES), 0 * ANGLES], axis=1)
    surface = surface_of(flat_disc)
    assert not is_simple(surface, place_nodes(surface, curve_through(flat_disc, eight, [0]), 60))
    assert is_simple(surface, place_nodes(surface, ring_on(flat_disc), 60))


def test_points_of_an_edge_and_a_vertex_are_the_same_from_other_faces(ball):
    """For any order of corners in the other face."""
    mesh = flipped(ball, 2)
    face = np.arange(len(mesh.faces))
    for side in range(3):
        weights = np.tile([0.3, 0.3, 0.3], (len(face), 1))
        weights[:, (side + 1) % 3], weights[:, side] = 0.7, 0.0
        points = SurfacePoints(face, weights)
        beyond = in_faces(mesh, points, mesh.face_neighbours[:, side])
        np.testing.assert_allclose(beyond.positions(mesh), points.positions(mesh), atol=1e-15)
        np.testing.assert_array_equal(beyond.faces, mesh.face_neighbours[:, side])


def test_finer_nodes_on_a_polygon_are_rounded_to_the_circle_through_its_corners(flat_disc):
    """∮ κ² ds of a circle is 2π / r; at the finer nodes, the polygon has more than twice that."""
    surface = surface_of(flat_disc)
    ring = place_nodes(surface, ring_on(flat_disc), 48)
    polygon = traced_through(surface, ring, ring.nodes)
    finer = place_nodes(surface, polygon.surface_curve(flat_disc), 144)
    assert bending_energy(finer.nodes) > 2.0 * 2.0 * np.pi / 0.6
    smooth = on_level(surface, polygon, 144)
    assert is_simple(surface, smooth)
    assert bending_energy(smooth.nodes) == pytest.approx(2.0 * np.pi / 0.6, rel=0.1)
    controls = ring.nodes.positions[ring.control_nodes]
    assert np.allclose(smooth.nodes.positions[smooth.control_nodes], controls, atol=1e-12)


def test_a_node_close_beside_an_edge_makes_no_short_segment(flat_disc):
    """Nodes are moved to a hundredth of a step behind the previous crossing of the curve."""
    surface = surface_of(flat_disc)
    ring = place_nodes(surface, ring_on(flat_disc), 64)
    ring = traced_through(surface, ring, ring.nodes)
    places = ring.nodes.places
    faces, barycentric = places.faces.copy(), places.barycentric.copy()
    beside = np.setdiff1d(np.arange(64), ring.control_nodes)
    before = in_faces(flat_disc, ring.polyline[ring.node_index[beside] - 1], faces[beside])
    barycentric[beside] = 0.99 * before.barycentric + 0.01 * barycentric[beside]
    moved = traced_through(
        surface, ring, nodes_at(surface, SurfacePoints(faces, barycentric), True)
    )
    result = without_short_segments(flat_disc, moved)
    assert len(result.points) < len(moved.polyline) - 20
    assert_valid_curve(flat_disc, result, ring.nodes.positions[ring.control_nodes])
    steps = np.linalg.norm(np.diff(result.points, axis=0, append=result.points[:1]), axis=1)
    before = np.linalg.norm(np.diff(moved.polyline.positions(flat_disc), axis=0), axis=1)
    short = 0.05 * moved.nodes.lengths.mean()
    assert (steps < short).sum() < 0.5 * (before < short).sum()
