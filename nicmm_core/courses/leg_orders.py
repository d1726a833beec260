"""Finds orders of the control points in which an open curve may bend least, by the costs of legs.

The fairest open curve often visits its points in another order than the shortest one. With few
points all orders are compared; with more, those that reverse a section of the shortest one
("2-opt": Croes, "A method for solving traveling-salesman problems", 1958). Closed curves do not
gain from other orders than those to which uncrossing leads.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Mapping

import numpy as np

from ..geometry.array_types import IntArray
from .hop_graph import CourseGraph
from .leg_routes import LegChoices, LegStates, least_totals, without_rounding_errors

MOST_POINTS = 7
"""Number of points above which only the shortest order is tried; there are too many pairs of points
then, and crossing legs are uncrossed later anyway."""

MOST_ORDERS = 60
"""Number of orders up to which all of them are tried."""

DIRECTIONS_OF_A_LEG = 24
"""Number of pairs of end directions of a leg with which an order is tried."""

MAX_COST_OF_ORDER = 2.0
"""Cost of an order, relative to the cheapest, above which it is left out."""


def possible_orders(count: int) -> list[IntArray]:
    """Orders of points 0 … count - 1 that are tried, each once, 0 … count - 1 the first.

    An order is the same in the opposite direction. All orders are tried if they are at most
    `MOST_ORDERS`, else those that reverse a section of 0 … count - 1.
    """
    base = np.arange(count)
    if math.factorial(count) <= 2 * MOST_ORDERS:
        # Of both directions, the first in lexicographic order.
        orders = itertools.permutations(range(count))
        return [np.array(each) for each in orders if each[0] <= each[-1]]
    reversed_sections = [
        np.concatenate([base[:first], base[first : last + 1][::-1], base[last + 1 :]])
        for first, last in itertools.combinations(range(count), 2)
        if last - first < count - 1  # not the whole order
    ]
    return [base, *reversed_sections]


def legs_of_order(order: IntArray, closed: bool) -> IntArray:
    """The points at both ends of every leg, (l, 2)."""
    legs = np.stack([order, np.roll(order, -1)], axis=1)
    return legs if closed else legs[:-1]


def cheapest_orders(
    graph: CourseGraph,
    choices: Mapping[tuple[int, int], LegChoices],
) -> list[IntArray]:
    """Find cheap orders of all control points of an open curve, by ascending cost.

    The cost of an order is that of its cheapest legs whose directions fit each other. Crossings do
    not count.

    Parameters
    ----------
    graph : CourseGraph
        Its k control points are in an order that makes a short tour.
    choices : mapping
        Choices for the legs between all pairs of points.
    """
    orders, costs = [], []
    for order in possible_orders(len(graph.points)):
        legs = [
            _first_choices(choices[start, end].by_direction)
            for start, end in legs_of_order(order, closed=False).tolist()
        ]
        if all(len(leg.state) for leg in legs):
            orders.append(order)
            costs.append(float(least_totals(graph, legs, closed=False)[0].min()))
    cost = without_rounding_errors(np.array(costs))
    ascending = np.argsort(cost, kind="stable")
    cheap = ascending[cost[ascending] <= MAX_COST_OF_ORDER * cost.min(initial=np.inf)]
    return [orders[number] for number in cheap.tolist()]


def _first_choices(legs: LegStates) -> LegStates:
    kept = slice(DIRECTIONS_OF_A_LEG)
    return LegStates(legs.state[kept], legs.cost[kept], legs.first[kept], legs.last[kept])
