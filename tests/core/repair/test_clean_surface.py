"""Tests that the clean surface depends on the shape of a mesh and not on how its faces share it."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import nicmm_core as nicmm
from nicmm_core import shapes
from nicmm_core.geometry.numbering import renumbered
from nicmm_core.geometry.surface_points import SurfacePoints
from nicmm_core.repair.clean_surface import clean_surfaces
from nicmm_core.repair.nonmanifold import manifold
from tests.core.checks import grid, joined, random_surface_points
from tests.oracles import same_surface
from tests.oracles.defects import defective_meshes, with_fans

HEIGHT = shapes.sphere(2).vertices[:, 2:]
EGG = shapes.sphere(2).vertices * [1.0, 0.8, 1.4] * (1.0 + 0.2 * HEIGHT)

SHAPES = {
    "egg": nicmm.Mesh(EGG, shapes.sphere(2).faces),
    "disc": shapes.disc(6),
    "Möbius strip": shapes.moebius_strip(),
}

PINCHED = SHAPES["egg"].vertices.copy()
PINCHED[[5, 40]] = 0.5 * (PINCHED[5] + PINCHED[40])

WITH_SHARED_POSITIONS = {
    "two vertices at one position": nicmm.Mesh(PINCHED, SHAPES["egg"].faces),
    "one vertex with two fans": nicmm.Mesh(
        PINCHED, np.where(SHAPES["egg"].faces == 40, 5, SHAPES["egg"].faces)
    ),
}

DEFECTIVE = dict(defective_meshes())

EXACT = [*same_surface.SAME_CURVE, "faces without area", "T-junctions"]
"""Changes after which the copy is the same to the last bit."""


def repaired(mesh):
    return manifold(clean_surfaces(mesh)[0], np.arange(len(mesh.faces)), connected=False)


def canonical(mesh):
    """The canonical copy of the repaired mesh's first component."""
    mapped = repaired(mesh)
    return renumbered(mapped.mesh, int(mapped.mesh.face_component[0]), apart=mapped.moved).mesh


@pytest.mark.parametrize("shape", SHAPES)
@pytest.mark.parametrize("name", EXACT)
def test_a_changed_mesh_has_the_same_copy(shape, name):
    mesh = SHAPES[shape]
    one, other = canonical(mesh), canonical(same_surface.changed(mesh, name, 5).mesh)
    np.testing.assert_array_equal(other.vertices, one.vertices)
    np.testing.assert_array_equal(other.faces, one.faces)


@pytest.mark.parametrize("shape", WITH_SHARED_POSITIONS)
@pytest.mark.parametrize("name", same_surface.SAME_CURVE)
def test_a_surface_that_touches_itself_has_the_same_copy(shape, name):
    """Whether its vertices there are one, two, or as many as faces."""
    mesh = WITH_SHARED_POSITIONS[shape]
    one, other = canonical(mesh), canonical(same_surface.changed(mesh, name, 5).mesh)
    np.testing.assert_array_equal(other.vertices, one.vertices)
    np.testing.assert_array_equal(other.faces, one.faces)
    assert len(np.unique(one.vertices, axis=0)) == len(SHAPES["egg"].vertices)


@pytest.mark.slow
@settings(max_examples=20, deadline=None)
@given(
    st.sampled_from([None, "faces without area", "T-junctions"]),
    st.lists(st.sampled_from(list(same_surface.SAME_CURVE)), min_size=1, max_size=4),
    st.integers(0, 10_000),
)
def test_several_changes_keep_the_copy(division, names, seed):
    """Edges are divided first, since the faces of a soup have no common edges."""
    mesh = SHAPES["egg"]
    result = same_surface.unchanged(mesh)
    for number, name in enumerate(filter(None, [division, *names])):
        generator = np.random.default_rng([seed, number])
        result = same_surface.CHANGES[name](result, generator)
    one, other = canonical(mesh), canonical(result.mesh)
    np.testing.assert_array_equal(other.faces, one.faces)
    np.testing.assert_array_equal(other.vertices, one.vertices)


@pytest.mark.parametrize("shape", SHAPES)
def test_gaps_are_closed(shape):
    mesh = SHAPES[shape]
    gaps = same_surface.changed(mesh, "gaps", 3).mesh
    assert (gaps.unpaired_edges[1] == 1).sum() > (mesh.unpaired_edges[1] == 1).sum()
    mapped = repaired(gaps)
    assert (mapped.mesh.unpaired_edges[1] == 1).sum() == (mesh.unpaired_edges[1] == 1).sum()
    assert mapped.repairs["vertices joined"] > 0


