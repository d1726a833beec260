"""Tests distances along the surface from segments."""

import igl
import numpy as np
import pytest

import nicmm_core as nicmm
from nicmm_core import shapes
from nicmm_core.geometry.distances import distance_to_segments
from nicmm_core.geometry.segment_distances import FaceSegments, SegmentDistances, joined_segments
from tests.core.checks import random_surface_points


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


def test_distances_in_a_plane_are_those_of_the_plane(flat_disc):
    segments = inside_faces(flat_disc, 5, seed=2)
    points = random_surface_points(flat_disc, 200, seed=5)
    found = SegmentDistances(flat_disc, segments, 0.5).at(points)
    start, end = segments.positions(flat_disc)
    places = points.positions(flat_disc)
    expected = np.min(
        [
            distance_to_segments(places, *np.broadcast_arrays(a, b, places)[:2])
            for a, b in zip(start, end, strict=True)
        ],
        axis=0,
    )
    near = expected < 0.5
    assert 50 < near.sum() < 200
    np.testing.assert_allclose(found[near], expected[near], rtol=1e-12, atol=1e-14)
    assert (found[~near] >= 0.5).all()


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
