"""Tests straight traces over faces against closed forms, on surfaces that unroll to a plane."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

import nicmm_core as nicmm
from nicmm_core import shapes
from nicmm_core.geometry.curve import curve_on_mesh
from nicmm_core.geometry.surface_points import SurfacePoints, joined
from nicmm_core.geometry.tracing import strictly_inside, trace_between, trace_from
from tests.core.checks import (
    assert_does_not_touch_itself,
    assert_lies_on_surface,
    chosen,
    cylinder,
    distances,
    flipped,
    grid,
    points_near,
    random_surface_points,
    renumbered,
    scaled,
)


def plane_between(mesh, start, end):
    """Sum of the normals at both ends, for any orientation of the faces."""
    first, second = mesh.face_normals[start.faces], mesh.face_normals[end.faces]
    return first + np.where((first * second).sum(axis=1) < 0.0, -1.0, 1.0)[:, None] * second


def ways(mesh, start, end, normals=None, detour=2.0):
    """Each trace, with its ends, as an open curve; None for a trace that failed."""
    normals = plane_between(mesh, start, end) if normals is None else normals
    traces = trace_between(mesh, start, end, normals, detour * distances(mesh, start, end))
    assert (np.diff(traces.pair) >= 0).all()
    assert traces.reached[traces.pair].all()
    found = []
    for pair in range(len(start)):
        here = traces.pair == pair
        faces = [start.faces[[pair]], traces.crossings.faces[here], end.faces[[pair]]]
        rows = [start.barycentric[[pair]], traces.crossings.barycentric[here]]
        curve = curve_on_mesh(
            mesh,
            False,
            np.concatenate(faces),
            np.concatenate([*rows, end.barycentric[[pair]]]),
            np.zeros(0, dtype=np.int64),
        )
        found.append(curve if traces.reached[pair] else None)
    return found


@pytest.mark.parametrize("factor", [1e-3, 1.0, 1e3])
def test_on_a_flat_disc_a_way_is_the_straight_segment(flat_disc, factor):
    mesh = scaled(flipped(flat_disc, 3), factor)
    start, end = (random_surface_points(mesh, 40, seed=seed) for seed in (1, 2))
    for way in ways(mesh, start, end):
        straight = np.linalg.norm(way.points[-1] - way.points[0])
        assert way.length == pytest.approx(straight, rel=1e-12)
        assert_lies_on_surface(mesh, way)


def test_a_way_crosses_every_edge_between_its_ends_once(flat_disc):
    """The number of crossings is that of the edges that intersect the straight segment."""
    start, end = (random_surface_points(flat_disc, 30, seed=seed) for seed in (5, 6))
    plane, longest = plane_between(flat_disc, start, end), np.full(len(start), np.inf)
    traces = trace_between(flat_disc, start, end, plane, longest)
    first, second = start.positions(flat_disc)[:, :2], end.positions(flat_disc)[:, :2]
    sides = np.sort(flat_disc.faces[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2), axis=1)
    a, b = flat_disc.vertices[np.unique(sides, axis=0)][:, :, :2].transpose(1, 0, 2)

    def turn(p, q, r):
        return (q - p)[..., 0] * (r - p)[..., 1] - (q - p)[..., 1] * (r - p)[..., 0]

    for pair in range(len(start)):
        p, q = first[pair], second[pair]
        crossed = (turn(p, q, a) * turn(p, q, b) < 0) & (turn(a, b, p) * turn(a, b, q) < 0)
        assert (traces.pair == pair).sum() == crossed.sum()


def test_on_a_cylinder_ways_come_near_the_helix_with_the_square_of_their_length():
    mesh = cylinder(around=200, along=20)
    excess = []
    for turn in (0.8, 0.4):
        angle = np.array([0.013, 1.7, 3.11])
        ends = []
        for shift, height in ((0.0, 0.31), (turn, 0.31 + 1.1 * turn)):
            place = [np.cos(angle + shift), np.sin(angle + shift), np.full(3, height)]
            ends.append(points_near(mesh, np.transpose(place)))
        lengths = np.array([way.length for way in ways(mesh, *ends)])
        excess.append((lengths / (turn * np.hypot(1.0, 1.1)) - 1.0).max())
    assert 0.0 < excess[0] < 2e-3
    assert abs(excess[1]) < 0.3 * excess[0]


@pytest.mark.parametrize("subdivisions", [2, 4])
def test_on_a_sphere_ways_are_arcs_of_great_circles(subdivisions):
    """They lie in the plane through both points and the centre; lengths are of second order."""
    mesh = shapes.sphere(subdivisions)
    start, end = (random_surface_points(mesh, 30, seed=seed) for seed in (3, 4))
    first, second = start.positions(mesh), end.positions(mesh)
    near = (first * second).sum(axis=1) > -0.5
    start, end, first, second = chosen(start, near), chosen(end, near), first[near], second[near]
    across = np.cross(first, second)
    across /= np.linalg.norm(across, axis=1, keepdims=True)
    angle = np.arctan2(np.linalg.norm(np.cross(first, second), axis=1), (first * second).sum(1))
    for way, axis, arc in zip(ways(mesh, start, end, first + second), across, angle, strict=True):
        np.testing.assert_allclose(way.points @ axis, 0.0, atol=1e-12)
        assert way.length == pytest.approx(arc, rel=2.0 * mesh.mean_edge_length**2)
        assert_lies_on_surface(mesh, way)


@pytest.mark.slow
@given(st.integers(0, 10_000))
def test_ways_on_a_random_body_stay_on_it_and_in_their_plane(body, seed):
    generator = np.random.default_rng(seed)
    mesh = flipped(body, seed)
    start = random_surface_points(mesh, 12, seed)
    direction = generator.normal(size=(12, 3))
    end, _, _ = trace_from(
        mesh, start, tangent(mesh, start, direction), generator.uniform(0, 0.3, 12)
    )
    normals = plane_between(mesh, start, end)
    found = ways(mesh, start, end, normals)
    # Limbs are thin: some moves lead around a limb, where the plane section misses the end.
    assert sum(way is None for way in found) <= 4
    for way, normal in zip(found, normals, strict=True):
        if way is None:
            continue
        assert_lies_on_surface(mesh, way)
        ahead = way.points[-1] - way.points[0]
        plane = np.cross(normal, ahead)
        height = (way.points - way.points[0]) @ (plane / np.linalg.norm(plane))
        np.testing.assert_allclose(height, 0.0, atol=1e-9)
        assert way.length <= 2.0 * np.linalg.norm(ahead) + 4.0 * mesh.mean_edge_length


def tangent(mesh, points, direction):
    """Directions projected to the planes of the faces, as unit vectors."""
    normal = mesh.face_normals[points.faces]
    direction = direction - (direction * normal).sum(axis=1, keepdims=True) * normal
    return direction / np.linalg.norm(direction, axis=1, keepdims=True)


def test_a_vertex_is_reached_from_every_face_round_it(ball):
    """From nearby points on all sides; the trace ends in a face that contains the vertex."""
    around = np.flatnonzero((ball.faces == 100).any(axis=1))
    start = SurfacePoints(around, np.full((len(around), 3), 1.0 / 3.0))
    elsewhere = points_near(ball, 1.4 * ball.vertices[100] - 0.7 * start.positions(ball))
    corner = (ball.faces[around[0]] == 100).astype(float)
    for from_points in (start, elsewhere):
        end = SurfacePoints(np.full(len(around), around[0]), np.tile(corner, (len(around), 1)))
        normals = np.tile(ball.vertices[100], (len(around), 1))
        for way in ways(ball, from_points, end, normals):
            np.testing.assert_allclose(way.points[-1], ball.vertices[100], atol=1e-15)
            assert_lies_on_surface(ball, way)


@pytest.mark.parametrize(("end", "through"), [((0.21875, 0.1875), True), ((0.21875, 0.18), False)])
def test_a_way_through_a_vertex_passes_it_once(end, through):
    """To continue, the trace changes faces at the vertex without moving."""
    mesh = grid(8)
    start = points_near(mesh, [[0.03125, 0.0625, 0.0]])
    way = ways(mesh, start, points_near(mesh, [[*end, 0.0]]))[0]
    assert_lies_on_surface(mesh, way)
    assert_does_not_touch_itself(mesh, way)
    assert (way.barycentric == 1.0).any() == through


@pytest.mark.parametrize("thickness", [0.3, 0.03])
def test_a_way_round_the_edge_of_a_plate_begins_ahead(thickness):
    """No plane along the normals contains the trace, and the end point lies inwards."""
    plate = shapes.cube(12)
    mesh = nicmm.Mesh(0.5 * plate.vertices * [1.0, 1.0, thickness], plate.faces)
    half = 0.5 * thickness
    start, end = points_near(mesh, [[0.46, 0.1, half]]), points_near(mesh, [[0.44, 0.12, -half]])
    outwards = np.array([[1.0, 0.0, 0.0]])
    straight = 0.04 + thickness + 0.06  # to the edge, down, and back
    longest = np.array([1.5 * straight])
    assert not trace_between(mesh, start, end, np.eye(3)[2:], longest).reached.any()
    traces = trace_between(mesh, start, end, outwards, longest, ahead=outwards)
    assert traces.reached.all()
    points = joined([start, traces.crossings, end]).positions(mesh)
    length = np.linalg.norm(np.diff(points, axis=0), axis=1).sum()
    assert straight - 1e-9 <= length <= 1.1 * straight
    assert points[:, 0].max() == pytest.approx(0.5)


def test_points_of_one_face_need_no_crossing(ball):
    start = SurfacePoints(np.arange(5), np.tile([0.5, 0.3, 0.2], (5, 1)))
    end = SurfacePoints(np.arange(5), np.tile([0.0, 1.0, 0.0], (5, 1)))
    traces = trace_between(ball, start, end, ball.face_normals[:5], np.ones(5))
    assert traces.reached.all()
    assert len(traces.pair) == 0


def test_a_way_off_the_surface_or_too_long_is_lost():
    """None exists across a hole; around half a cylinder it is π/2 times as long as the chord."""
    gap = shapes.annulus(12, 0.5)
    start, end = points_near(gap, [[-0.7, 0.01, 0]]), points_near(gap, [[0.7, 0.012, 0]])
    assert ways(gap, start, end) == [None]
    tube = cylinder(around=60)
    start, end = points_near(tube, [[-1, 0.01, 1]]), points_near(tube, [[1, 0.01, 1.01]])
    up = np.array([[0.0, 1.0, 0.0]])
    assert ways(tube, start, end, up, detour=1.5) == [None]
    assert ways(tube, start, end, up, detour=1.6)[0].length == pytest.approx(np.pi, rel=0.02)


def test_ways_do_not_depend_on_numbers_orientation_or_pose(body):
    start = random_surface_points(body, 20, seed=8)
    direction = tangent(body, start, np.random.default_rng(8).normal(size=(20, 3)))
    end, _, _ = trace_from(body, start, direction, np.full(20, 0.2))
    normals = plane_between(body, start, end)
    lengths = [None if way is None else way.length for way in ways(body, start, end, normals)]
    turn = Rotation.from_rotvec([0.3, -1.0, 2.0])
    posed = nicmm.Mesh(turn.apply(body.vertices.copy()) + 5.0, body.faces)
    for mesh, new in ((renumbered(body, 1), normals), (flipped(body, 1), -normals)):
        places = [points_near(mesh, points.positions(body)) for points in (start, end)]
        again = ways(mesh, *places, new)
        assert [None if way is None else way.length for way in again] == pytest.approx(lengths)
    again = ways(posed, start, end, turn.apply(normals))
    assert [None if way is None else way.length for way in again] == pytest.approx(lengths)


@pytest.mark.parametrize("factor", [1e-3, 1.0, 1e3])
def test_on_a_flat_disc_points_move_by_a_translation(flat_disc, factor):
    mesh = scaled(flipped(flat_disc, 2), factor)
    start = random_surface_points(mesh, 60, seed=9)
    angle = np.random.default_rng(9).uniform(0, 2 * np.pi, 60)
    direction = np.stack([np.cos(angle), np.sin(angle), 0 * angle], axis=1)
    target = start.positions(mesh) + 0.3 * factor * direction
    stays = np.linalg.norm(target, axis=1) < 0.97 * factor
    end, blocked, _ = trace_from(mesh, start, direction, np.full(60, 0.3 * factor))
    assert stays.sum() > 20 and not blocked[stays].any()
    # The tolerance is the shift that keeps a point strictly inside its face.
    np.testing.assert_allclose(
        end.positions(mesh)[stays], target[stays], rtol=0, atol=1e-6 * factor
    )
    assert (end.barycentric > 0.0).all()


def test_points_stop_beside_the_boundary(flat_disc):
    start = random_surface_points(flat_disc, 40, seed=10)
    before = start.positions(flat_disc)
    angle = np.random.default_rng(10).uniform(0, 2 * np.pi, 40)
    direction = np.stack([np.cos(angle), np.sin(angle), 0 * angle], axis=1)
    end, blocked, _ = trace_from(flat_disc, start, direction, np.full(40, 3.0))
    assert blocked.all()
    place = end.positions(flat_disc)
    radius = np.linalg.norm(place, axis=1)
    apothem = np.cos(np.pi / (6 * 12))
    assert (radius > apothem - 1e-5).all() and (radius < 1.0).all()
    assert (end.barycentric > 0.0).all()
    # The moves are straight.
    across = np.cross(direction, place - before)
    np.testing.assert_allclose(across, 0.0, atol=1e-5)


def test_points_stop_beside_an_edge_of_three_faces():
    vertices = [[0, -1, 0], [0, 1, 0], [-1, 0, 0], [1, 0, 0], [0, 0, 1]]
    fin = nicmm.Mesh(vertices, [[0, 1, 2], [1, 0, 3], [0, 1, 4]])
    start = SurfacePoints(np.array([0]), np.full((1, 3), 1.0 / 3.0))
    end, blocked, _ = trace_from(fin, start, np.array([[1.0, 0.0, 0.0]]), np.array([1.0]))
    assert blocked.all()
    assert end.faces.tolist() == [0]
    np.testing.assert_allclose(end.positions(fin), 0.0, atol=1e-5)


def test_a_move_has_the_length_asked_for_and_a_way_back(body):
    """On any surface, the trace between both ends has the length of the move."""
    start = random_surface_points(body, 30, seed=11)
    direction = tangent(body, start, np.random.default_rng(11).normal(size=(30, 3)))
    for length in (0.01, 0.1):
        end, blocked, _ = trace_from(body, start, direction, np.full(30, length))
        assert not blocked.any()
        found = ways(body, start, end, body.face_normals[start.faces])
        reached = [way.length for way in found if way is not None]
        assert len(reached) >= 28
        assert reached == pytest.approx([length] * len(reached), rel=1e-3)


def test_a_move_round_the_equator_comes_back(ball):
    """The length is 2π, less the difference between arcs and chords."""
    start = points_near(ball, [[0.8, 0.6, 0.013]])
    place = start.positions(ball)
    normal = ball.face_normals[start.faces]
    plane = np.cross(np.cross(normal, [0.0, 0.0, 1.0]), normal)
    direction = np.cross(plane / np.linalg.norm(plane), normal)
    end, _, _ = trace_from(ball, start, direction, np.array([2.0 * np.pi]))
    assert np.linalg.norm(end.positions(ball) - place) < 2.0 * ball.mean_edge_length


def test_no_move_leaves_a_point_where_it_is(ball):
    start = random_surface_points(ball, 7, seed=12)
    end, blocked, _ = trace_from(ball, start, tangent(ball, start, np.ones((7, 3))), np.zeros(7))
    np.testing.assert_array_equal(end.faces, start.faces)
    np.testing.assert_allclose(end.barycentric, start.barycentric, atol=1e-15)
    assert not blocked.any()


def test_strictly_inside_moves_a_corner_hardly_and_an_inner_point_not():
    drawn = strictly_inside(np.array([[1.0, 0.0, 0.0], [0.5, 0.5, 0.0], [0.2, 0.3, 0.5]]))
    assert (drawn > 0.0).all()
    np.testing.assert_allclose(drawn.sum(axis=1), 1.0)
    np.testing.assert_allclose(drawn[:2], [[1, 0, 0], [0.5, 0.5, 0]], atol=3e-6)
    np.testing.assert_allclose(drawn[2], [0.2, 0.3, 0.5], rtol=1e-15)
