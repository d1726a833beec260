"""Shortest paths along edges, compared with those of SciPy."""

import nicmm_kernels
import numpy as np
import pytest
from scipy import sparse
from scipy.sparse import csgraph

from nicmm_core import shapes


def edge_matrix(mesh):
    """Lengths of all edges, in a sparse matrix."""
    start, end = mesh.edges.T
    lengths = np.linalg.norm(mesh.vertices[start] - mesh.vertices[end], axis=1)
    size = len(mesh.vertices)
    return sparse.csr_array((lengths, (start, end)), shape=(size, size))


@pytest.fixture(scope="module")
def creature():
    return shapes.creature(2, resolution=32, faces=100)


@pytest.fixture(scope="module")
def distances(creature):
    return csgraph.dijkstra(edge_matrix(creature), directed=False)


def test_distances_from_points(creature, distances):
    corners, away = creature.faces[[5, 90]], np.array([[0.1, 0.2, 0.1], [0.0, 0.3, 0.2]])
    found = nicmm_kernels.distances_along_edges(creature.edge_graph, corners, away, lambda: None)
    expected = (away[:, :, None] + distances[corners]).min(axis=1)
    np.testing.assert_allclose(found, expected, rtol=1e-12)


def test_vertices_of_no_face_are_infinitely_far_away():
    vertices = np.vstack([shapes.sphere(1).vertices, [[5.0, 5.0, 5.0]]])
    mesh = type(shapes.sphere(1))(vertices, shapes.sphere(1).faces)
    found = nicmm_kernels.distances_along_edges(
        mesh.edge_graph, mesh.faces[:1], np.zeros((1, 3)), lambda: None
    )
    assert np.isinf(found[0, -1]) and np.isfinite(found[0, :-1]).all()


def test_points_on_paths_lie_on_edges_at_their_shares(creature, distances):
    rng = np.random.default_rng(2)
    start, end = rng.integers(0, len(creature.vertices), (2, 60))
    share = rng.random(60)
    faces, barycentric = nicmm_kernels.points_on_edge_paths(
        creature.edge_graph, start, end, share, np.inf, lambda: None
    )
    assert ((barycentric > 0.0).sum(axis=1) <= 2).all()
    np.testing.assert_allclose(barycentric.sum(axis=1), 1.0)
    corners, whole = creature.faces[faces], distances[start, end]
    places = np.einsum("kj,kjd->kd", barycentric, creature.vertices[corners])
    away = np.linalg.norm(creature.vertices[corners] - places[:, None], axis=2)
    away[barycentric == 0.0] = np.inf  # a point is joined to the ends of its edge
    for vertex, expected in ((start, share * whole), (end, (1.0 - share) * whole)):
        found = (distances[vertex[:, None], corners] + away).min(axis=1)
        np.testing.assert_allclose(found, expected, atol=1e-12)
    for face, weights in zip(faces, barycentric, strict=True):
        holds = np.isin(creature.faces, creature.faces[face][weights > 0.0]).sum(axis=1)
        assert face == np.flatnonzero(holds == (weights > 0.0).sum())[0]


def test_points_without_a_path_stay_at_the_start(creature):
    faces, barycentric = nicmm_kernels.points_on_edge_paths(
        creature.edge_graph, np.array([3]), np.array([50]), np.array([0.9]), 1e-9, lambda: None
    )
    assert creature.faces[faces[0]][barycentric[0].argmax()] == 3
    assert barycentric[0].max() == 1.0
