"""Tests that numbering, pose and size of a mesh affect neither the new numbering nor the curve."""

import igl
import numpy as np
import pytest

import nicmm_core as nicmm
from nicmm_core import shapes
from nicmm_core.coarsening import coarse_start
from nicmm_core.geometry.numbering import (
    RESOLUTIONS,
    frame_of_points,
    principal_frame,
    renumbered,
    uniform_hash,
)
from tests.core.checks import apart, random_surface_points


def shuffled(mesh, seed):
    """Mesh with vertices and faces in another order, and the new index of each vertex."""
    generator = np.random.default_rng(seed)
    number = generator.permutation(len(mesh.vertices))
    vertices = np.empty_like(mesh.vertices)
    vertices[number] = mesh.vertices
    faces = number[mesh.faces][generator.permutation(len(mesh.faces))]
    return nicmm.Mesh(vertices, np.roll(faces, int(seed), axis=1)), number


def rotation(seed):
    turned, _ = np.linalg.qr(np.random.default_rng(seed).normal(size=(3, 3)))
    return turned * np.sign(np.linalg.det(turned))


def frame_of(mesh):
    return principal_frame(mesh.vertices, mesh.faces, mesh.face_areas)


@pytest.mark.parametrize("seed", range(3))
def test_shuffled_meshes_become_the_same(body, seed):
    one, other = renumbered(body), renumbered(shuffled(body, seed)[0])
    np.testing.assert_array_equal(one.mesh.vertices, other.mesh.vertices)
    np.testing.assert_array_equal(one.mesh.faces, other.mesh.faces)


def test_mirror_images_become_the_same(body):
    mirrored = nicmm.Mesh(body.vertices * [1.0, -1.0, 1.0], body.faces[:, ::-1])
    one, other = renumbered(body), renumbered(mirrored)
    np.testing.assert_array_equal(one.mesh.vertices, other.mesh.vertices)
    np.testing.assert_array_equal(one.mesh.faces, other.mesh.faces)


@pytest.mark.parametrize("seed", range(3))
def test_rigid_motions_and_scales_keep_the_numbers(body, seed):
    moved = nicmm.Mesh(3.7 * body.vertices @ rotation(seed).T + [5.0, -2.0, 1.0], body.faces)
    one, other = renumbered(moved), renumbered(body)
    np.testing.assert_array_equal(one.vertex, other.vertex)
    np.testing.assert_array_equal(one.mesh.vertices, other.mesh.vertices)
    assert one.frame.unit == pytest.approx(3.7 * other.frame.unit)
    at, there = (frame_of(mesh).rounded_coordinates(mesh.vertices) for mesh in (body, moved))
    np.testing.assert_array_equal(there, at)


def test_frames_depend_on_the_surface_only():
    """Finer triangles of the same surface have the same frame."""
    corners = np.random.default_rng(5).normal(size=(4, 3))
    coarse = nicmm.Mesh(corners, [[0, 2, 1], [0, 1, 3], [1, 2, 3], [2, 0, 3]])
    fine = nicmm.Mesh(*igl.upsample(coarse.vertices, coarse.faces, 4))
    one, other = map(frame_of, (coarse, fine))
    np.testing.assert_allclose(one.centre, other.centre, atol=1e-12)
    np.testing.assert_allclose(one.axes, other.axes, atol=1e-9)
    weights = coarse.face_areas / coarse.face_areas.sum()
    np.testing.assert_allclose(one.centre, weights @ corners[coarse.faces].mean(axis=1), atol=1e-12)


def test_a_symmetric_body_has_one_frame_at_any_size():
    """The axes of a cube are those of space, whatever the diagonals of its squares."""
    cube = shapes.cube()
    for factor in (1.0, 1e6, 1e-6):
        frame = frame_of(nicmm.Mesh(factor * cube.vertices, cube.faces))
        np.testing.assert_allclose(frame.axes, np.eye(3), atol=1e-9)


