"""Tests distances along the surface from segments."""

import igl
import numpy as np
import pytest

import nicmm_core as nicmm
from nicmm_core import shapes
from nicmm_core.geometry.distances import distance_to_segments
from nicmm_core.geometry.segment_distances import (
    FaceSegments,
    SegmentDistances,
    joined_segments,
    segments_of,
)
from tests.core.checks import random_surface_points

pytestmark = pytest.mark.usefixtures("one_attempt_each")


def inside_faces(mesh, count, seed):
    """Random segments, each between two points inside one face."""
    one, other = (random_surface_points(mesh, count, seed).barycentric for seed in (seed, seed + 1))
    return FaceSegments(random_surface_points(mesh, count, seed).faces, one, other)


def at_vertices(mesh, vertices):
    """Segments of length zero at vertices."""
    corner = mesh.faces[:, :, None] == np.array(vertices)
    faces = corner.any(axis=1).argmax(axis=0)
    weights = corner[faces, :, np.arange(len(vertices))].astype(float)
    return FaceSegments(faces, weights, weights)


def distances_in_space(mesh, segments, points):
    """Least distance of each point from straight segments."""
    start, end = segments.positions(mesh)
    places = points.positions(mesh)
    return np.min(
        [
            distance_to_segments(places, *np.broadcast_arrays(a, b, places)[:2])
            for a, b in zip(start, end, strict=True)
        ],
        axis=0,
    )


def test_distances_in_a_plane_are_those_of_the_plane(flat_disc):
    segments = inside_faces(flat_disc, 5, seed=2)
    points = random_surface_points(flat_disc, 200, seed=5)
    found = SegmentDistances(flat_disc, segments, 0.5).at(points)
    expected = distances_in_space(flat_disc, segments, points)
    near = expected < 0.5
    assert 50 < near.sum() < 200
    np.testing.assert_allclose(found[near], expected[near], rtol=1e-12, atol=1e-14)
    assert (found[~near] >= 0.5).all()


@pytest.mark.parametrize("closed", [True, False])
@pytest.mark.parametrize("turned", [False, True])
def test_distances_from_a_bent_polyline_in_a_plane(flat_disc, closed, turned):
    """Lines of neighbouring segments are divided at the bisectors of their bends, with no gap."""
    angle = np.linspace(0.0, 2.0 * np.pi, 9)[:-1]
    radius = 0.2 + 0.15 * np.cos(3.0 * angle)
    corners = np.stack([radius * np.cos(angle), radius * np.sin(angle), 0.0 * angle], axis=1)
    curve = nicmm.design_curve(flat_disc, corners, closed=closed, corners=range(8)).curves[0]
    segments = segments_of(flat_disc, curve)
    points = random_surface_points(flat_disc, 200, seed=5)
    mesh = flat_disc
    if turned:
        faces = mesh.faces.copy()
        which = np.random.default_rng(1).random(len(faces)) < 0.5
        faces[which] = faces[which][:, [0, 2, 1]]
        mesh = nicmm.Mesh(mesh.vertices, faces)
        for weights, of in (
            (segments.start, segments.faces),
            (segments.end, segments.faces),
            (points.barycentric, points.faces),
        ):
            weights[which[of]] = weights[which[of]][:, [0, 2, 1]]
    found = SegmentDistances(mesh, segments, 0.4).at(points)
    expected = distances_in_space(mesh, segments, points)
    near = expected < 0.4
    assert 60 < near.sum()
    np.testing.assert_allclose(found[near], expected[near], rtol=1e-9, atol=1e-12)


@pytest.mark.slow
def test_distances_from_a_segment_are_the_least_of_those_of_its_points():
    """Also where paths unfold so that the segment crosses the line of an edge."""
    mesh = shapes.creature(2, resolution=32, faces=400)
    segments, limit = inside_faces(mesh, 12, seed=4), 0.3
    share = np.linspace(0.0, 1.0, 301)[:, None]
    for index in range(len(segments)):
        one = segments.taken(np.array([index]))
        points = (1.0 - share) * one.start + share * one.end
        dense = FaceSegments(np.full(len(share), one.faces[0]), points, points)
        found = SegmentDistances(mesh, one, limit).at_vertices
        expected = SegmentDistances(mesh, dense, limit).at_vertices
        near = expected < 0.99 * limit
        assert near.sum() > 5
        assert (found[near] <= expected[near] * (1.0 + 1e-9)).all()
        np.testing.assert_allclose(found[near], expected[near], atol=1e-4)


