"""The section of a mesh with a plane: complete, on the plane, and its point nearest to a place."""

import numpy as np
import pytest

import nicmm_core as nicmm
from nicmm_core import shapes
from nicmm_core.geometry.mirror import ON_PLANE, Plane
from nicmm_core.geometry.plane_section import plane_section

X = Plane(np.zeros(3), np.array([1.0, 0.0, 0.0]))


@pytest.mark.parametrize("offset", [0.0, 0.2, -0.37])
def test_section_of_a_sphere(offset):
    mesh = shapes.sphere()
    plane = Plane(np.array([offset, 0.0, 0.0]), X.normal)
    section = plane_section(mesh, plane)
    corners = mesh.vertices[mesh.faces[section.faces]]
    np.testing.assert_allclose(section.barycentric @ corners, section.positions, atol=1e-12)
    heights = plane.heights(section.positions.reshape(-1, 3))
    assert np.abs(heights).max() <= ON_PLANE * mesh.diagonal
    lengths = np.linalg.norm(np.diff(section.positions, axis=1), axis=2)[:, 0]
    # A segment on an edge of the mesh appears twice, once for each face.
    on_edge = (section.barycentric == 0.0).all(axis=1).any(axis=1)
    length = lengths.sum() - 0.5 * lengths[on_edge].sum()
    assert length == pytest.approx(2 * np.pi * np.sqrt(1 - offset**2), rel=0.02)


def test_along_edges_and_through_vertices():
    """Two squares that share an edge on the plane, and a face that touches it at a corner."""
    vertices = [[-1, 0, 0], [0, 0, 0], [1, 0, 0], [-1, 1, 0], [0, 1, 0], [1, 1, 0], [2, 0.5, 0]]
    faces = [[0, 1, 4], [0, 4, 3], [1, 2, 5], [1, 5, 4], [2, 6, 5]]
    mesh = nicmm.Mesh(np.array(vertices, dtype=float), faces)
    section = plane_section(mesh, X)
    assert sorted(section.faces.tolist()) == [0, 3]
    assert np.abs(section.positions[..., 0]).max() == 0.0
    nearest = section.nearest(np.array([0.3, 0.25, 0.1]))
    np.testing.assert_allclose(nearest.positions(mesh), [[0.0, 0.25, 0.0]], atol=1e-12)
    nearest = section.nearest(np.array([0.3, 7.0, 0.1]))
    np.testing.assert_allclose(nearest.positions(mesh), [[0.0, 1.0, 0.0]], atol=1e-12)


def test_a_plane_beside_the_mesh():
    section = plane_section(shapes.sphere(), Plane(np.array([5.0, 0.0, 0.0]), X.normal))
    assert len(section.faces) == 0
    assert section.nearest(np.zeros(3)) is None


def test_faces_in_the_plane_are_left_out():
    """Only the edges of the bottom of a box remain, from its walls."""
    corners = np.array([[x, y, z] for x in (0, 1) for y in (0, 1) for z in (0, 1)], dtype=float)
    bottom, wall = [[0, 1, 3], [0, 3, 2]], [[0, 5, 1], [0, 4, 5]]
    section = plane_section(nicmm.Mesh(corners, [*bottom, *wall]), X)
    assert section.faces.tolist() == [2]
    lengths = np.linalg.norm(np.diff(section.positions, axis=1), axis=2)
    np.testing.assert_allclose(lengths, [[1.0]])
