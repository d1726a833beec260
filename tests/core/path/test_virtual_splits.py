"""Tests that virtual splits keep the surface and make every control point a vertex."""

import numpy as np
import pytest

import nicmm_core as nicmm
from nicmm_core.path.virtual_splits import SplitMesh
from tests.core.checks import euler_characteristic, joined, random_surface_points

THIRD = 1.0 / 3.0

WHERE = {
    "in a face": ([7], [[0.2, 0.3, 0.5]]),
    "on an edge": ([7], [[0.25, 0.75, 0.0]]),
    "on a vertex": ([7], [[0.0, 1.0, 0.0]]),
    "three in one face": ([7, 7, 7], [[0.2, 0.3, 0.5], [0.6, 0.2, 0.2], [0.1, 0.8, 0.1]]),
    "in line in one face": (
        [7, 7, 7],
        [[0.4, 0.4, 0.2], [0.3, 0.3, 0.4], [0.25, 0.25, 0.5]],
    ),
    "three on one edge": ([7, 7, 7], [[0.25, 0.75, 0], [0.75, 0.25, 0], [0.5, 0.5, 0]]),
    "face, then its edge and vertex": (
        [7, 7, 7],
        [[THIRD, THIRD, THIRD], [0.0, 0.5, 0.5], [1.0, 0.0, 0.0]],
    ),
    "edge, then the face beside it": ([7, 7], [[0.5, 0.5, 0.0], [0.3, 0.3, 0.4]]),
    "very near a corner": ([7, 7], [[1 - 4e-6, 2e-6, 2e-6], [0.4, 0.3, 0.3]]),
}


def inserted(mesh, points, component=0):
    """Working mesh with the points inserted, and their vertices."""
    split = SplitMesh(mesh)
    vertices = split.insert_points(points)
    working, renumbered = split.assemble(component)
    return working, renumbered[vertices]


@pytest.mark.parametrize(("faces", "barycentric"), WHERE.values(), ids=WHERE.keys())
def test_points_become_vertices_of_an_unchanged_surface(small_ball, faces, barycentric):
    points = nicmm.SurfacePoints(np.array(faces), np.array(barycentric, dtype=float))
    working, controls = inserted(small_ball, points)
    assert_same_surface(small_ball, working)
    assert len(set(controls.tolist())) == len(controls)
    np.testing.assert_allclose(
        working.vertices[controls], points.positions(small_ball), rtol=0, atol=1e-15
    )


def test_random_points_become_vertices_of_an_unchanged_surface(surface):
    points = random_surface_points(surface, 12, seed=11)
    working, controls = inserted(surface, points)
    assert_same_surface(surface, working)
    np.testing.assert_allclose(
        working.vertices[controls], points.positions(surface), rtol=0, atol=1e-14
    )
    assert len(working.vertices) == len(surface.vertices) + 12
    assert len(working.faces) == len(surface.faces) + 24


def test_edge_split_halves_both_faces_and_face_split_makes_three():
    square = nicmm.Mesh([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], [[0, 1, 2], [0, 2, 3]])
    split = SplitMesh(square)
    middle = split.split_edge(0, 2)
    working, renumbered = split.assemble(0)
    np.testing.assert_allclose(working.vertices[renumbered[middle]], [0.5, 0.5, 0.0])
    np.testing.assert_allclose(working.face_areas, 0.25)
    split = SplitMesh(square)
    centre = split.split_face(1)
    working, renumbered = split.assemble(0)
    np.testing.assert_allclose(working.vertices[renumbered[centre]], [1 / 3, 2 / 3, 0.0])
    np.testing.assert_allclose(np.sort(working.face_areas), [1 / 6, 1 / 6, 1 / 6, 0.5])


def test_point_seen_from_the_other_face_of_an_edge_is_the_same_vertex(small_ball):
    """A point on an edge may be given in either face; two such points must not split it twice."""
    a, b, _ = small_ball.faces[7]
    (other,) = set(
        np.flatnonzero(((small_ball.faces == a) | (small_ball.faces == b)).sum(1) == 2)
    ) - {7}
    weight = {a: 0.25, b: 0.75}
    opposite = [weight.get(v, 0.0) for v in small_ball.faces[other]]
    points = nicmm.SurfacePoints(
        np.array([7, other]), np.array([[0.75, 0.25, 0.0], opposite], dtype=float)
    )
    working, controls = inserted(small_ball, points)
    assert_same_surface(small_ball, working)
    np.testing.assert_allclose(
        working.vertices[controls], points.positions(small_ball), rtol=0, atol=1e-15
    )