@pytest.mark.parametrize("width, closes", [(3e-7, True), (1e-5, False)])
def test_only_tiny_gaps_are_closed(width, closes):
    sheet = grid(4)
    beside = nicmm.Mesh(sheet.vertices + [1.0 + width, 0.0, 0.0], sheet.faces)
    mapped = repaired(joined(sheet, beside))
    assert ("vertices joined" in mapped.repairs) is closes


def test_details_smaller_than_a_gap_stay():
    """A small sheet is not collapsed although all of it is smaller than the widest gap."""
    small = nicmm.Mesh(1e-8 * grid(3).vertices, grid(3).faces)
    mesh = joined(grid(3), nicmm.Mesh(small.vertices + [3.0, 0.0, 0.0], small.faces))
    mapped = repaired(mesh)
    assert not mapped.repairs
    assert len(mapped.mesh.faces) == len(mesh.faces)


def test_turned_faces_are_the_fewer_ones():
    mesh = SHAPES["egg"]
    faces = mesh.faces.copy()
    faces[:30] = faces[:30, ::-1]
    assert repaired(nicmm.Mesh(mesh.vertices, faces)).repairs == {"faces turned": 30}
    assert repaired(nicmm.Mesh(mesh.vertices, mesh.faces[:, ::-1])).repairs == {}


def test_vertices_on_a_rim_that_only_touches_an_edge_divide_nothing():
    """Of a triangle whose tip touches the side of another, no edge lies along it."""
    mesh = nicmm.Mesh(
        [[0, 0, 0], [2, 0, 0], [1, -1, 0], [1, 0, 0], [0.5, 1, 0], [1.5, 1, 0]],
        [[0, 2, 1], [3, 5, 4]],
    )
    assert not repaired(mesh).repairs


@pytest.mark.parametrize("shift", [0.5, 1.25])
def test_overlapping_sides_of_two_sheets_meet(shift):
    """Vertices of either side lie on edges of the other one."""
    coarse, fine = grid(3), nicmm.Mesh(grid(4).vertices * [1.0, 0.8, 1.0], grid(4).faces)
    mesh = joined(coarse, nicmm.Mesh(fine.vertices + [1.0, 0.1 * shift, 0.0], fine.faces))
    mapped = repaired(mesh)
    assert mapped.repairs["T-junctions closed"] >= 6
    assert len(np.unique(mapped.mesh.face_component)) == 1
    np.testing.assert_allclose(mapped.mesh.face_areas.sum(), mesh.face_areas.sum())


def test_a_mesh_of_nothing_but_faces_without_area():
    """No face remains of it, so its faces are given an area instead."""
    flat = nicmm.Mesh([[0, 0, 0], [1, 0, 0], [2, 0, 0]], [[0, 1, 2]])
    assert [len(surface.parts.faces) for surface in clean_surfaces(flat)] == [1]
    design = nicmm.design_curve(flat, [0, 2], closed=False)
    np.testing.assert_allclose(design.curves[0].length, 2.0)


@pytest.mark.parametrize(
    "name", ["caps", "fans without area", "collapsed edges", "collapsed faces", "soup"]
)
def test_every_point_of_the_mesh_has_a_place_on_the_manifold(name):
    mesh = DEFECTIVE[name]
    mapped = repaired(mesh)
    points = random_surface_points(mesh, 200, seed=1)
    removed = np.flatnonzero(mapped.clean.removed)
    weights = np.tile([0.5, 0.25, 0.25], (len(removed), 1))
    for given_points in (points, SurfacePoints(removed, weights)):
        for point, found in zip(
            given_points.positions(mesh), mapped.representations(given_points), strict=True
        ):
            assert len(found)
            there = found.positions(mapped.mesh) + mapped.origin
            np.testing.assert_allclose(there, np.tile(point, (len(found), 1)), atol=1e-5)


@pytest.mark.slow
@pytest.mark.parametrize("size", [12, 300])
def test_a_fan_without_area_is_removed_whole(size):
    """Its faces lie over one another, so one can be removed only after another."""
    ball = shapes.sphere(2)
    mesh = nicmm.Mesh(*with_fans(ball.vertices, ball.faces, size))
    mapped = repaired(mesh)
    assert mapped.repairs == {"faces without area removed": size}
    assert not mapped.moved
    assert len(mapped.mesh.faces) == len(ball.faces)
