"""Tests of the hop graph: symmetry of its costs, straight and bent courses, and routes."""

import numpy as np
import pytest

from nicmm_core import shapes
from nicmm_core.courses.hop_graph import (
    SHARPEST_TURN,
    build_hop_graph,
    distances_along_edges,
    with_control_points,
)
from nicmm_core.courses.leg_routes import cells_beside, leg_choices, routes_of_legs
from nicmm_core.geometry.mesh import Mesh
from nicmm_core.relaxation.curve_nodes import curve_surface
from tests.core.checks import grid, points_near

LEGS = np.array([[0, 1], [1, 2], [2, 0]])


def graph_through(mesh, positions, legs=LEGS, tension=160.0):
    surface = curve_surface(mesh)
    points = points_near(mesh, np.asarray(positions, dtype=float))
    between = distances_along_edges(surface, points)[:, len(mesh.vertices) :]
    length = between[legs[:, 0], legs[:, 1]].sum()
    no_corners = np.zeros(len(points), bool)
    graph = build_hop_graph(surface)
    return with_control_points(graph, points, no_corners, length, None, tension, 0.0)


def by_state(graph, start, end):
    """Least cost of a leg between two control points through each state."""
    return graph.cost[start] + graph.cost[end][graph.reverse] - graph.weights


def routes_through(graph, legs, closed):
    """The routes of consecutive legs."""
    choices = leg_choices(graph, map(tuple, legs.tolist()), len(legs))
    return routes_of_legs(graph, choices, legs, closed, cells_beside(graph))


@pytest.fixture(scope="module")
def on_square():
    return graph_through(grid(40), [[0.1, 0.1, 0.0], [0.9, 0.2, 0.0], [0.5, 0.9, 0.0]])


@pytest.fixture(scope="module")
def on_body():
    mesh = shapes.creature(2, resolution=32, faces=1500)
    return graph_through(mesh, mesh.vertices[[10, 300, 700]])


@pytest.mark.slow
@pytest.mark.parametrize("name", ["on_square", "on_body"])
def test_a_path_and_its_reverse_cost_the_same(name, request):
    graph = request.getfixturevalue(name)
    for start, end in LEGS:
        there, back = by_state(graph, start, end), by_state(graph, end, start)
        np.testing.assert_allclose(there, back[graph.reverse], rtol=1e-9)


@pytest.mark.parametrize("name", ["on_square", "on_body"])
def test_the_best_leg_by_any_of_its_states_is_the_same(name, request):
    """Paths from both ends meet in every state of the best leg, with the same total cost."""
    graph = request.getfixturevalue(name)
    for start, end in LEGS:
        total = by_state(graph, start, end)
        arrivals = np.flatnonzero(graph.hops.end == len(graph.graph.vertex) + end)
        departures = np.flatnonzero(graph.hops.start == len(graph.graph.vertex) + start)
        best = total[np.isfinite(total)].min()
        assert total[arrivals].min() == pytest.approx(best)
        assert total[departures].min() == pytest.approx(best)


def test_a_straight_leg_costs_at_least_its_length_and_not_much_more(on_square):
    tension = np.median(on_square.weights / on_square.hops.length)
    for start, end in LEGS:
        places = on_square.positions[len(on_square.graph.vertex) :]
        straight = tension * np.linalg.norm(places[start] - places[end])
        least = by_state(on_square, start, end).min()
        assert straight <= least <= 2.0 * straight


def test_routes_run_along_hops_and_are_simple(on_body):
    routes = routes_through(on_body, LEGS, closed=True)
    hops = set(zip(on_body.hops.start.tolist(), on_body.hops.end.tolist(), strict=True))
    for leg in routes:
        assert len(leg.cells) > 5
        for path in leg.cells:
            assert path[0] == len(on_body.graph.vertex) + leg.start
            assert path[-1] == len(on_body.graph.vertex) + leg.end
            assert len(np.unique(path)) == len(path)
            assert set(zip(path[:-1].tolist(), path[1:].tolist(), strict=True)) <= hops


def test_routes_pass_a_tube_on_both_sides():
    """On a torus, routes pass the hole on either side."""
    torus = shapes.torus(around=48, across=24)
    angle = np.array([0.0, 0.8 * np.pi])
    radius = np.linalg.norm(torus.vertices[:, :2], axis=1).max()
    places = radius * np.column_stack([np.cos(angle), np.sin(angle), np.zeros(2)])
    graph = graph_through(torus, places, np.array([[0, 1]]))
    sides = {
        bool(np.sign(graph.positions[path[len(path) // 2], 1]) > 0)
        for path in routes_through(graph, np.array([[0, 1]]), closed=False)[0].cells
    }
    assert sides == {True, False}


def test_no_hop_leads_across_a_slit():
    """Edges around the end of a slit, developed into the plane, lead straight across it."""
    square = grid(40)
    middle = square.vertices[square.faces].mean(axis=1)
    slit = (np.abs(middle[:, 0] - 0.5) < 0.03) & (middle[:, 1] > 0.2)
    graph = build_hop_graph(curve_surface(Mesh(square.vertices, square.faces[~slit])))
    places = square.vertices[graph.vertex]
    start, end = places[graph.hops.start], places[graph.hops.end]
    across = (start[:, 0] < 0.5) & (end[:, 0] > 0.5)
    share = (0.5 - start[across, 0]) / (end[across, 0] - start[across, 0])
    height = start[across, 1] + share * (end[across, 1] - start[across, 1])
    assert across.any() and height.max() < 0.2 + 1.5 * graph.spacing


def test_hops_between_neighbouring_control_points_need_no_cell():
    square = grid(40)
    near = [[0.5, 0.5, 0.0], [0.52, 0.5, 0.0], [0.51, 0.53, 0.0]]
    graph = graph_through(square, near)
    for start, end in LEGS:
        assert np.isfinite(by_state(graph, start, end)).any()
    assert all(len(leg.cells) for leg in routes_through(graph, LEGS, closed=True))


@pytest.mark.slow
def test_no_hop_goes_on_with_a_turn_sharper_than_allowed_and_others_do(body):
    graph = build_hop_graph(curve_surface(body))
    indptr, after, _ = graph.arcs
    before = np.repeat(np.arange(len(graph.reverse)), np.diff(indptr))
    cosine = (graph.hops.arriving[before] * graph.hops.leaving[after]).sum(axis=1)
    assert (cosine >= np.cos(SHARPEST_TURN) - 1e-12).all()
    assert (cosine < 0.0).any()
    # All pairs of consecutive hops with a smaller turn are arcs of the graph.
    pairs = graph.hops.end[:, None] == graph.hops.start
    turns = np.einsum("ad,bd->ab", graph.hops.arriving, graph.hops.leaving)
    assert np.count_nonzero(pairs & (turns >= np.cos(SHARPEST_TURN))) == len(after)
