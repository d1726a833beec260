"""Tests maps computed from the mesh: closed forms, invariances and errors."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import nicmm_core as nicmm
from nicmm_core import shapes
from nicmm_core.maps.feature_maps import SHARP_ANGLE
from tests.oracles import same_surface


def tube(radius=0.5, around=40, along=21):
    """An open cylinder about the z axis, with height 3."""
    angle = np.arange(around) * 2 * np.pi / around
    height = np.linspace(0.0, 3.0, along)
    index = np.arange(around * along).reshape(along, around)
    a, b = index[:-1], np.roll(index, -1, axis=1)[:-1]
    c, d = np.roll(index, -1, axis=1)[1:], index[1:]
    ring = radius * np.stack([np.cos(angle), np.sin(angle)], axis=1)
    vertices = np.concatenate(
        [np.tile(ring, (along, 1)), np.repeat(height, around)[:, None]], axis=1
    )
    faces = np.concatenate([np.stack([a, b, c], axis=-1), np.stack([a, c, d], axis=-1)])
    return nicmm.Mesh(vertices, faces.reshape(-1, 3))


def on_edges_of_cube(mesh):
    return np.isclose(np.abs(mesh.vertices), 1.0).sum(axis=1) >= 2


def moved(mesh, scale=1e3):
    turn = Rotation.from_rotvec([0.4, -1.1, 0.7])
    return nicmm.Mesh(scale * turn.apply(mesh.vertices.copy()) + [3.0, 1.0, -2.0], mesh.faces)


def with_faces_turned(mesh):
    """The mesh with every third face reversed."""
    faces = mesh.faces.copy()
    faces[::3] = faces[::3, ::-1]
    return nicmm.Mesh(mesh.vertices, faces)


def folded(angle, turned=False):
    """Two triangles that share an edge on the x axis and meet at an angle."""
    tip = [0.5, -np.cos(angle), np.sin(angle)]
    second = [0, 1, 3] if turned else [1, 0, 3]
    return nicmm.Mesh([[0, 0, 0], [1, 0, 0], [0.5, 1, 0], tip], [[0, 1, 2], second])


class TestCurvature:
    def test_of_a_sphere(self):
        curvature = np.abs(nicmm.principal_curvatures(shapes.sphere(4)))
        np.testing.assert_allclose(curvature, 1.0, rtol=0.01)

    def test_falls_on_the_right_value_as_the_mesh_gets_finer(self):
        errors = [
            np.abs(np.abs(nicmm.principal_curvatures(shapes.sphere(level))) - 1.0).max()
            for level in (2, 3, 4)
        ]
        assert errors[1] < 0.35 * errors[0] and errors[2] < 0.35 * errors[1]

    def test_of_a_cylinder(self):
        mesh = tube()
        inside = (mesh.vertices[:, 2] > 0.4) & (mesh.vertices[:, 2] < 2.6)
        curvature = np.sort(np.abs(nicmm.principal_curvatures(mesh)[inside]), axis=1)
        np.testing.assert_allclose(curvature[:, 1], 2.0, rtol=0.03)
        np.testing.assert_allclose(curvature[:, 0], 0.0, atol=0.01)

    def test_of_a_torus(self):
        """They are 1 / 0.4 around the tube and cos v / (1 + 0.4 cos v) around the axis."""
        mesh = shapes.torus()
        radius = np.linalg.norm(mesh.vertices[:, :2], axis=1)
        around = (radius - 1.0) / 0.4 / radius
        curvature = nicmm.principal_curvatures(mesh)
        curvature *= np.sign(curvature.sum(axis=1, keepdims=True))
        curvature.sort(axis=1)
        np.testing.assert_allclose(curvature[:, 1], 2.5, rtol=0.03)
        np.testing.assert_allclose(curvature[:, 0], around, atol=0.03)

    def test_of_a_plane_is_nothing(self, flat_disc):
        assert np.abs(nicmm.principal_curvatures(flat_disc)).max() < 1e-9

    def test_needs_no_orientation(self):
        """Signs depend on the orientation, and on a Möbius strip no choice is consistent."""
        mesh = shapes.torus(around=36, across=18)
        plain, turned = (
            np.sort(np.abs(nicmm.principal_curvatures(one)), axis=1)
            for one in (mesh, with_faces_turned(mesh))
        )
        np.testing.assert_allclose(turned, plain, rtol=0.05, atol=0.02)
        strip = np.abs(nicmm.principal_curvatures(shapes.moebius_strip())).max(axis=1)
        assert strip.max() < 2.0

    def test_a_vertex_with_many_neighbours_costs_no_more_than_the_mesh(self):
        """On a pyramid with 20,000 faces, the tip puts all vertices into each other's two-ring."""
        angle = np.arange(20_000) * 2 * np.pi / 20_000
        rim = np.stack([np.cos(angle), np.sin(angle), 0.0 * angle], axis=1)
        onward = np.roll(np.arange(len(rim)), -1)
        faces = np.stack([np.arange(len(rim)), onward, np.full(len(rim), len(rim))], axis=1)
        mesh = nicmm.Mesh(np.concatenate([rim, [[0, 0, 1.0]]]), faces)
        assert np.isfinite(nicmm.principal_curvatures(mesh)).all()


