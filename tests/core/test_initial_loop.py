"""The initial loop: simple, without chords, along edges and through the points in order."""

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

import nicmm_core as nicmm
from nicmm_core import shapes
from nicmm_core.initial_loop import build_initial_loop
from nicmm_core.surface_points import locate_control_points
from nicmm_core.visiting_order import shortest_order
from tests.core.checks import circle, nearest_vertices, random_surface_points

BALL = shapes.sphere(1)


def assert_simple_loop(mesh, points, order, working, loop):
    vertices = loop.vertices.tolist()
    assert len(set(vertices)) == len(vertices), "a vertex is passed twice"
    edges = {tuple(edge) for edge in working.edges.tolist()}
    steps = {
        tuple(sorted(step))
        for step in zip(vertices, np.roll(loop.vertices, -1).tolist(), strict=True)
    }
    assert steps <= edges, "a step follows no edge"
    on_loop = set(vertices)
    chords = {edge for edge in edges if on_loop.issuperset(edge)} - steps
    assert not chords, f"two strands are neighbours: {chords}"

    assert sorted(loop.order.tolist()) == list(range(len(points)))
    if order == "given":
        np.testing.assert_array_equal(loop.order, np.arange(len(points)))
    np.testing.assert_allclose(
        working.vertices[loop.control_vertices],
        points.positions(mesh)[loop.order],
        rtol=0,
        atol=1e-12 * mesh.diagonal,
    )
    place = [vertices.index(control) for control in loop.control_vertices]
    first = place.index(min(place))
    assert place[first:] + place[:first] == sorted(place), "points are met out of order"
    controls = set(loop.control_vertices.tolist())
    assert not any(controls.issuperset(edge) for edge in edges), "control points are neighbours"


@pytest.mark.parametrize("order", ["given", "shortest"])
@pytest.mark.parametrize("count", [3, 5, 8])
def test_loops_through_random_vertices_are_simple(surface, count, order):
    for seed in range(3):
        inner = interior_vertices(surface)
        chosen = np.random.default_rng([count, seed]).choice(inner, size=count, replace=False)
        points = locate_control_points(surface, chosen, closed=True)
        working, loop = build_initial_loop(surface, points, order)
        assert_simple_loop(surface, points, order, working, loop)


@pytest.mark.parametrize("order", ["given", "shortest"])
def test_loops_through_points_in_faces_are_simple(surface, order):
    for seed in range(3):
        points = random_surface_points(surface, 5, seed)
        working, loop = build_initial_loop(surface, points, order)
        assert_simple_loop(surface, points, order, working, loop)


PLACES = st.lists(
    st.tuples(
        st.integers(0, len(BALL.faces) - 1),
        st.sampled_from(
            [(1, 0, 0), (0.5, 0.5, 0), (0, 0.9, 0.1), (0.2, 0.3, 0.5), (0.98, 0.01, 0.01)]
        ),
    ),
    min_size=3,
    max_size=7,
)


@settings(max_examples=25)
@given(places=PLACES, order=st.sampled_from(["given", "shortest"]))
@example(places=[(0, (1, 0, 0)), (0, (0.5, 0.5, 0)), (0, (0.2, 0.3, 0.5))], order="given")
def test_any_points_of_a_sphere_have_a_simple_loop(places, order):
    """A path never cuts a sphere in two, so every order of different points has a loop."""
    faces, barycentric = zip(*places, strict=True)
    given_points = nicmm.SurfacePoints(np.array(faces), np.array(barycentric, dtype=float))
    try:
        points = locate_control_points(BALL, given_points, closed=True)
    except nicmm.ControlPointError:
        return  # Two of them are the same point.
    working, loop = build_initial_loop(BALL, points, order)
    assert_simple_loop(BALL, points, order, working, loop)


@pytest.mark.parametrize("seed", range(6))
def test_loops_of_many_strands_are_simple(small_ball, seed):
    """Points in random order: the paths wind round one another and split the mesh often."""
    chosen = np.random.default_rng(seed).choice(len(small_ball.vertices), size=12, replace=False)
    points = locate_control_points(small_ball, chosen, closed=True)
    working, loop = build_initial_loop(small_ball, points, "given")
    assert_simple_loop(small_ball, points, "given", working, loop)


def test_shortest_order_is_that_of_the_distances(ball):
    angles = 2 * np.pi * np.array([0.0, 0.6, 0.2, 0.8, 0.4])
    points = locate_control_points(ball, nearest_vertices(ball, circle(angles)), closed=True)
    _, loop = build_initial_loop(ball, points, "shortest")
    chord = np.linalg.norm(circle(angles)[:, None] - circle(angles)[None], axis=2)
    expected = shortest_order(chord, closed=True)
    assert loop.order.tolist() in (expected.tolist(), [0, *expected[:0:-1].tolist()])


def test_boundary_points_that_would_have_to_cross_are_unreachable(flat_disc):
    rim = nearest_vertices(flat_disc, circle(np.pi / 2 * np.array([0, 2, 1, 3])))
    points = locate_control_points(flat_disc, rim, closed=True)
    with pytest.raises(nicmm.UnreachableError, match=r"\[\d, \d, \d, \d\], which works"):
        build_initial_loop(flat_disc, points, "given")
    working, loop = build_initial_loop(flat_disc, points, "shortest")
    assert_simple_loop(flat_disc, points, "shortest", working, loop)


def test_unknown_order_is_refused(small_ball):
    points = locate_control_points(small_ball, [0, 5, 9], closed=True)
    with pytest.raises(nicmm.ArgumentError, match="order is 'random'"):
        build_initial_loop(small_ball, points, "random")


def interior_vertices(mesh):
    """Vertices off the boundary."""
    sides = np.sort(mesh.faces[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2), axis=1)
    edges, count = np.unique(sides, axis=0, return_counts=True)
    return np.setdiff1d(mesh.faces, edges[count == 1])
