"""Tests that the zero set stays one loop through the control points, for any given field."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from nicmm_core import shapes
from nicmm_core.paper.contour import extract_curves
from nicmm_core.paper.initial_loop import InitialLoop
from nicmm_core.paper.problem import build_problem
from nicmm_core.paper.topology import keep_topology
from nicmm_core.path.virtual_splits import SplitMesh
from tests.core.checks import assert_valid_curve, circle, random_surface_points
from tests.oracles.named_curves import nearest_vertices


def keep(working, start, wanted, controls):
    """Result of `keep_topology` for a loop through control vertices, from a start field."""
    edge_length = working.edge_lengths.mean()
    loop = InitialLoop(
        vertices=controls,
        control_vertices=controls,
        order=np.arange(len(controls)),
        edge_length=edge_length,
        zigzag=edge_length,
    )
    return keep_topology(working, loop, start, wanted)


@pytest.fixture(scope="module")
def working(ball):
    return SplitMesh(ball).assemble(0)[0]


@pytest.fixture(scope="module")
def equator(ball):
    """Four vertices of the equator; no two are neighbours."""
    return nearest_vertices(ball, circle(np.pi / 2 * np.arange(4)))


def assert_one_loop(mesh, working, field, controls):
    curves = extract_curves(mesh, working, field, controls)
    assert len(curves) == 1
    assert_valid_curve(mesh, curves[0], working.vertices[controls])


def test_field_of_the_same_signs_comes_back_as_it_is(working, equator):
    start = working.vertices[:, 2].copy()
    wanted = np.tanh(5.0 * start)
    field, breaking = keep(working, start, wanted, equator)
    np.testing.assert_array_equal(field, wanted)
    assert breaking == 0


def test_isotopic_field_comes_back_as_it_is(ball, working, equator):
    """The new zero set passes the same points but deviates by several edges between them."""
    x, y, z = working.vertices.T
    wanted = z + 0.8 * x * y
    assert (np.sign(wanted) != np.sign(z)).sum() > 50
    field, breaking = keep(working, z.copy(), wanted, equator)
    np.testing.assert_array_equal(field, wanted)
    assert breaking == 0
    assert_one_loop(ball, working, field, equator)


def test_blobs_are_removed_and_the_rest_kept(ball, working, equator):
    """A second loop around the north pole is removed; the south keeps the given field."""
    x, y, z = working.vertices.T
    pole = np.linalg.norm(working.vertices - [0.0, 0.0, 1.0], axis=1)
    wanted = z + 0.3 * x * y - 2.0 * np.exp(-((pole / 0.3) ** 2))
    wanted[equator] = 0.0
    assert len(extract_curves(ball, working, wanted, equator)) == 2
    field, breaking = keep(working, z.copy(), wanted, equator)
    assert breaking > 0
    assert_one_loop(ball, working, field, equator)
    south = z < -0.8
    np.testing.assert_array_equal(field[south], wanted[south])


def test_strands_do_not_merge(flat_disc):
    """The given field would pinch an ellipse into two loops."""
    working, _ = SplitMesh(flat_disc).assemble(0)
    x, y, _ = working.vertices.T
    start = np.sqrt((x / 0.8) ** 2 + (y / 0.4) ** 2) - 1.0
    controls = nearest_vertices(flat_disc, [[0.8, 0, 0], [0, 0.4, 0], [-0.8, 0, 0], [0, -0.4, 0]])
    controls = controls[[0, 2]]
    start[controls] = 0.0
    wanted = start + 1.5 * np.exp(-((x / 0.2) ** 2))
    wanted[controls] = 0.0
    assert len(extract_curves(flat_disc, working, start, controls)) == 1
    assert len(extract_curves(flat_disc, working, wanted, controls)) == 2
    field, breaking = keep(working, start, wanted, controls)
    assert breaking > 0
    (curve,) = extract_curves(flat_disc, working, field, controls)
    assert curve.closed
    assert (curve.control_index >= 0).all()


def test_control_points_are_not_lost(ball, working, equator):
    """A field that is positive all around a control point would lose it."""
    start = working.vertices[:, 2].copy()
    away = np.linalg.norm(working.vertices - working.vertices[equator[1]], axis=1)
    wanted = start + np.exp(-((away / 0.4) ** 2))
    wanted[equator] = 0.0
    field, breaking = keep(working, start, wanted, equator)
    assert breaking > 0
    assert_one_loop(ball, working, field, equator)


def test_field_without_a_zero_set_falls_back_on_one_loop(ball, working, equator):
    start = working.vertices[:, 2].copy()
    for constant in (1.0, -1.0):
        field, breaking = keep(working, start, np.full(len(start), constant), equator)
        assert breaking > 0
        assert_one_loop(ball, working, field, equator)


def test_arguments_are_not_changed(working, equator):
    start = working.vertices[:, 2].copy()
    wanted = -start
    keep(working, start, wanted, equator)
    np.testing.assert_array_equal(start, working.vertices[:, 2])
    np.testing.assert_array_equal(wanted, -working.vertices[:, 2])


MESHES = {
    "sphere": shapes.sphere(2),
    "torus": shapes.torus(around=24, across=12),
    "body": shapes.creature(1, faces=200, subdivisions=0),
}
PROBLEMS = {}


def problem_on(name, seed):
    """Problem through random points in a small part of a mesh, so that the loop bounds a region."""
    if (name, seed) not in PROBLEMS:
        mesh = MESHES[name]
        centre = mesh.vertices[np.random.default_rng(seed).integers(len(mesh.vertices))]
        distance = np.linalg.norm(mesh.vertices[mesh.faces].mean(axis=1) - centre, axis=1)
        points = random_surface_points(mesh, 4, seed)
        points.faces[:] = np.random.default_rng(seed).permutation(np.argsort(distance)[:30])[:4]
        PROBLEMS[name, seed] = mesh, build_problem(mesh, points, "shortest")
    return PROBLEMS[name, seed]


@pytest.mark.slow
@settings(max_examples=40)
@given(
    name=st.sampled_from(sorted(MESHES)),
    points=st.integers(0, 2),
    waves=st.integers(0, 2**31),
    height=st.sampled_from([0.02, 0.1, 0.5]),
    length=st.sampled_from([0.1, 0.3, 1.0]),
)
def test_any_smooth_change_leaves_one_loop(name, points, waves, height, length):
    mesh, problem = problem_on(name, points)
    generator = np.random.default_rng(waves)
    position = problem.features[:, :3]
    wave = sum(
        np.sin(position @ generator.normal(size=3) / length + generator.uniform(0, 2 * np.pi))
        for _ in range(4)
    )
    wanted = problem.smoother.interpolating(problem.initial_distance + height * wave)
    controls = problem.loop.control_vertices
    field, breaking = keep_topology(problem.working, problem.loop, problem.initial_distance, wanted)
    assert_one_loop(mesh, problem.working, field, controls)
    if breaking == 0:
        np.testing.assert_array_equal(field, wanted)