def test_only_the_component_asked_for_is_assembled(small_ball, ring):
    mesh = joined(ring, small_ball)
    first_face = len(ring.faces)
    points = nicmm.SurfacePoints(np.array([first_face + 7]), np.full((1, 3), THIRD))
    working, controls = inserted(mesh, points, mesh.face_component[first_face])
    assert len(working.vertices) == len(small_ball.vertices) + 1
    assert (working.parent_face >= first_face).all()
    np.testing.assert_array_equal(working.input_vertex[controls], [-1])
    np.testing.assert_allclose(working.vertices[controls], points.positions(mesh), atol=1e-15)


def test_input_mesh_is_left_alone(small_ball):
    before = small_ball.vertices.copy(), small_ball.faces.copy()
    inserted(small_ball, random_surface_points(small_ball, 5, seed=2))
    np.testing.assert_array_equal(small_ball.vertices, before[0])
    np.testing.assert_array_equal(small_ball.faces, before[1])


def test_edges_of_the_working_mesh_by_hand():
    """Edges, their lengths and the boundary, on two right triangles that share an edge."""
    mesh = nicmm.Mesh(
        [[0, 0, 0], [3, 0, 0], [0, 4, 0], [0, 0, 1], [3, 4, 0]], [[0, 1, 2], [2, 1, 4]]
    )
    working, _ = SplitMesh(mesh).assemble(0)
    np.testing.assert_array_equal(working.input_vertex, [0, 1, 2, 4])
    np.testing.assert_array_equal(working.edges, [[0, 1], [0, 2], [1, 2], [1, 3], [2, 3]])
    np.testing.assert_allclose(working.edge_lengths, [3, 4, 5, 4, 3])
    assert working.on_boundary.all()


def test_boundary_is_the_rim(flat_disc, small_ball):
    working, _ = SplitMesh(flat_disc).assemble(0)
    radius = np.linalg.norm(working.vertices, axis=1)
    np.testing.assert_array_equal(working.on_boundary, radius > 1.0 - 1e-9)
    assert not SplitMesh(small_ball).assemble(0)[0].on_boundary.any()


def assert_same_surface(mesh, working):
    """Assert equal area, topology and orientation, and that every face lies in its parent."""
    assert working.face_areas.min() > 0.0
    np.testing.assert_allclose(
        np.bincount(working.parent_face, weights=working.face_areas), mesh.face_areas, rtol=1e-9
    )
    assert euler_characteristic(working.faces) == euler_characteristic(mesh.faces)
    np.testing.assert_allclose(
        working.interpolation @ mesh.vertices, working.vertices, rtol=0, atol=1e-15
    )
    np.testing.assert_allclose(working.interpolation.sum(axis=1), 1.0, rtol=0, atol=1e-15)
    assert working.interpolation.min() >= 0.0
    support = working.interpolation.tocoo()
    within = {}
    for row, column, weight in zip(support.row, support.col, support.data, strict=True):
        if weight > 0.0:
            within.setdefault(int(row), set()).add(int(column))
    for corners, parent in zip(working.faces, working.parent_face, strict=True):
        for corner in corners.tolist():
            assert within[corner] <= set(mesh.faces[parent].tolist())
    normal = np.cross(
        *(mesh.vertices[mesh.faces[:, i]] - mesh.vertices[mesh.faces[:, 0]] for i in (1, 2))
    )
    child = np.cross(
        *(
            working.vertices[working.faces[:, i]] - working.vertices[working.faces[:, 0]]
            for i in (1, 2)
        )
    )
    assert ((child * normal[working.parent_face]).sum(axis=1) > 0.0).all()
    kept = working.input_vertex >= 0
    np.testing.assert_array_equal(working.vertices[kept], mesh.vertices[working.input_vertex[kept]])
