"""Tests of the orders of control points that a search tries."""

import itertools

import numpy as np
import pytest

import nicmm_core as nicmm
from nicmm_core import shapes
from nicmm_core.courses.leg_orders import cheapest_orders, legs_of_order, possible_orders
from nicmm_core.courses.leg_routes import leg_choices
from tests.core.checks import assert_valid_design, grid
from tests.core.courses.test_hop_graph import graph_through


def tour(order):
    """An order of an open curve as a set of legs without directions."""
    return frozenset(map(frozenset, legs_of_order(np.array(order), closed=False).tolist()))


@pytest.mark.parametrize("count", [1, 2, 3, 4, 5, 7])
def test_orders_are_different_tours_of_all_points(count):
    orders = possible_orders(count)
    np.testing.assert_array_equal(orders[0], np.arange(count))
    tours = {tour(order) for order in orders}
    assert len(tours) == len(orders)
    assert all(sorted(order.tolist()) == list(range(count)) for order in orders)
    if count <= 5:
        everything = itertools.permutations(range(count))
        assert tours == {tour(order) for order in everything}


def test_the_cheapest_order_on_a_plane_has_the_gentlest_turns():
    """Points in the order of a bow tie: an order without the bow costs less."""
    corners = [[0.2, 0.2, 0.0], [0.8, 0.8, 0.0], [0.8, 0.2, 0.0], [0.2, 0.8, 0.0]]
    legs = legs_of_order(np.arange(4), closed=False)
    graph = graph_through(grid(40), corners, legs)
    choices = leg_choices(graph, itertools.combinations(range(4), 2), len(legs))
    orders = cheapest_orders(graph, choices)
    assert len(orders)
    best = tour(orders[0])
    around = {frozenset(pair) for pair in ([0, 2], [2, 1], [1, 3], [3, 0])}
    assert best <= around


@pytest.mark.slow
def test_the_fairest_open_curve_may_visit_points_in_another_order():
    """On some bodies it does; an order that is given is kept."""
    changed = 0
    for seed in range(4):
        body = shapes.creature(seed, resolution=32, faces=1500)
        chosen = np.random.default_rng(seed).choice(len(body.vertices), 4, replace=False)
        free = nicmm.design_curve(body, chosen, order="shortest", closed=False)
        assert_valid_design(body, free, closed=False)
        visited = free.resumable.visited
        given = nicmm.design_curve(body, chosen, closed=False)
        np.testing.assert_array_equal(given.resumable.visited, np.arange(4))
        changed += tour(visited) != tour(np.arange(4))
    assert changed
