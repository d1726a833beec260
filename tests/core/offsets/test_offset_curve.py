"""Tests curves at a constant distance from another curve."""

from functools import cache

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import nicmm_core as nicmm
from nicmm_core import shapes
from nicmm_core.geometry.crossings import crossing_segments
from nicmm_core.geometry.curve import checked_curve, curve_on_mesh, points_of
from nicmm_core.geometry.segment_distances import SegmentDistances, segments_of
from nicmm_core.geometry.surface_points import nearest_points
from tests.core.checks import random_surface_points

pytestmark = pytest.mark.usefixtures("one_attempt_each")

NORMAL = np.array([0.3, 0.5, 0.8]) / np.linalg.norm([0.3, 0.5, 0.8])


def great_circle(mesh):
    """A design along the great circle in the plane through the origin with this normal.

    It runs counter-clockwise about the normal.
    """
    first = np.cross(NORMAL, [1.0, 0.0, 0.0])
    first /= np.linalg.norm(first)
    angle = np.linspace(0.0, 2.0 * np.pi, 7)[:-1, None]
    places = np.cos(angle) * first + np.sin(angle) * np.cross(NORMAL, first)
    return nicmm.design_curve(mesh, nearest_points(mesh, places)[0]).curves[0]


def plane(pieces=16, seed=3):
    """The unit square in the plane, its inner vertices moved at random."""
    line = np.linspace(0.0, 1.0, pieces + 1)
    vertices = np.stack([*np.meshgrid(line, line), np.zeros((pieces + 1,) * 2)], axis=-1)
    moves = np.random.default_rng(seed).uniform(-0.3 / pieces, 0.3 / pieces, vertices.shape)
    vertices[1:-1, 1:-1, :2] += moves[1:-1, 1:-1, :2]
    corner = np.arange((pieces + 1) ** 2).reshape((pieces + 1,) * 2)
    low, right, up, both = corner[:-1, :-1], corner[:-1, 1:], corner[1:, :-1], corner[1:, 1:]
    faces = [np.stack([low, right, both], axis=-1), np.stack([low, both, up], axis=-1)]
    return nicmm.Mesh(vertices.reshape(-1, 3), np.concatenate(faces).reshape(-1, 3))


def polygon(mesh, corners, closed=True):
    """The curve with straight legs through points in a plane."""
    places = np.column_stack([corners, np.zeros(len(corners))])
    every = range(len(corners))
    return nicmm.design_curve(mesh, places, closed=closed, corners=every).curves[0]


def on_line(curve):
    """Points of a curve, in two dimensions, and the middle of each of its segments."""
    middle = curve.points[: len(curve.steps)] + 0.5 * curve.steps
    return np.concatenate([curve.points, middle])[:, :2]


def assert_sound(mesh, curves):
    """Each curve lies on the mesh, and no two segments cross."""
    for curve in curves:
        checked_curve(mesh, curve, across_gaps=True)
        assert not len(crossing_segments(mesh.faces, points_of(curve), curve.closed))


@pytest.mark.slow
@pytest.mark.parametrize("distance", [0.5, -0.5])
def test_an_offset_of_a_great_circle_is_a_circle_of_latitude(distance):
    errors = []
    for subdivisions in (3, 4, 5):  # 3, 6 and 12 edges to the offset
        mesh = shapes.sphere(subdivisions)
        [found] = nicmm.offset_curve(mesh, great_circle(mesh), distance)
        assert found.closed
        assert_sound(mesh, [found])
        latitude = np.arcsin((found.points @ NORMAL) / np.linalg.norm(found.points, axis=1))
        errors.append(np.abs(latitude / distance - 1.0).max())
        # The left side of a curve that runs counter-clockwise about the normal.
        area_vector = 0.5 * np.cross(found.points, np.roll(found.points, -1, axis=0)).sum(axis=0)
        assert area_vector @ NORMAL > 0.0
    assert errors[1] < 0.5 * errors[0] and errors[2] < 0.5 * errors[1]
    assert errors[2] < 1e-3