@pytest.mark.slow
def test_points_values_and_curves_are_mapped(surface):
    there = renumbered(surface)
    frame = frame_of_points(surface.vertices[surface.referenced])

    def in_frame(positions):
        return (positions - frame.centre) @ frame.axes / frame.unit

    assert 0.4 < there.mesh.face_areas.sum() < 1.2
    points = random_surface_points(surface, 7, 0)
    mapped = there.points_to(points).positions(there.mesh)
    np.testing.assert_allclose(mapped, in_frame(points.positions(surface)), atol=RESOLUTIONS[0])
    back = there.in_original(mapped)
    atol = 2.0 * RESOLUTIONS[0] * there.frame.unit
    np.testing.assert_allclose(back, points.positions(surface), atol=atol)
    values = there.weights_to(in_frame(surface.vertices)[:, 0].copy())
    np.testing.assert_allclose(values, there.mesh.vertices[:, 0], atol=RESOLUTIONS[0])
    lengths = there.field_back(there.mesh.vertices[:, 0])
    np.testing.assert_array_equal(
        lengths[there.vertex], there.frame.unit * there.mesh.vertices[:, 0]
    )
    normals = surface.face_normals[there.face] @ frame.axes
    np.testing.assert_allclose(there.mesh.face_normals, normals, atol=100.0 * RESOLUTIONS[0])
    chosen = np.flatnonzero(there.mesh.referenced)[[3, 40, 80]]
    curve = nicmm.design_curve(there.mesh, chosen, order="shortest").curves[0]
    on_original = there.curve_back(curve)
    np.testing.assert_allclose(in_frame(on_original.points), curve.points, atol=RESOLUTIONS[0])
    again = there.curve_to(on_original)
    np.testing.assert_array_equal(again.faces, curve.faces)
    np.testing.assert_array_equal(again.barycentric, curve.barycentric)


@pytest.mark.parametrize(
    "width, resolution", [(1.0, 1e-5), (1e-5, 1e-7), (1e-7, 1e-9), (1e-9, None)]
)
def test_coordinates_are_rounded_as_coarsely_as_needles_allow(width, resolution):
    vertices = np.array(
        [[0, 0, 0], [1, 0, 0], [0, 1, 0], [1.0, width, 0.2 * width], [0.5, 0.5, 0.3]]
    )
    mesh = nicmm.Mesh(vertices, [[0, 2, 1], [0, 1, 3], [1, 2, 4]])
    copy = renumbered(mesh)
    areas = copy.frame.unit**2 * copy.mesh.face_areas
    np.testing.assert_allclose(areas, mesh.face_areas[copy.face], rtol=0.06)

    def off(unit):
        multiples = copy.mesh.vertices / unit
        return np.abs(multiples - np.round(multiples)).max()

    found = [each for each in RESOLUTIONS if off(each) < 1e-3]
    assert found[:1] == ([] if resolution is None else [resolution])


def test_vertices_that_were_moved_apart_stay_apart(body):
    vertices = body.vertices.copy()
    vertices[7] = vertices[40] + 3e-6
    close = nicmm.Mesh(vertices, body.faces)
    frame = frame_of_points(vertices)
    expected = (vertices - frame.centre) @ frame.axes / frame.unit
    for is_kept, resolution in ((True, 1e-7), (False, 1e-5)):
        there = renumbered(close, apart=is_kept)
        found = there.mesh.vertices[np.argsort(there.vertex)]
        np.testing.assert_allclose(found, expected, atol=resolution)
        assert (found[7] != found[40]).any() == is_kept


def test_hash_is_uniform_and_knows_every_bit():
    coordinates = np.stack(np.meshgrid(*[np.arange(-20, 20)] * 3), axis=-1).reshape(-1, 3)
    found = uniform_hash(coordinates)
    assert 0.0 < found.min() and found.max() < 1.0
    assert len(np.unique(found)) == len(found)
    share, _ = np.histogram(found, bins=20, range=(0.0, 1.0))
    assert np.abs(share / len(found) - 0.05).max() < 0.005
    beside = uniform_hash(coordinates + [1, 0, 0])
    assert abs(np.corrcoef(found, beside)[0, 1]) < 0.02