@pytest.mark.slow
def test_the_order_of_segments_does_not_matter():
    mesh = shapes.creature(2, resolution=32, faces=400)
    segments = segments_of(mesh, nicmm.design_curve(mesh, [5, 90, 170]).curves[0])
    shuffled = np.random.default_rng(0).permutation(len(segments))
    limit = 0.3
    one, other = (
        SegmentDistances(mesh, each, limit).at_vertices
        for each in (segments, segments.taken(shuffled))
    )
    near = np.minimum(one, other) < limit
    np.testing.assert_allclose(one[near], other[near], rtol=1e-9)


def test_neighbouring_segments_save_work(flat_disc):
    """In any other order, all lines beyond the ends of each segment are followed."""
    curve = nicmm.design_curve(flat_disc, [3, 40, 90], closed=True).curves[0]
    segments = segments_of(flat_disc, curve)
    shuffled = np.random.default_rng(0).permutation(len(segments))
    in_order, mixed = (
        SegmentDistances(flat_disc, segments.taken(which), 0.3)
        for which in (np.arange(len(segments)), shuffled)
    )
    np.testing.assert_allclose(
        np.minimum(in_order.at_vertices, 0.3), np.minimum(mixed.at_vertices, 0.3), atol=1e-12
    )
    assert 1.5 * len(in_order.paths.sides) < len(mixed.paths.sides)


@pytest.mark.parametrize("limit", [0.2, 1.0])
def test_distances_from_vertices_are_exact_geodesics(surface, limit):
    sources = np.random.default_rng(3).choice(len(surface.vertices), 3, replace=False)
    found = SegmentDistances(surface, at_vertices(surface, sources), limit).at_vertices
    none, every = np.zeros(0, np.int64), np.arange(len(surface.vertices))
    exact = igl.exact_geodesic(surface.vertices, surface.faces, sources, none, every, none)
    near = exact < limit
    assert near.any()
    np.testing.assert_allclose(found[near], exact[near], rtol=1e-6, atol=1e-12)
    assert (found[~near] > limit * (1.0 - 1e-9)).all()


def test_a_path_bends_at_the_boundary():
    """Around the hole of an annulus, the shortest path touches it and follows its edges."""
    mesh = shapes.annulus(rings=10, hole=0.5)
    start, end = (
        int(np.argmin(np.linalg.norm(mesh.vertices - p, axis=1)))
        for p in ([-0.9, 0, 0], [0.9, 0, 0])
    )
    found = SegmentDistances(mesh, at_vertices(mesh, [start]), 5.0).at_vertices[end]
    none = np.zeros(0, np.int64)
    exact = igl.exact_geodesic(
        mesh.vertices, mesh.faces, np.array([start]), none, np.array([end]), none
    )
    assert found > 1.8  # longer than the straight line through the hole
    assert found == pytest.approx(float(np.min(exact)), rel=1e-9)


def test_the_orientation_of_the_mesh_does_not_matter(ring):
    segments = inside_faces(ring, 4, seed=1)
    points = random_surface_points(ring, 100, seed=8)
    before = SegmentDistances(ring, segments, 0.4).at(points)
    turned = nicmm.Mesh(ring.vertices, ring.faces[:, [0, 2, 1]])
    order = [0, 2, 1]
    mirrored = FaceSegments(segments.faces, segments.start[:, order], segments.end[:, order])
    there = nicmm.SurfacePoints(points.faces, points.barycentric[:, order])
    after = SegmentDistances(turned, mirrored, 0.4).at(there)
    near = before < 0.4
    assert 10 < near.sum()
    np.testing.assert_allclose(after[near], before[near], rtol=1e-9)
    assert (after[~near] >= 0.4).all()


def test_several_segments_have_the_least_of_their_distances(ball):
    parts = [inside_faces(ball, 1, seed) for seed in (1, 5)]
    points = random_surface_points(ball, 100, seed=2)
    both = SegmentDistances(ball, joined_segments(parts), 0.8).at(points)
    each = np.min([SegmentDistances(ball, part, 0.8).at(points) for part in parts], axis=0)
    near = each < 0.8
    np.testing.assert_allclose(both[near], each[near], rtol=1e-9)