def test_an_offset_of_a_helix_on_a_cylinder_is_a_helix():
    """A cylinder can be unrolled, so that distances are those of the plane."""
    around, along = 48, 40
    angle = np.linspace(0.0, 2.0 * np.pi, around, endpoint=False)
    ring = np.stack([np.cos(angle), np.sin(angle)], axis=1)
    heights = np.linspace(-2.0, 2.0, along + 1)
    vertices = np.array([[*place, height] for height in heights for place in ring])
    low = np.arange(around * along).reshape(along, around)
    right, up = np.roll(low, -1, axis=1), low + around
    faces = np.concatenate(
        [np.stack([low, right, up], -1), np.stack([right, np.roll(up, -1, axis=1), up], -1)]
    ).reshape(-1, 3)
    mesh = nicmm.Mesh(vertices, faces)
    side = 2.0 * np.sin(np.pi / around)  # of the polygon that is the cross section

    def unrolled(points):
        """Arc length around the prism and height, (n, 2)."""
        sector = np.unwrap(np.arctan2(points[:, 1], points[:, 0])) * around / (2.0 * np.pi)
        whole = np.floor(sector)
        start = 2.0 * np.pi * whole / around
        chord = np.stack([np.cos(start), np.sin(start)], axis=1)
        share = np.linalg.norm(points[:, :2] - chord, axis=1) / side
        return np.stack([side * (whole + share), points[:, 2]], axis=1)

    # A straight line in the unrolled plane, with a point on each edge from one strip to the next.
    slope = 0.31
    angle = np.linspace(0.5, 6.5, 60)
    line = np.stack([np.cos(angle), np.sin(angle), slope * (angle - 3.5)], axis=1)
    curve = nicmm.design_curve(
        mesh, nearest_points(mesh, line[[0, 20, 40, 59]])[0], closed=False
    ).curves[0]
    [found] = nicmm.offset_curve(mesh, curve, 0.3)
    assert not found.closed
    assert_sound(mesh, [found])
    base, parallel = unrolled(curve.points), unrolled(found.points)
    turns = np.round((parallel[0, 0] - base[0, 0]) / (around * side))
    parallel[:, 0] -= turns * around * side
    middle = 0.5 * (parallel[1:] + parallel[:-1])
    away = [_distance_to_polyline(place, base) for place in np.concatenate([parallel, middle])]
    np.testing.assert_allclose(away, 0.3, rtol=1e-3)


def _distance_to_polyline(point, line):
    """Distance of a point from a polyline in the plane."""
    start, way = line[:-1], np.diff(line, axis=0)
    share = ((point - start) * way).sum(axis=1) / (way * way).sum(axis=1)
    nearest = start + share.clip(0.0, 1.0)[:, None] * way
    return np.linalg.norm(nearest - point, axis=1).min()


def test_an_offset_of_a_square_has_sharp_corners_inside_and_round_ones_outside():
    mesh = plane()
    square = polygon(mesh, [[0.3, 0.3], [0.7, 0.3], [0.7, 0.7], [0.3, 0.7]])
    [inner] = nicmm.offset_curve(mesh, square, 0.1)
    away = np.abs(on_line(inner) - 0.5).max(axis=1)
    np.testing.assert_allclose(away, 0.1, rtol=1e-3)
    assert inner.length == pytest.approx(0.8, rel=1e-3)
    [outer] = nicmm.offset_curve(mesh, square, -0.1)
    beyond = (np.abs(on_line(outer) - 0.5) - 0.2).clip(0.0)
    np.testing.assert_allclose(np.linalg.norm(beyond, axis=1), 0.1, rtol=1e-3)
    assert outer.length == pytest.approx(1.6 + 0.2 * np.pi, rel=1e-3)
    assert not nicmm.offset_curve(mesh, square, 0.21)


def test_an_offset_of_an_open_line_ends_beside_its_ends():
    mesh = plane()
    line = polygon(mesh, [[0.3, 0.4], [0.7, 0.4]], closed=False)
    for distance, height in ((0.15, 0.55), (-0.15, 0.25)):
        [found] = nicmm.offset_curve(mesh, line, distance)
        away = [_distance_to_polyline(place, line.points[:, :2]) for place in on_line(found)]
        np.testing.assert_allclose(away, 0.15, rtol=1e-3)
        np.testing.assert_allclose(found.points[:, 1], height, atol=1e-3)
        np.testing.assert_allclose(found.points[[0, -1], 0], [0.3, 0.7], atol=1e-3)


