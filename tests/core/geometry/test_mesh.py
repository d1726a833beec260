"""Tests that a mesh refuses invalid arrays and never changes the given ones."""

import warnings

import numpy as np
import pytest

import nicmm_core as nicmm
from nicmm_core import shapes
from nicmm_core.geometry.mesh import unique_edges
from tests.core.checks import flipped, joined

CORNERS = [[0.0, 0.0, 0.0], [3.0, 0.0, 0.0], [0.0, 4.0, 0.0], [0.0, 0.0, 1.0]]
FACES = [[0, 1, 2], [0, 3, 1]]

BAD_VERTICES = {
    "two columns": np.zeros((4, 2)),
    "one dimension": np.zeros(12),
    "three dimensions": np.zeros((4, 3, 1)),
    "ragged": [[0, 0, 0], [1, 0]],
    "text": [["a", "b", "c"]],
    "none": None,
    "complex": np.zeros((4, 3)) * 1j,
    "NaN": [[0, 0, 0], [3, 0, np.nan], [0, 4, 0], [0, 0, 1]],
    "infinite": [[0, 0, 0], [3, 0, 0], [0, -np.inf, 0], [0, 0, 1]],
}

BAD_FACES = {
    "quads": [[0, 1, 2, 3]],
    "one dimension": [0, 1, 2],
    "three dimensions": [[[0, 1, 2]]],
    "ragged": [[0, 1, 2], [0, 1]],
    "text": [["a", "b", "c"]],
    "none": None,
    "fractions": [[0.5, 1, 2]],
    "NaN": [[np.nan, 1, 2]],
    "infinite": [[np.inf, 1, 2]],
    "complex": np.array([[0, 1, 2j]]),
    "past the end": [[0, 1, 4]],
    "negative": [[0, 1, -1]],
    "beyond 64 bits": [[0, 1, 2**63]],
    "repeated first and last": [[0, 1, 0]],
    "repeated neighbours": [[0, 1, 2], [1, 1, 2]],
    "empty": np.zeros((0, 3), dtype=int),
    "empty list": [],
}


@pytest.mark.parametrize("vertices", BAD_VERTICES.values(), ids=BAD_VERTICES.keys())
def test_bad_vertices_are_refused_by_name(vertices):
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        with pytest.raises(nicmm.MeshError, match="^vertices"):
            nicmm.Mesh(vertices, FACES)


@pytest.mark.parametrize("faces", BAD_FACES.values(), ids=BAD_FACES.keys())
def test_bad_faces_are_refused_by_name(faces):
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        with pytest.raises(nicmm.MeshError, match="^faces"):
            nicmm.Mesh(CORNERS, faces)


def test_message_names_the_offender():
    with pytest.raises(nicmm.MeshError, match=r"index 2"):
        nicmm.Mesh([[0, 0, 0], [1, 0, 0], [0, np.nan, 0]], [[0, 1, 2]])
    with pytest.raises(nicmm.MeshError, match=r"faces\[1\] = \[0, 3, 9\].*0 … 3"):
        nicmm.Mesh(CORNERS, [[0, 1, 2], [0, 3, 9]])


def test_whole_numbers_in_floats_are_indices():
    assert nicmm.Mesh(CORNERS, np.array(FACES, dtype=float)).faces.dtype.kind == "i"


def test_arrays_are_read_only_copies():
    vertices, faces = np.array(CORNERS), np.array(FACES)
    mesh = nicmm.Mesh(vertices, faces)
    vertices += 1.0
    faces[:] = 0
    np.testing.assert_array_equal(mesh.vertices, CORNERS)
    np.testing.assert_array_equal(mesh.faces, FACES)
    for array in (mesh.vertices, mesh.faces):
        with pytest.raises(ValueError, match="read-only"):
            array[0] = 1


def test_areas_and_diagonal_by_hand():
    mesh = nicmm.Mesh(CORNERS, FACES)
    np.testing.assert_allclose(mesh.face_areas, [6.0, 1.5])
    assert mesh.diagonal == pytest.approx(np.sqrt(9 + 16 + 1))


