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


def paths_between(mesh, starts, ends, longest=np.inf):
    """Results of the kernel for points given by faces and coordinates."""
    limits = np.full(len(starts[0]), longest)
    return nicmm_kernels.paths_along_edges(mesh.edge_graph, starts, ends, limits, lambda: None)


def positions_of(mesh, faces, barycentric):
    return np.einsum("kj,kjd->kd", barycentric, mesh.vertices[mesh.faces[faces]])


def test_paths_between_points_are_shortest_and_run_in_faces(creature, distances):
    rng = np.random.default_rng(5)
    faces = rng.integers(0, len(creature.faces), (2, 40))
    inside = rng.dirichlet(np.ones(3), (2, 40))
    starts, ends = (faces[0], inside[0]), (faces[1], inside[1])
    reached, counts, on_faces, barycentric = paths_between(creature, starts, ends)
    assert reached.all() and counts.sum() == len(on_faces)
    points = positions_of(creature, on_faces, barycentric)
    begins = np.cumsum(counts) - counts
    np.testing.assert_allclose(points[begins], positions_of(creature, *starts))
    to_corners = [
        np.linalg.norm(
            creature.vertices[creature.faces[at[0]]] - positions_of(creature, *at)[:, None], axis=2
        )
        for at in (starts, ends)
    ]
    for number, (begin, count) in enumerate(zip(begins, counts, strict=True)):
        path = np.vstack([points[begin : begin + count], positions_of(creature, *ends)[[number]]])
        length = np.linalg.norm(np.diff(path, axis=0), axis=1).sum()
        corners = np.ix_(creature.faces[faces[0, number]], creature.faces[faces[1, number]])
        expected = (
            to_corners[0][number][:, None] + distances[corners] + to_corners[1][number]
        ).min()
        assert length == pytest.approx(expected)
        for face, *ends_of_segment in zip(
            on_faces[begin : begin + count], path[:-1], path[1:], strict=True
        ):
            corners = creature.vertices[creature.faces[face]]
            for place in ends_of_segment:
                weights = np.linalg.lstsq(
                    np.vstack([corners.T, np.ones(3)]), np.append(place, 1.0), rcond=None
                )[0]
                np.testing.assert_allclose(corners.T @ weights, place, atol=1e-9)
                assert weights.min() > -1e-9


@pytest.mark.parametrize("at_start", [False, True])
@pytest.mark.parametrize("at_end", [False, True])
def test_an_end_at_a_vertex_is_not_repeated(creature, at_start, at_end):
    start = np.array([0.0, 1.0, 0.0] if at_start else [0.2, 0.3, 0.5])
    end = np.array([1.0, 0.0, 0.0] if at_end else [0.6, 0.2, 0.2])
    starts, ends = (np.array([3]), start[None]), (np.array([90]), end[None])
    reached, _, faces, barycentric = paths_between(creature, starts, ends)
    path = np.vstack([positions_of(creature, faces, barycentric), positions_of(creature, *ends)])
    assert reached.all() and (np.linalg.norm(np.diff(path, axis=0), axis=1) > 1e-9).all()
    np.testing.assert_allclose(path[0], positions_of(creature, *starts)[0])


def test_a_path_from_a_vertex_to_itself_is_a_point(creature):
    at = (np.array([3]), np.array([[0.0, 1.0, 0.0]]))
    reached, counts, faces, barycentric = paths_between(creature, at, at)
    assert reached.all() and counts.tolist() == [1]
    np.testing.assert_allclose(
        positions_of(creature, faces, barycentric), positions_of(creature, *at)
    )


def test_longer_paths_are_not_found(creature):
    starts, ends = ((np.array([each]), np.full((1, 3), 1.0 / 3.0)) for each in (3, 90))
    reached, counts, faces, _ = paths_between(creature, starts, ends, longest=1e-3)
    assert not reached.any() and not counts.any() and not len(faces)