def test_a_distance_varies_linearly_between_control_points():
    mesh = plane()
    line = polygon(mesh, [[0.2, 0.4], [0.5, 0.4], [0.8, 0.4]], closed=False)
    [found] = nicmm.offset_curve(mesh, line, [0.1, 0.3, 0.2])
    expected = np.interp(found.points[:, 0], [0.2, 0.5, 0.8], [0.5, 0.7, 0.6])
    np.testing.assert_allclose(found.points[:, 1], expected, atol=2e-4)


@pytest.mark.slow
def test_the_distance_of_a_closed_curve_is_continued_from_its_last_point_to_its_first(ball):
    circle = great_circle(ball)
    widths = np.array([0.2, 0.2, 0.4, 0.4, 0.4, 0.2])
    [found] = nicmm.offset_curve(ball, circle, widths)
    assert found.closed
    distances = SegmentDistances(ball, segments_of(ball, circle), 0.6)
    away, arcs, sides = distances.nearest(points_of(found))
    knots = np.linspace(0.0, distances.total, 7)  # the points are equally far apart
    np.testing.assert_allclose(away, np.interp(arcs, knots, [*widths, 0.2]), rtol=5e-3)
    assert (sides == 1.0).all()


@pytest.mark.slow
def test_offsets_split_at_a_neck():
    mesh = plane(24)
    corners = [
        [0.1, 0.2], [0.4, 0.2], [0.45, 0.45], [0.55, 0.45], [0.6, 0.2], [0.9, 0.2],
        [0.9, 0.8], [0.6, 0.8], [0.55, 0.55], [0.45, 0.55], [0.4, 0.8], [0.1, 0.8],
    ]  # fmt: skip
    curve = polygon(mesh, corners)
    assert [len(nicmm.offset_curve(mesh, curve, each)) for each in (0.03, 0.07)] == [1, 2]


@pytest.mark.slow
def test_offsets_merge_on_the_other_side_of_a_tube(ring):
    """Around a tube of circumference 2.5, paths from both sides meet beyond half of that."""
    angle = np.linspace(0.0, 2.0 * np.pi, 9)[:-1]
    top = np.stack([np.cos(angle), np.sin(angle), np.full(8, 0.4)], axis=1)
    curve = nicmm.design_curve(ring, nearest_points(ring, top)[0]).curves[0]
    found = nicmm.offset_curve(ring, curve, 0.9)
    assert [each.closed for each in found] == [True]
    assert not nicmm.offset_curve(ring, curve, 1.5)


@pytest.mark.slow
@pytest.mark.parametrize("name", ["ball", "flat_disc", "ring", "body"])
@pytest.mark.parametrize("share", [0.02, -0.05])
def test_all_points_have_the_distance(request, name, share):
    mesh = request.getfixturevalue(name)
    distance = share * mesh.diagonal
    curve = nicmm.design_curve(mesh, random_surface_points(mesh, 5, 1), order="shortest").curves[0]
    found = nicmm.offset_curve(mesh, curve, distance)
    assert found
    assert_sound(mesh, found)
    distances = SegmentDistances(mesh, segments_of(mesh, curve), 1.2 * abs(distance))
    for each in found:
        away, _, sides = distances.nearest(points_of(each))
        np.testing.assert_allclose(away, abs(distance), rtol=1e-3)
        inner = slice(None) if each.closed else slice(1, -1)
        assert (sides[inner] == np.sign(distance)).all()


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(4))
@given(share=st.floats(-0.3, 0.3))
@settings(max_examples=10)
def test_an_offset_at_any_distance_is_simple(body, seed, share):
    curve = _random_curve(body, 3 + seed, seed, closed=bool(seed % 2))
    if abs(share) > 2e-3:
        assert_sound(body, nicmm.offset_curve(body, curve, share * body.diagonal))


@cache
def _random_curve(mesh, count, seed, closed):
    """A curve through random points in the shortest order, computed once."""
    points = random_surface_points(mesh, count, seed)
    return nicmm.design_curve(mesh, points, order="shortest", closed=closed).curves[0]