class TestCurvatureMap:
    @pytest.mark.parametrize("name", ["ball", "ring", "flat_disc"])
    def test_nothing_stands_out_where_all_is_alike(self, name, request):
        assert nicmm.curvature_map(request.getfixturevalue(name)).max() < 0.05

    def test_limits_are_curvatures(self, ball):
        weights = nicmm.curvature_map(ball, low=0.0, high=2.0)
        np.testing.assert_allclose(weights, 0.5, atol=0.02)

    def test_is_greatest_at_the_edges_of_a_cube(self):
        mesh = shapes.cube()
        weights = nicmm.curvature_map(mesh)
        edge = on_edges_of_cube(mesh)
        assert weights[edge].min() > 0.8
        inside = (np.abs(mesh.vertices) < 0.6).sum(axis=1) == 2
        assert weights[inside].max() < 0.1

    @pytest.mark.parametrize("scale", [1e-3, 1e3])
    def test_does_not_know_where_and_how_large_the_mesh_is(self, body, scale):
        plain = nicmm.curvature_map(body)
        assert 0.05 < plain.mean() < 0.5 and plain.max() == 1.0
        np.testing.assert_allclose(nicmm.curvature_map(moved(body, scale)), plain, atol=1e-6)

    def test_of_meshes_of_every_kind(self):
        """Unreferenced vertices, faces without area, an edge with three faces, and single faces."""
        vertices = [[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1], [0, -1, 0], [2, 0, 0], [9, 9, 9]]
        for faces in ([[0, 1, 2]], [[0, 1, 2], [1, 0, 3], [0, 1, 4]], [[0, 1, 2], [0, 1, 5]]):
            mesh = nicmm.Mesh(vertices, faces)
            for weights in (nicmm.curvature_map(mesh), nicmm.sharp_edge_map(mesh)):
                assert weights.shape == (7,)
                assert ((weights >= 0.0) & (weights <= 1.0)).all()


class TestSharpEdges:
    def test_of_a_cube(self):
        mesh = shapes.cube()
        np.testing.assert_array_equal(nicmm.sharp_edge_map(mesh), on_edges_of_cube(mesh))
        assert len(nicmm.sharp_edges(mesh)) == 12 * 8

    @pytest.mark.parametrize("name", ["ball", "flat_disc"])
    def test_of_what_has_none(self, name, request):
        assert not nicmm.sharp_edge_map(request.getfixturevalue(name)).any()

    @pytest.mark.parametrize("turned", [False, True])
    @pytest.mark.parametrize("degrees", [0.0, 10.0, 89.0, 91.0, 170.0])
    def test_angle_is_that_of_the_normals(self, degrees, turned):
        mesh = folded(np.radians(degrees), turned)
        for limit in (5.0, 45.0, 90.0, 135.0):
            found = nicmm.sharp_edges(mesh, np.radians(limit)).tolist()
            assert found == ([[0, 1]] if degrees > limit else [])

    def test_do_not_change_with_place_scale_and_orientation(self, body):
        plain = nicmm.sharp_edges(body, 0.5)
        assert 0 < len(plain) < len(body.edges)
        for other in (moved(body), moved(body, 1e-3), with_faces_turned(body)):
            np.testing.assert_array_equal(nicmm.sharp_edges(other, 0.5), plain)

    def test_at_an_edge_of_three_faces(self):
        vertices = [[0, 0, 0], [1, 0, 0], [0.5, 1, 0], [0.5, -1, 0], [0.5, 0, 1]]
        mesh = nicmm.Mesh(vertices, [[0, 1, 2], [1, 0, 3], [0, 1, 4]])
        assert nicmm.sharp_edges(mesh).tolist() == [[0, 1]]

    @pytest.mark.parametrize("angle", [-0.1, 4.0, np.nan, "right", None])
    def test_wrong_angles(self, ball, angle):
        with pytest.raises(nicmm.ArgumentError, match="^angle"):
            nicmm.sharp_edge_map(ball, angle)


