"""Tests that the initial loop is simple, has no chords, and passes the points in order."""

import json
import re

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

import nicmm_core as nicmm
from nicmm_core import shapes
from nicmm_core.geometry.surface_points import locate_control_points
from nicmm_core.path import legs
from nicmm_core.path.initial_path import boundary_loops, find_initial_path, path_curve
from nicmm_core.path.visiting_order import shortest_order
from tests.core.checks import (
    assert_valid_curve,
    circle,
    flipped,
    initial_loop,
    random_surface_points,
)
from tests.oracles.named_curves import nearest_vertices

pytestmark = pytest.mark.usefixtures("one_attempt_each")

BALL = shapes.sphere(1)


def assert_simple_loop(mesh, points, order, working, loop, closed=True):
    assert loop.closed == closed
    vertices = loop.vertices.tolist()
    assert len(set(vertices)) == len(vertices), "a vertex is passed twice"
    edges = {tuple(edge) for edge in working.edges.tolist()}
    steps = {
        tuple(sorted(step))
        for step in zip(vertices, np.roll(loop.vertices, -1).tolist(), strict=True)
    }
    if not closed:
        steps.remove(tuple(sorted((vertices[-1], vertices[0]))))
        assert loop.control_vertices[[0, -1]].tolist() == [vertices[0], vertices[-1]]
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


@pytest.mark.slow
@pytest.mark.parametrize("order", ["given", "shortest"])
@pytest.mark.parametrize("count", [3, *(pytest.param(n, marks=pytest.mark.slow) for n in (5, 8))])
def test_loops_through_random_vertices_are_simple(surface, count, order):
    for seed in range(3):
        inner = interior_vertices(surface)
        chosen = np.random.default_rng([count, seed]).choice(inner, size=count, replace=False)
        points = locate_control_points(surface, chosen, closed=True)
        working, loop = initial_loop(surface, points, order)
        assert_simple_loop(surface, points, order, working, loop)


@pytest.mark.slow
@pytest.mark.parametrize("order", ["given", "shortest"])
def test_loops_through_points_in_faces_are_simple(surface, order):
    for seed in range(3):
        points = random_surface_points(surface, 5, seed)
        working, loop = initial_loop(surface, points, order)
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


@pytest.mark.slow
@settings(max_examples=25)
@given(places=PLACES, order=st.sampled_from(["given", "shortest"]))
@example(places=[(0, (1, 0, 0)), (0, (0.5, 0.5, 0)), (0, (0.2, 0.3, 0.5))], order="given")
def test_any_points_of_a_sphere_have_a_simple_loop(places, order):
    """An open path does not separate a sphere, so every order of distinct points has a loop."""
    faces, barycentric = zip(*places, strict=True)
    given_points = nicmm.SurfacePoints(np.array(faces), np.array(barycentric, dtype=float))
    try:
        points = locate_control_points(BALL, given_points, closed=True)
    except nicmm.ControlPointError:
        return  # two of the points coincide
    working, loop = initial_loop(BALL, points, order)
    assert_simple_loop(BALL, points, order, working, loop)


@pytest.mark.parametrize("seed", range(6))
def test_loops_of_many_strands_are_simple(small_ball, seed):
    """With points in random order, paths wind around one another and split the mesh often."""
    chosen = np.random.default_rng(seed).choice(len(small_ball.vertices), size=12, replace=False)
    points = locate_control_points(small_ball, chosen, closed=True)
    working, loop = initial_loop(small_ball, points, "given")
    assert_simple_loop(small_ball, points, "given", working, loop)


def test_shortest_order_is_that_of_the_distances(ball):
    angles = 2 * np.pi * np.array([0.0, 0.6, 0.2, 0.8, 0.4])
    points = locate_control_points(ball, nearest_vertices(ball, circle(angles)), closed=True)
    _, loop = initial_loop(ball, points, "shortest")
    chord = np.linalg.norm(circle(angles)[:, None] - circle(angles)[None], axis=2)
    expected = shortest_order(chord, closed=True).tolist()
    # On the mesh the points are not exactly evenly spaced, so the tour may start elsewhere.
    found = loop.order.tolist()
    found = np.roll(found, -found.index(expected[0])).tolist()
    assert found in (expected, [expected[0], *expected[:0:-1]])


SURFACES = {
    "sphere": shapes.sphere(2),
    "torus": shapes.torus(around=18, across=9),
    "body": shapes.creature(1, faces=200, subdivisions=0),
    "tetrahedron": nicmm.Mesh(
        [[1, 1, 1], [1, -1, -1], [-1, 1, -1], [-1, -1, 1]],
        [[0, 1, 2], [0, 3, 1], [0, 2, 3], [1, 3, 2]],
    ),
}