@pytest.mark.slow
def test_an_offset_of_the_reversed_curve_is_on_the_other_side(ball):
    curve = great_circle(ball)
    order = np.arange(len(curve.faces))[::-1]
    reverse = curve_on_mesh(
        ball, True, curve.faces[order], curve.barycentric[order], curve.control_index[:0]
    )
    [one] = nicmm.offset_curve(ball, curve, 0.2)
    [other] = nicmm.offset_curve(ball, reverse, -0.2)
    assert one.length == pytest.approx(other.length, rel=1e-4)
    assert (one.points @ NORMAL > 0.1).all() and (other.points @ NORMAL > 0.1).all()


@pytest.mark.slow
@pytest.mark.parametrize("change", ["soup", "turned half", "doubled", "scaled"])
def test_the_same_surface_has_the_same_offset(ball, change):
    points = ball.vertices[[5, 200, 400, 600]]
    curve = nicmm.design_curve(ball, points, order="shortest").curves[0]
    [before] = nicmm.offset_curve(ball, curve, 0.2)
    unit = 1.0
    if change == "soup":
        corners = ball.vertices[ball.faces].reshape(-1, 3)
        mesh = nicmm.Mesh(corners, np.arange(len(corners)).reshape(-1, 3))
    elif change == "turned half":
        turned = np.random.default_rng(0).random(len(ball.faces)) < 0.4
        faces = np.where(turned[:, None], ball.faces[:, ::-1], ball.faces)
        mesh = nicmm.Mesh(ball.vertices, faces)
    elif change == "doubled":
        mesh = nicmm.Mesh(ball.vertices, np.concatenate([ball.faces, ball.faces[::3]]))
    else:
        unit = 1e-5
        mesh = nicmm.Mesh(unit * ball.vertices, ball.faces)
    there = nicmm.design_curve(mesh, unit * points, order="shortest").curves[0]
    [after] = nicmm.offset_curve(mesh, there, unit * 0.2)
    assert after.length == pytest.approx(unit * before.length, rel=1e-9)
    checked_curve(mesh, after, across_gaps=True)


@pytest.mark.slow
def test_a_surface_with_one_side_has_no_offsets_but_a_part_of_it_has():
    strip = shapes.moebius_strip()
    core = np.flatnonzero(np.abs(strip.vertices[:, 2]) < 1e-9)
    around = strip.vertices[core[np.argsort(np.arctan2(*strip.vertices[core, :2].T))]]
    curve = nicmm.design_curve(strip, around[:: len(around) // 6][:6]).curves[0]
    with pytest.raises(nicmm.CurveError, match="one side only"):
        nicmm.offset_curve(strip, curve, 0.05)
    part = nicmm.design_curve(strip, around[:3], closed=False).curves[0]
    one, other = (nicmm.offset_curve(strip, part, each) for each in (0.05, -0.05))
    assert len(one) == len(other) == 1


@pytest.mark.parametrize(
    ("distance", "words"),
    [
        (0.0, "distances\\[0\\] is zero"),
        (float("nan"), "pass a length"),
        ("far", "pass a length"),
        ([0.1, 0.2], "shape \\(2,\\)"),
        ([0.1, -0.1, 0.1, 0.1, 0.1, 0.1], "one sign"),
        ([0.1, np.inf, 0.1, 0.1, 0.1, 0.1], "not finite"),
        (1e-15, "too small"),
        (1e-5, "too small beside the length"),
    ],
)
def test_a_distance_that_cannot_be_used_is_refused(ball, distance, words):
    with pytest.raises(nicmm.ArgumentError, match=words):
        nicmm.offset_curve(ball, great_circle(ball), distance)


def test_curves_that_are_not_on_the_mesh_are_refused(ball, ring):
    curve = great_circle(ball)
    with pytest.raises(nicmm.CurveError, match="curve"):
        nicmm.offset_curve(ring, curve, 0.1)
    with pytest.raises(nicmm.ArgumentError, match="pass a SurfaceCurve"):
        nicmm.offset_curve(ball, curve.points, 0.1)


@pytest.mark.slow
def test_several_distances_at_once_are_those_one_by_one(ball):
    curve = great_circle(ball)
    together = nicmm.Designer(ball).offset_curves(curve, [0.1, -0.2, 0.3])
    for distance, found in zip((0.1, -0.2, 0.3), together, strict=True):
        [alone] = nicmm.offset_curve(ball, curve, distance)
        assert found[0].length == pytest.approx(alone.length, rel=1e-9)