class TestEdgeMap:
    def test_both_ends_count(self, ball):
        edges = ball.edges[:5, ::-1]
        weights = nicmm.edge_map(ball, edges)
        np.testing.assert_array_equal(np.flatnonzero(weights), np.unique(edges))
        assert set(weights) == {0.0, 1.0}

    @pytest.mark.parametrize("nothing", [[], np.zeros((0, 2), dtype=int)])
    def test_none_at_all(self, ball, nothing):
        assert not nicmm.edge_map(ball, nothing).any()

    @pytest.mark.parametrize(
        "edges", [[[0, 10**6]], [[-1, 0]], [0, 1], [[0.5, 1.5]], [["a", "b"]], [[0, 1, 2]]]
    )
    def test_wrong_edges(self, ball, edges):
        with pytest.raises(nicmm.ArgumentError, match="^edges"):
            nicmm.edge_map(ball, edges)

    def test_pairs_that_no_face_joins(self, ball):
        far = int(np.linalg.norm(ball.vertices - ball.vertices[0], axis=1).argmax())
        with pytest.raises(nicmm.ArgumentError, match="not an edge of a face"):
            nicmm.edge_map(ball, [[0, far]])


class TestValueMap:
    def test_is_linear_between_its_limits(self, ball):
        height = ball.vertices[:, 2]
        np.testing.assert_allclose(nicmm.value_map(ball, height), (height + 1) / 2, atol=1e-12)
        np.testing.assert_allclose(
            nicmm.value_map(ball, height, low=0.0, high=0.5), np.clip(2 * height, 0, 1)
        )
        np.testing.assert_allclose(
            nicmm.value_map(ball, height, low=1.0, high=-1.0), (1 - height) / 2, atol=1e-12
        )

    def test_knows_no_unit(self, body):
        height = body.vertices[:, 2]
        plain = nicmm.value_map(body, height)
        for factor in (1e-200, 1e200, 1e308):
            np.testing.assert_allclose(nicmm.value_map(body, factor * height), plain, atol=1e-9)

    def test_constant_values_weigh_nothing(self, ball):
        assert not nicmm.value_map(ball, np.full(len(ball.vertices), 7.0)).any()

    @pytest.mark.parametrize(
        ("arguments", "named"),
        [
            ({"values": np.zeros(3)}, "values"),
            ({"values": None}, "values"),
            ({"values": np.full(642, np.nan)}, "values"),
            ({"values": np.arange(642), "low": 1.0, "high": 1.0}, "low and high"),
            ({"values": np.arange(642), "low": "none"}, "low"),
            ({"values": np.arange(642), "high": np.inf}, "high"),
        ],
    )
    def test_wrong_values(self, ball, arguments, named):
        with pytest.raises(nicmm.ArgumentError, match=f"^{named}"):
            nicmm.value_map(ball, **arguments)


def test_default_angle_is_that_of_the_documentation():
    assert np.degrees(SHARP_ANGLE) == pytest.approx(30.0)


@pytest.mark.parametrize("name", ["half of the faces turned", "soup", "turned, doubled soup"])
def test_maps_of_a_changed_mesh_are_the_same(name):
    box = shapes.cube(3)
    one = same_surface.changed(box, name, 4)
    for feature_map in (nicmm.sharp_edge_map, nicmm.curvature_map):
        expected, found = feature_map(box), feature_map(one.mesh)
        np.testing.assert_allclose(found[one.number], expected, atol=1e-6)