def test_components_are_told_apart(small_ball, ring):
    mesh = joined(small_ball, ring, small_ball)
    sizes = [len(small_ball.faces), len(ring.faces), len(small_ball.faces)]
    assert len(np.unique(mesh.face_component)) == 3
    parts = np.split(mesh.face_component, np.cumsum(sizes)[:-1])
    assert [len(np.unique(part)) for part in parts] == [1, 1, 1]


def test_faces_that_share_a_vertex_are_one_component():
    mesh = nicmm.Mesh(np.eye(5, 3), [[0, 1, 2], [2, 3, 4]])
    assert len(np.unique(mesh.face_component)) == 1


def test_unreferenced_vertices_are_allowed_and_do_not_count():
    mesh = nicmm.Mesh([*CORNERS, [1e6, 0.0, 0.0]], FACES)
    np.testing.assert_array_equal(mesh.referenced, [True, True, True, True, False])
    assert mesh.diagonal == nicmm.Mesh(CORNERS, FACES).diagonal


def sides(mesh):
    """Faces and opposite corners by the vertices of a side."""
    found = {}
    for face, corners in enumerate(mesh.faces.tolist()):
        for corner in range(3):
            side = frozenset(corners[:corner] + corners[corner + 1 :])
            found.setdefault(side, []).append((face, corner))
    return found


@pytest.mark.parametrize("seed", [0, 1])
def test_neighbours_have_the_side_in_common(surface, seed):
    """Also where orientations disagree; the neighbour is -1 exactly at the boundary."""
    mesh = flipped(surface, seed)
    expected = np.full(mesh.faces.shape, -1)
    for sharing in sides(mesh).values():
        if len(sharing) == 2:
            (one, corner), (other, other_corner) = sharing
            expected[one, corner], expected[other, other_corner] = other, one
    np.testing.assert_array_equal(mesh.face_neighbours, expected)


def test_no_neighbour_lies_beyond_an_edge_of_three_faces():
    mesh = nicmm.Mesh(np.eye(5, 3), [[0, 1, 2], [1, 0, 3], [0, 1, 4], [2, 1, 3]])
    expected = [[3, -1, -1], [-1, 3, -1], [-1, -1, -1], [1, -1, 0]]
    np.testing.assert_array_equal(mesh.face_neighbours, expected)


def test_normals_are_unit_vectors_across_their_faces_by_the_right_hand(body):
    corner = body.vertices[body.faces]
    normal = body.face_normals
    np.testing.assert_allclose(np.linalg.norm(normal, axis=1), 1.0)
    edges = np.roll(corner, -1, axis=1) - corner
    np.testing.assert_allclose(np.einsum("fed,fd->fe", edges, normal), 0.0, atol=1e-12)
    volume = np.linalg.det(np.stack([edges[:, 0], edges[:, 1], normal], axis=1))
    np.testing.assert_allclose(volume, 2.0 * body.face_areas)


def test_a_face_without_area_has_no_normal():
    mesh = nicmm.Mesh([[0, 0, 0], [1, 0, 0], [2, 0, 0], [0, 0, 5]], [[0, 1, 2], [0, 1, 3]])
    np.testing.assert_array_equal(mesh.face_normals, [[0, 0, 0], [0, -1, 0]])


def test_only_vertices_of_a_face_turned_over_are_unoriented(ball):
    assert len(ball.unoriented_vertices) == 0
    faces = ball.faces.copy()
    faces[37] = faces[37, ::-1]
    turned = nicmm.Mesh(ball.vertices, faces)
    np.testing.assert_array_equal(turned.unoriented_vertices, np.sort(faces[37]))


def test_a_moebius_strip_is_unoriented_across_its_seam_and_nowhere_else():
    strip = shapes.moebius_strip(12, 3)
    # The first ring, which is joined to the last one with a twist.
    np.testing.assert_array_equal(strip.unoriented_vertices, np.arange(4))


def test_edges_are_those_of_the_faces_once_each(surface):
    expected, _ = unique_edges(surface.faces)
    found = np.sort(surface.edges, axis=1)
    assert len(found) == len(expected)
    assert np.array_equal(np.unique(found, axis=0), expected)


def test_an_edge_of_three_faces_is_one_edge():
    fan = nicmm.Mesh(np.eye(5, 3), [[0, 1, 2], [1, 0, 3], [0, 1, 4]])
    assert len(fan.edges) == len(unique_edges(fan.faces)[0])