@pytest.mark.slow
@pytest.mark.parametrize("subdivisions", [1, 2])
@pytest.mark.parametrize("closed", [True, False])
def test_numbers_of_a_mesh_do_not_decide_the_course(subdivisions, closed):
    """On small meshes and on those with a coarse mesh, and for any order of the points."""
    moved = []
    for seed in range(2):
        mesh = shapes.creature(seed, resolution=32, faces=1000, subdivisions=subdivisions)
        assert (len(mesh.vertices) > coarse_start.LARGE) == (subdivisions == 2)
        generator = np.random.default_rng(seed)
        chosen = generator.choice(len(mesh.vertices), 5, replace=False)
        curve = nicmm.design_curve(mesh, chosen, order="shortest", closed=closed).curves[0]
        other, number = shuffled(mesh, seed + 1)
        points = generator.permutation(number[chosen])
        again = nicmm.design_curve(other, points, order="shortest", closed=closed).curves[0]
        moved.append(apart(curve.points, again.points) / mesh.diagonal)
    assert max(moved) < 1e-12


@pytest.mark.slow
@pytest.mark.parametrize("mirror", [1.0, -1.0])
def test_motions_and_mirrors_do_not_decide_the_course(mirror):
    moved = []
    for seed in range(3):
        mesh = shapes.creature(seed, resolution=32, faces=1000)
        chosen = np.random.default_rng(seed).choice(len(mesh.vertices), 4, replace=False)
        curve = nicmm.design_curve(mesh, chosen, order="shortest").curves[0]
        matrix = 2.0 * rotation(seed) * [mirror, 1.0, 1.0]
        faces = mesh.faces if mirror > 0.0 else mesh.faces[:, ::-1]
        turned = nicmm.Mesh(mesh.vertices @ matrix.T + [1.0, 2.0, 3.0], faces)
        again = nicmm.design_curve(turned, chosen, order="shortest").curves[0]
        back = (again.points - [1.0, 2.0, 3.0]) @ np.linalg.inv(matrix).T
        moved.append(apart(curve.points, back) / mesh.diagonal)
    assert max(moved) < 1e-12


@pytest.mark.slow
def test_numbers_do_not_decide_the_course_through_points_inside_faces():
    """Their coordinates differ by rounding errors, so the curves do too, but not the courses."""
    moved = []
    for seed in range(3):
        mesh = shapes.creature(seed, resolution=32, faces=1000)
        points = random_surface_points(mesh, 4, seed).positions(mesh)
        curve = nicmm.design_curve(mesh, points, order="shortest").curves[0]
        other, _ = shuffled(mesh, seed + 1)
        turned = nicmm.Mesh(other.vertices @ rotation(seed).T, other.faces)
        again = nicmm.design_curve(turned, points @ rotation(seed).T, order="shortest").curves[0]
        moved.append(apart(curve.points, again.points @ rotation(seed)) / mesh.diagonal)
    assert max(moved) < 1e-6


def test_other_components_make_no_difference(body):
    alone = renumbered(body)
    far = body.vertices[:, [1, 2, 0]] * 3.0 + 50.0
    vertices = np.concatenate([far, body.vertices, [[9.0, 9.0, 9.0]]])
    faces = np.concatenate([body.faces, body.faces + len(far)])
    together = nicmm.Mesh(vertices, faces)
    component = int(together.face_component[-1])
    there = renumbered(together, component)
    np.testing.assert_array_equal(there.mesh.faces, alone.mesh.faces)
    np.testing.assert_allclose(there.mesh.vertices, alone.mesh.vertices, atol=1e-12)
    values = np.arange(len(vertices), dtype=float)
    np.testing.assert_array_equal(
        there.weights_to(values), alone.weights_to(np.arange(len(far), dtype=float)) + len(far)
    )