@pytest.mark.slow
class TestEveryOrder:
    """Disjoint arcs do not separate a surface without boundary, so every order has a path."""

    @settings(max_examples=20)
    @given(
        name=st.sampled_from(sorted(SURFACES)),
        count=st.integers(2, 12),
        seed=st.integers(0, 10**6),
        closed=st.booleans(),
    )
    def test_without_boundary(self, name, count, seed, closed):
        mesh = SURFACES[name]
        count = max(count, 2 + closed)
        generator = np.random.default_rng(seed)
        faces = generator.integers(len(mesh.faces), size=count)
        barycentric = generator.dirichlet([1.0, 1.0, 1.0], size=count)
        points = locate_control_points(mesh, nicmm.SurfacePoints(faces, barycentric), closed)
        working, loop = initial_loop(mesh, points, "given", None, closed)
        assert_simple_loop(mesh, points, "given", working, loop, closed)

    @settings(max_examples=15)
    @given(count=st.integers(3, 9), seed=st.integers(0, 10**6), closed=st.booleans())
    def test_inside_a_disc(self, flat_disc, count, seed, closed):
        """Disjoint arcs do not separate a disc either, unless they touch its boundary."""
        inner = interior_vertices(flat_disc)
        chosen = np.random.default_rng(seed).choice(inner, count, replace=False)
        points = locate_control_points(flat_disc, chosen, closed)
        working, loop = initial_loop(flat_disc, points, "given", None, closed)
        assert_simple_loop(flat_disc, points, "given", working, loop, closed)
        assert not working.on_boundary[loop.vertices].any()

    @pytest.mark.parametrize("closed", [True, False])
    def test_many_points(self, ball, closed):
        """Twenty points back and forth; legs found in this order once made the path too long."""
        chosen = np.random.default_rng(20).choice(len(ball.vertices), 20, replace=False)
        points = locate_control_points(ball, chosen, closed)
        working, loop = initial_loop(ball, points, "given", None, closed)
        assert_simple_loop(ball, points, "given", working, loop, closed)
        onward = np.roll(chosen, -1)
        apart = np.linalg.norm(ball.vertices[chosen] - ball.vertices[onward], axis=1).sum()
        along = working.vertices[loop.vertices]
        assert np.linalg.norm(np.diff(along, axis=0), axis=1).sum() < 3.5 * apart


class TestBoundary:
    @pytest.mark.slow
    @settings(max_examples=8)
    @given(count=st.integers(4, 8), seed=st.integers(0, 10**6), closed=st.booleans())
    def test_an_order_along_the_rim_works_and_any_other_names_one(
        self, flat_disc, count, seed, closed
    ):
        """Two legs between points on the rim cross exactly if their ends alternate along it."""
        generator = np.random.default_rng(seed)
        rim = boundary_loop(flat_disc)
        places = np.sort(generator.choice(len(rim), count, replace=False))
        order = generator.permutation(count)
        points = locate_control_points(flat_disc, rim[places[order]], closed)
        try:
            working, loop = initial_loop(flat_disc, points, "given", None, closed)
        except nicmm.UnreachableError as error:
            assert legs_alternate(order, closed)
            named = re.search(r"in the order (\[[\d, ]*\]), which works", str(error))
            assert named, error
            works = json.loads(named.group(1))
            points = locate_control_points(flat_disc, rim[places[order[works]]], closed)
            working, loop = initial_loop(flat_disc, points, "given", None, closed)
        else:
            assert not legs_alternate(order, closed)
        assert_simple_loop(flat_disc, points, "given", working, loop, closed)
        assert working.on_boundary[loop.vertices].sum() == count

    @pytest.mark.parametrize("closed", [True, False])
    @pytest.mark.parametrize("seed", range(3))
    def test_points_inside_do_not_hinder_those_of_the_rim(self, flat_disc, seed, closed):
        """Leg 0 divides the disc and has to leave all inner points on the same side."""
        rim = nearest_vertices(flat_disc, circle([0.0, np.pi]))
        inner = np.setdiff1d(interior_vertices(flat_disc), flat_disc.faces[0])
        chosen = np.random.default_rng(seed).choice(inner, 4, replace=False)
        points = locate_control_points(flat_disc, [*rim, *chosen], closed)
        working, loop = initial_loop(flat_disc, points, "given", None, closed)
        assert_simple_loop(flat_disc, points, "given", working, loop, closed)

    def test_strip_one_triangle_wide(self):
        """All vertices are on the boundary, and the loop passes the same triangles twice."""
        x = np.repeat(np.arange(12.0), 2)
        vertices = np.stack([x, np.tile([0.0, 1.0], 12), 0 * x], axis=1)
        faces = [f for i in range(0, 22, 2) for f in ((i, i + 2, i + 1), (i + 1, i + 2, i + 3))]
        strip = nicmm.Mesh(vertices, faces)
        middle = np.array([[0.4, 0.5, 0], [5.4, 0.3, 0], [10.6, 0.5, 0], [5.6, 0.7, 0]])
        points = locate_control_points(strip, middle[[0, 1, 2, 3]], closed=True)
        working, loop = initial_loop(strip, points, "given")
        assert_simple_loop(strip, points, "given", working, loop)
        assert not working.on_boundary[loop.vertices].any()
        corners = locate_control_points(strip, [0, 23, 1], closed=True)
        working, loop = initial_loop(strip, corners, "given")
        assert_simple_loop(strip, corners, "given", working, loop)
        assert working.on_boundary[loop.vertices].sum() == 3

    def test_triangle_through_its_corners(self):
        """A face with three boundary edges has to be split before any leg is found."""
        mesh = nicmm.Mesh([[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 1, 2]])
        points = locate_control_points(mesh, [0, 1, 2], closed=True)
        working, loop = initial_loop(mesh, points, "given")
        assert_simple_loop(mesh, points, "given", working, loop)


