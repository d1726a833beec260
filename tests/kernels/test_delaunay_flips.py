"""Flips of diagonals lead to Delaunay triangulations, and keep creases and the connectivity."""

import nicmm_kernels
import numpy as np
import pytest
from scipy.spatial import Delaunay

from nicmm_core import shapes
from nicmm_core.geometry.mesh import Mesh, opposite_sides


def flipped(vertices, faces, angle=30.0):
    return nicmm_kernels.flip_diagonals(
        np.ascontiguousarray(vertices),
        np.ascontiguousarray(faces),
        opposite_sides(faces).astype(np.int64),
        np.cos(np.radians(angle)),
        1e-9,
        lambda: None,
    )


def as_set(faces):
    return {
        tuple(np.roll(face, -face.argmin())) for face in faces.tolist() for face in [np.array(face)]
    }


def at_random(vertices, faces, generator, flips=400):
    """The faces after flips of random edges of convex quadrilaterals in the plane."""
    faces = faces.copy()

    def area(*corners):
        one, two, three = vertices[list(corners), :2]
        return np.linalg.det(np.stack([two - one, three - one]))

    for _ in range(flips):
        beyond = opposite_sides(faces)
        side = int(generator.integers(faces.size))
        f, g = side // 3, int(beyond[side]) // 3
        if f == g:
            continue
        tip, start, end = np.roll(faces[f], -(side % 3))
        far = faces[g, beyond[side] % 3]
        if min(area(tip, start, far), area(far, end, tip)) > 1e-9:
            faces[f], faces[g] = (tip, start, far), (far, end, tip)
    return faces


@pytest.mark.parametrize("seed", range(4))
def test_the_plane_gets_the_triangulation_of_delaunay(seed):
    generator = np.random.default_rng(seed)
    vertices = np.column_stack([generator.random((60, 2)), np.zeros(60)])
    expected = Delaunay(vertices[:, :2]).simplices.astype(np.int64)
    left = np.cross(*(vertices[expected[:, k]] - vertices[expected[:, 0]] for k in (1, 2)))[:, 2]
    expected[left < 0.0] = expected[left < 0.0][:, ::-1]
    faces = at_random(vertices, expected, generator)
    assert as_set(faces) != as_set(expected)
    assert as_set(flipped(vertices, faces)) == as_set(expected)


def test_squares_are_divided_at_the_vertex_of_least_index():
    vertices = np.array([[x, y, 0.0] for x in range(5) for y in range(5)])
    squares = np.array([[i, i + 5, i + 6, i + 1] for i in range(19) if i % 5 < 4])
    one = np.concatenate([squares[:, [0, 1, 2]], squares[:, [0, 2, 3]]])
    other = np.concatenate([squares[:, [0, 1, 3]], squares[:, [1, 2, 3]]])
    assert as_set(one) != as_set(other)
    assert as_set(flipped(vertices, other)) == as_set(flipped(vertices, one)) == as_set(one)


def test_sharp_edges_stay():
    box = shapes.cube(4)
    # Tall faces, in which the edges of the box are long.
    tall = Mesh(box.vertices * [1.0, 1.0, 6.0], box.faces)
    edges = {tuple(sorted(edge)) for edge in tall.edges.tolist()}
    normals, beyond = tall.face_normals, tall.opposite_sides
    sharp = {
        tuple(sorted(np.delete(tall.faces[s // 3], s % 3).tolist()))
        for s in range(tall.faces.size)
        if normals[s // 3] @ normals[beyond[s] // 3] < 0.5
    }
    after = Mesh(tall.vertices, flipped(tall.vertices, tall.faces, 60.0))
    assert sharp and sharp <= edges
    assert sharp <= {tuple(sorted(edge)) for edge in after.edges.tolist()}
    assert after.face_areas.sum() == pytest.approx(tall.face_areas.sum())


def test_no_edge_comes_twice():
    """Two flat pyramids on one triangle: every flip would join the tips by another edge."""
    angle = 2.0 * np.pi / 3.0 * np.arange(3)
    base = np.column_stack([np.cos(angle), np.sin(angle), np.zeros(3)])
    for height in (0.02, 0.2):
        vertices = np.concatenate([base, [[0.0, 0.0, height], [0.0, 0.0, -height]]])
        faces = np.array([[i, (i + 1) % 3, 3] for i in range(3)])
        both = np.concatenate([faces, np.where(faces == 3, 4, faces)[:, [1, 0, 2]]])
        after = Mesh(vertices, flipped(vertices, both, 170.0))
        assert not after.has_nonmanifold_edges and after.is_oriented
        assert len(after.unpaired_edges[0]) == 0


def test_vertices_with_two_fans_get_no_new_edges():
    """A sphere that touches itself at a vertex stays one surface with edges of two faces."""
    ball = shapes.creature(1, faces=300, subdivisions=0)
    joined = ball.faces.copy()
    joined[joined == 7] = 100
    mesh = Mesh(ball.vertices, joined)
    if mesh.has_nonmanifold_edges:
        pytest.fail("the two vertices are neighbours; take others")
    after = Mesh(mesh.vertices, flipped(mesh.vertices, mesh.faces, 60.0))
    assert as_set(after.faces) != as_set(mesh.faces)
    assert not after.has_nonmanifold_edges and not len(after.unpaired_edges[0])


def test_orientations_that_differ_stay_apart():
    """Edges of faces with opposite orientations are not flipped, and nothing else goes wrong."""
    body = shapes.creature(2, faces=300, subdivisions=0)
    faces = body.faces.copy()
    faces[::7] = faces[::7, ::-1]
    after = Mesh(body.vertices, flipped(body.vertices, faces, 60.0))
    assert not after.has_nonmanifold_edges and not len(after.unpaired_edges[0])
