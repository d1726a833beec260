"""Tests of meshes of other libraries, by objects with the same attributes."""

from types import SimpleNamespace

import numpy as np
import pytest

import nicmm_core as nicmm


@pytest.mark.slow
def test_any_object_with_vertices_and_faces(small_ball):
    other = SimpleNamespace(
        vertices=small_ball.vertices.tolist(), faces=small_ball.faces.astype(np.uint32)
    )
    points = [3, 60, 100]
    curve = nicmm.design_curve(other, points).curves[0]
    np.testing.assert_array_equal(
        curve.points, nicmm.design_curve(small_ball, points).curves[0].points
    )
    assert curve.measures(other)["length"] == curve.length
    assert len(nicmm.cut_mesh(other, curve).faces) > len(small_ball.faces)
    assert len(nicmm.sharp_edge_map(other)) == len(small_ball.vertices)


def test_a_mesh_is_not_copied(small_ball):
    assert nicmm.as_mesh(small_ball) is small_ball


def test_open3d(small_ball):
    other = SimpleNamespace(vertices=small_ball.vertices, triangles=small_ball.faces)
    np.testing.assert_array_equal(nicmm.from_open3d(other).faces, small_ball.faces)


def test_meshio_takes_triangles_and_quadrilaterals():
    blocks = [
        SimpleNamespace(type="line", data=[[0, 1]]),
        SimpleNamespace(type="triangle", data=[[0, 1, 4]]),
        SimpleNamespace(type="quad", data=np.array([[0, 1, 2, 3]])),
    ]
    points = [[0, 0], [1, 0], [1, 1], [0, 1], [0.5, -1]]
    mesh = nicmm.from_meshio(SimpleNamespace(points=points, cells=blocks))
    assert mesh.faces.tolist() == [[0, 1, 4], [0, 1, 2], [0, 2, 3]]
    assert mesh.vertices[4].tolist() == [0.5, -1.0, 0.0]


def test_meshio_without_a_surface():
    blocks = [SimpleNamespace(type="tetra", data=[[0, 1, 2, 3]])]
    with pytest.raises(nicmm.MeshError, match="tetra.*extract its surface"):
        nicmm.from_meshio(SimpleNamespace(points=np.eye(4, 3), cells=blocks))


@pytest.mark.parametrize("read", [nicmm.as_mesh, nicmm.from_open3d, nicmm.from_meshio])
def test_something_else(read):
    with pytest.raises(nicmm.ArgumentError, match="mesh is a float"):
        read(3.0)