@pytest.mark.slow
def test_a_path_that_winds_too_often_names_an_order(ball, monkeypatch):
    monkeypatch.setattr(legs, "MOST_PATH_SPLITS", 40)
    chosen = np.random.default_rng(0).choice(len(ball.vertices), 24, replace=False)
    points = locate_control_points(ball, chosen, closed=True)
    with pytest.raises(nicmm.UnreachableError, match=r"winds around itself too often.*which works"):
        initial_loop(ball, points, "given")


def boundary_loop(mesh):
    """Vertices of the only boundary loop, about the origin, in order."""
    rim = np.setdiff1d(mesh.faces, interior_vertices(mesh))
    return rim[np.argsort(np.arctan2(mesh.vertices[rim, 1], mesh.vertices[rim, 0]))]


def legs_alternate(order, closed):
    """Whether the ends of two legs alternate, for points on a circle in a visiting order."""
    onward = np.roll(order, -1) if closed else order[1:]
    pairs = [sorted(pair) for pair in zip(order.tolist(), onward.tolist(), strict=False)]
    return any(first[0] < second[0] < first[1] < second[1] for first in pairs for second in pairs)


def interior_vertices(mesh):
    """Vertices that are not on the boundary."""
    sides = np.sort(mesh.faces[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2), axis=1)
    edges, count = np.unique(sides, axis=0, return_counts=True)
    return np.setdiff1d(mesh.faces, edges[count == 1])


class TestBoundaries:
    @pytest.mark.parametrize(
        ("mesh", "lengths"),
        [
            (shapes.disc(4), [24]),
            (shapes.annulus(5), [12, 30]),
            (shapes.moebius_strip(12, 3), [24]),
            (shapes.sphere(1), []),
        ],
        ids=["disc", "annulus", "Möbius strip", "sphere"],
    )
    @pytest.mark.parametrize("turned", [False, True])
    def test_loops_follow_the_boundary(self, mesh, lengths, turned):
        mesh = flipped(mesh, 1) if turned else mesh
        loops = boundary_loops(mesh.faces)
        assert sorted(map(len, loops)) == lengths
        rim = {frozenset(edge) for edge in mesh.unpaired_edges[0].tolist()}
        for loop in loops:
            steps = zip(loop.tolist(), np.roll(loop, -1).tolist(), strict=True)
            assert all(frozenset(step) in rim for step in steps)

    def test_the_surface_is_on_the_same_side_of_all_loops(self):
        mesh = flipped(shapes.annulus(5), 2)
        turns = []
        for loop in boundary_loops(mesh.faces):
            flat = mesh.vertices[loop, :2]
            following = np.roll(flat, -1, axis=0)
            cross = flat[:, 0] * following[:, 1] - flat[:, 1] * following[:, 0]
            turns.append((np.sign(cross.sum()), np.linalg.norm(flat[0])))
        (inner, _), (outer, _) = sorted(turns, key=lambda turn: turn[1])
        assert inner == -outer

    @pytest.mark.parametrize("closed", [True, False])
    @pytest.mark.parametrize("seed", range(6))
    def test_many_points_on_boundaries_are_visited_in_an_order_that_works(self, seed, closed):
        """The shortest order changes sides of a narrow ring often, which is usually impossible."""
        mesh = shapes.annulus(5, hole=0.7)
        rim = np.unique(mesh.unpaired_edges[0])
        chosen = np.random.default_rng(seed).choice(rim, 9, replace=False)
        points = locate_control_points(mesh, chosen, closed)
        working, loop = initial_loop(mesh, points, "shortest", closed=closed)
        assert_simple_loop(mesh, points, "shortest", working, loop, closed)


@pytest.mark.parametrize("closed", [True, False])
@pytest.mark.parametrize("seed", range(3))
def test_the_path_itself_is_a_curve(surface, seed, closed):
    inner = interior_vertices(surface)
    chosen = np.random.default_rng(seed).choice(inner, size=5, replace=False)
    points = locate_control_points(surface, chosen, closed)
    path = find_initial_path(surface, points, "shortest", closed=closed)
    curve = path_curve(surface, path)
    assert_valid_curve(surface, curve, surface.vertices[chosen][path.order], closed)