@pytest.mark.parametrize("share", [0.3, 0.7])
def test_paths_along_a_line_of_edges_do_not_turn_at_its_vertices(share):
    """A segment ends on an edge, and nearly straight lines of edges continue it, as on a grid."""
    count = 9
    x, y = np.meshgrid(np.arange(count), np.arange(count), indexing="ij")
    first = (count * x + y)[:-1, :-1].ravel()
    faces = np.concatenate(
        [
            np.stack([first, first + count, first + count + 1], axis=1),
            np.stack([first, first + count + 1, first + 1], axis=1),
        ]
    )
    face = np.array([faces.tolist().index([40, 49, 50])])
    segments = FaceSegments(face, np.array([[0.2, 0.5, 0.3]]), np.array([[0.0, share, 1 - share]]))
    for seed in range(20):
        moved = 1e-5 * np.random.default_rng(seed).standard_normal((2, count**2))
        flat = np.stack([x.ravel() + moved[0], y.ravel() + moved[1], 0.0 * moved[0]], axis=1)
        mesh = nicmm.Mesh(flat, faces)
        points = random_surface_points(mesh, 120, seed=6)
        places = points.positions(mesh)
        start, end = segments.positions(mesh)
        expected = distance_to_segments(places, *np.broadcast_arrays(start, end, places)[:2])
        found = SegmentDistances(mesh, segments, 3.0).at(points)
        near = expected < 2.9
        assert 30 < near.sum()
        np.testing.assert_allclose(found[near], expected[near], rtol=1e-12, atol=1e-12)


def test_a_segment_on_an_edge_is_as_near_as_its_points(surface):
    generator = np.random.default_rng(7)
    for face in generator.choice(len(surface.faces), 20, replace=False).tolist():
        ends = generator.random((2, 1)) * [[1.0, -1.0, 0.0]] + [[0.0, 1.0, 0.0]]
        start, end = np.roll(ends, face % 3, axis=1)[:, None]
        shares = np.linspace(0.0, 1.0, 9)[:, None]
        points = (1.0 - shares) * start + shares * end
        whole = FaceSegments(np.array([face]), start, end)
        parts = FaceSegments(np.full(9, face), points, points)
        found = SegmentDistances(surface, whole, 0.3).at_vertices
        bound = SegmentDistances(surface, parts, 0.3).at_vertices
        near = bound < 0.3 * (1.0 - 1e-9)
        assert near.any()
        assert (found[near] <= bound[near] + 1e-9).all()


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(6))
@pytest.mark.parametrize("name", ["ball", "flat_disc", "body"])
def test_sides_are_those_of_the_enclosed_region(request, name, seed):
    """Curves run through vertices and along edges, and cross faces."""
    mesh = request.getfixturevalue(name)
    vertices = np.random.default_rng(seed).choice(len(mesh.vertices), 4, replace=False)
    curve = nicmm.design_curve(mesh, vertices, order="shortest").curves[0]
    cut = nicmm.cut_mesh(mesh, curve, snap=0.0)
    region = nicmm.enclosed_region(mesh, cut)
    whole = np.flatnonzero(np.bincount(cut.source_face, minlength=len(mesh.faces)) == 1)
    centroids = nicmm.SurfacePoints(whole, np.full((len(whole), 3), 1.0 / 3.0))
    limit = 0.15 * mesh.diagonal
    away, arcs, sides = SegmentDistances(mesh, segments_of(mesh, curve), limit).nearest(centroids)
    near = away < limit
    inside = region.faces[whole[near]]
    assert 0 < inside.sum() < near.sum()
    assert set(sides[near][inside]) != set(sides[near][~inside])
    assert len(set(sides[near][inside])) == len(set(sides[near][~inside])) == 1


def test_the_nearest_place_has_the_distance(ball):
    """The straight distance to the place at the arc length is not greater, and almost equal."""
    curve = nicmm.design_curve(ball, [5, 200, 400, 600], order="shortest").curves[0]
    points = random_surface_points(ball, 300, seed=8)
    distances = SegmentDistances(ball, segments_of(ball, curve), 0.3)
    away, arcs, _ = distances.nearest(points)
    ends = np.concatenate([curve.points, curve.points[:1]])
    along = np.concatenate([[0.0], np.cumsum(np.linalg.norm(curve.steps, axis=1))])
    place = np.stack([np.interp(arcs, along, ends[:, axis]) for axis in range(3)], axis=1)
    straight = np.linalg.norm(points.positions(ball) - place, axis=1)
    near = away < 0.3
    assert near.sum() > 50
    assert (straight[near] <= away[near] + 1e-12).all()
    assert (straight[near] >= 0.98 * away[near]).all()


def test_distances_relative_to_a_width(ball):
    curve = nicmm.design_curve(ball, [5, 200, 400, 600], order="shortest").curves[0]
    points = random_surface_points(ball, 100, seed=8)
    distances = SegmentDistances(ball, segments_of(ball, curve), 0.3)
    away, arcs, _ = distances.nearest(points)
    knots, widths = np.array([0.0, 1.0, distances.total]), np.array([0.2, 0.5, 0.1])
    relative = distances.relative_to(knots, widths).at(points)
    near = away < 0.3
    expected = 0.1 * away / np.interp(arcs, knots, widths)
    np.testing.assert_allclose(relative[near], expected[near], rtol=1e-12)
    np.testing.assert_array_equal(distances.at(points), away)
