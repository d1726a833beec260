"""Finds candidates for the course of a curve: the cheapest combinations of routes in the hop graph.

Orders of the control points are compared by the costs of legs (`leg_orders`), routes are found for
the legs of the cheapest orders (`leg_routes`), and the routes are combined (`leg_combinations`).
"""

from __future__ import annotations

from itertools import combinations

import numpy as np

from ..geometry.array_types import IntArray
from ..progress import checkpoint, subrange
from ..relaxation.curve_nodes import CurveSurface, Nodes, nodes_at
from .hop_graph import CourseGraph
from .leg_combinations import (
    MANY_LEGS,
    cheapest_combinations,
    course_nodes,
    crossing_legs,
    curves_on_routes,
    distinct_combinations,
    junctions_of_routes,
    steps_of_course,
)
from .leg_orders import MOST_POINTS, cheapest_orders, legs_of_order
from .leg_routes import LegChoices, Routes, cells_beside, leg_choices, routes_of_legs


def candidates(
    courses: CourseGraph,
    surface: CurveSurface,
    closed: bool,
    smoothness: float,
    any_order: bool,
    most: int,
    most_orders: int,
) -> tuple[Nodes, IntArray] | None:
    """Find the cheapest courses in the cheapest orders of the control points.

    Parameters
    ----------
    courses : CourseGraph
        The hop graph with k control points.
    surface : CurveSurface
        Surface with the maps of the request.
    closed : bool
    smoothness : float
        Divisor of the tension.
    any_order : bool
        Whether an open course may visit the control points in another order because it is cheaper.
    most : int
        Greatest number of candidates.
    most_orders : int
        Greatest number of orders of the control points among which they are divided.

    Returns
    -------
    (Nodes, (n,) int array) or None
        The courses, and the control point at each node, -1 at all other nodes. None without any
        course.
    """
    count = len(courses.points)
    order = np.arange(count)
    n_legs = count if closed else count - 1
    if any_order and not closed and count <= MOST_POINTS:
        pairs = combinations(range(count), 2)
        choices = leg_choices(courses, pairs, n_legs)
        orders = [*cheapest_orders(courses, choices), order]
    else:
        legs = legs_of_order(order, closed).tolist()
        choices = leg_choices(courses, ((start, end) for start, end in legs), n_legs)
        orders = [order]
    checkpoint()
    possible, routes = _routes_of_orders(courses, choices, orders, closed, most_orders)
    if not routes:
        return None
    with subrange(0.2, 0.3):
        curves = curves_on_routes(
            courses, [leg for of_order in routes for leg in of_order], n_legs, smoothness
        )
    crosses = crossing_legs(curves)
    # The first order takes over the candidates of orders that there are not.
    of_others = [most // most_orders] * (len(routes) - 1)
    shares = [most - sum(of_others), *of_others]
    choice, visit = [], []
    for number, (of_order, order, share) in enumerate(zip(routes, possible, shares, strict=True)):
        own = slice(
            curves.of_leg(number * n_legs).start, curves.of_leg((number + 1) * n_legs - 1).stop
        )
        found = cheapest_combinations(
            [leg.cost for leg in of_order],
            junctions_of_routes(courses, of_order, closed),
            crosses[own, own],
            closed,
            # Few legs have enough different combinations without regard to kinds.
            kinds=[leg.alike.argmax(axis=1) for leg in of_order] if n_legs >= MANY_LEGS else None,
        )
        found = distinct_combinations([leg.alike for leg in of_order], found, share)
        choice.append(own.start + found.choice)
        visit.append(np.tile(order, len(found.choice)))
    chosen = np.concatenate(choice)
    if not len(chosen):
        return None
    nodes, at_points = course_nodes(curves, chosen, closed, steps_of_course(n_legs))
    point = np.full(len(at_points), -1)
    point[at_points] = np.concatenate(visit)
    # Legs were placed on the surface without maps.
    return nodes_at(surface, nodes.places, closed, nodes.curves), point


def _routes_of_orders(
    courses: CourseGraph,
    choices: dict[tuple[int, int], LegChoices],
    orders: list[IntArray],
    closed: bool,
    most: int,
) -> tuple[list[IntArray], list[list[Routes]]]:
    """The first orders all of whose legs have routes, each once, with the routes of their legs."""
    routes: list[list[Routes]] = []
    possible: list[IntArray] = []
    beside = cells_beside(courses)
    for order in orders:
        if any(np.array_equal(order, other) for other in possible):
            continue
        of_order = routes_of_legs(courses, choices, legs_of_order(order, closed), closed, beside)
        if of_order:
            routes.append(of_order)
            possible.append(order)
        if len(routes) == most:
            break
    return possible, routes
