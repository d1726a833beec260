"""Tests that faces subdivided along some sides cover the same surface without cracks."""

import numpy as np
import pytest

from nicmm_core.geometry.mesh import unique_edges
from nicmm_core.repair.edge_subdivision import subdivided
from tests.core.checks import grid


@pytest.mark.parametrize("seed", range(5))
def test_parts_cover_the_faces_and_meet_along_the_cut_edges(seed):
    generator = np.random.default_rng(seed)
    mesh = grid(2)
    faces = mesh.faces
    corner = 3 * np.arange(len(faces))[:, None]
    first, second = (corner + [1, 2, 0]).ravel(), (corner + [2, 0, 1]).ravel()
    turned = faces.ravel()[first] > faces.ravel()[second]
    low, high = np.where(turned, second, first), np.where(turned, first, second)
    ends = np.stack([faces.ravel()[low], faces.ravel()[high]], axis=1)
    edges, edge = np.unique(ends, axis=0, return_inverse=True)
    chosen = generator.random(len(edges)) < 0.4
    number = np.where(chosen, np.cumsum(chosen) - 1, -1)
    segments = generator.integers(2, 5, size=chosen.sum())
    edge_of_side = number[edge.ravel()]
    parts, first_child = subdivided(faces, edge_of_side, segments, len(mesh.vertices))

    # The parts of every face cover it once, with its orientation.
    area = np.bincount(parts.parent, weights=np.linalg.det(parts.corners))
    np.testing.assert_allclose(area, 1.0, atol=1e-12)
    places = parts.corners @ mesh.vertices[faces[parts.parent]]
    n_vertices = parts.faces.max() + 1
    for vertex in range(n_vertices):
        here = places[parts.faces == vertex]
        np.testing.assert_allclose(here, here[:1].repeat(len(here), axis=0), atol=1e-15)
    # New vertices are at equal steps along each subdivided edge, edge by edge.
    expected = [
        mesh.vertices[low] + step / count * (mesh.vertices[high] - mesh.vertices[low])
        for (low, high), count in zip(edges[chosen], segments, strict=True)
        for step in range(1, count)
    ]
    for point, place in enumerate(expected, start=len(mesh.vertices)):
        np.testing.assert_allclose(places[parts.faces == point][0], place, atol=1e-15)
    # There is no crack: the rim has the same length as before.
    rim, count = unique_edges(parts.faces)
    assert (count <= 2).all()
    at = np.zeros((n_vertices, 3))
    at[parts.faces] = places
    lengths = np.linalg.norm(at[rim[count == 1, 0]] - at[rim[count == 1, 1]], axis=1)
    assert abs(lengths.sum() - 4.0) < 1e-12
    # The parts along a subdivided side contain its segments in order.
    for side in np.flatnonzero(edge_of_side >= 0).tolist():
        run = first_child[side] + np.arange(segments[edge_of_side[side]])
        middles = places[run][:, :2].mean(axis=1)
        line = mesh.vertices[faces.ravel()[[low[side], high[side]]]]
        along = (middles - line[0]) @ (line[1] - line[0])
        assert (np.diff(along) > 0.0).all() and (parts.parent[run] == side // 3).all()
