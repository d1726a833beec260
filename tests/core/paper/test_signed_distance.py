"""Tests the signed distance against closed forms, and for loops that bound nothing."""

import numpy as np
import pytest

import nicmm_core as nicmm
from nicmm_core import shapes
from nicmm_core.geometry.surface_points import locate_control_points
from nicmm_core.paper.finite_elements import build_finite_elements
from nicmm_core.paper.initial_loop import InitialLoop
from nicmm_core.paper.problem import build_problem
from nicmm_core.paper.signed_distance import bounding_side, signed_distance
from nicmm_core.path.virtual_splits import SplitMesh
from tests.core.checks import joined


def distance_to(mesh, on_loop):
    """Signed distance to a loop, given by its vertices in order."""
    working, renumbered = SplitMesh(mesh).assemble(mesh.face_component[0])
    edge_length = working.edge_lengths.mean()
    loop = InitialLoop(
        vertices=renumbered[on_loop],
        control_vertices=renumbered[on_loop[:1]],
        order=np.arange(1),
        edge_length=edge_length,
        zigzag=edge_length,
    )
    elements = build_finite_elements(working.vertices, working.faces, working.on_boundary)
    side = bounding_side(working, elements, loop)
    return signed_distance(elements, loop, edge_length, side)


def globe(rings):
    """Unit sphere with 2 ``rings`` vertices per parallel; parallel i is at angle iπ/rings."""
    around = 2 * rings
    tilt = np.arange(1, rings) * np.pi / rings
    turn = np.arange(around) * 2 * np.pi / around
    parallels = np.stack(
        [
            np.outer(np.sin(tilt), np.cos(turn)),
            np.outer(np.sin(tilt), np.sin(turn)),
            np.outer(np.cos(tilt), np.ones(around)),
        ],
        axis=-1,
    )
    vertices = np.concatenate([parallels.reshape(-1, 3), [[0, 0, 1], [0, 0, -1]]])
    index = np.arange((rings - 1) * around).reshape(rings - 1, around)
    right = np.roll(index, -1, axis=1)
    top, bottom = len(vertices) - 2, len(vertices) - 1
    faces = [
        np.stack([index[:-1], index[1:], right[1:]], axis=-1).reshape(-1, 3),
        np.stack([index[:-1], right[1:], right[:-1]], axis=-1).reshape(-1, 3),
        np.stack([np.full(around, top), index[0], right[0]], axis=-1),
        np.stack([np.full(around, bottom), right[-1], index[-1]], axis=-1),
    ]
    return nicmm.Mesh(vertices, np.concatenate(faces)), index


def sphere_error(rings):
    """Mean error of the distance to the parallel at 60° from the pole."""
    mesh, index = globe(rings)
    field = distance_to(mesh, index[rings // 3 - 1])
    exact = np.arccos(np.clip(mesh.vertices[:, 2], -1, 1)) - np.pi / 3
    assert np.array_equal(np.sign(field), np.sign(np.round(exact, 9)))
    return np.abs(field - exact).mean()


def disc_error(rings):
    """Mean error of the distance to the circle with half the radius."""
    mesh = shapes.disc(rings)
    radius = np.linalg.norm(mesh.vertices, axis=1)
    on_circle = np.flatnonzero(np.isclose(radius, 0.5))
    angle = np.arctan2(mesh.vertices[on_circle, 1], mesh.vertices[on_circle, 0])
    field = distance_to(mesh, on_circle[np.argsort(angle)])
    assert np.array_equal(np.sign(field), np.sign(np.round(radius - 0.5, 9)))
    return np.abs(field - (radius - 0.5)).mean()


@pytest.mark.parametrize(
    ("error", "sizes"), [(sphere_error, (12, 24, 48)), (disc_error, (8, 16, 32))]
)
def test_distance_approaches_the_closed_form(error, sizes):
    errors = [error(size) for size in sizes]
    assert errors[0] < 0.02
    assert errors[1] < 0.5 * errors[0] and errors[2] < 0.5 * errors[1], errors


def test_inside_is_the_smaller_side():
    mesh, index = globe(12)
    height = mesh.vertices[:, 2]
    for parallel, smaller_side in ((2, 1.0), (8, -1.0)):
        above = smaller_side * (height - height[index[parallel, 0]]) > 1e-9
        np.testing.assert_array_equal(distance_to(mesh, index[parallel]) < 0, above)


def test_zero_on_the_loop_and_nowhere_else():
    mesh, index = globe(12)
    field = distance_to(mesh, index[3])
    np.testing.assert_array_equal(np.flatnonzero(field == 0.0), np.sort(index[3]))


def test_distance_is_in_the_unit_of_the_mesh():
    mesh, index = globe(12)
    large = nicmm.Mesh(1000.0 * mesh.vertices, mesh.faces)
    np.testing.assert_allclose(
        distance_to(large, index[3]), 1000.0 * distance_to(mesh, index[3]), rtol=1e-6, atol=1e-6
    )


def test_other_components_do_not_matter():
    mesh, index = globe(12)
    both = joined(mesh, shapes.sphere(1))
    np.testing.assert_allclose(distance_to(both, index[3]), distance_to(mesh, index[3]))


@pytest.mark.slow
def test_loop_round_the_tube_of_a_torus_bounds_nothing(ring):
    """Neither do loops around the hole; the control points are on a meridian or a parallel."""
    meridian = [0, 6, 12]
    parallel = [0, 12 * 18, 24 * 18]
    for vertices in (meridian, parallel):
        points = locate_control_points(ring, vertices, closed=True)
        problem = build_problem(ring, points)
        assert bounding_side(problem.working, problem.elements, problem.loop) is None
