"""Finds routes of each leg: good paths between its two control points that differ from each other.

Shortest paths from both ends of a leg meet in every state of the hop graph. So every state gives
the best path through it, and these paths differ in their course and in their directions at both
ends.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass

import nicmm_kernels
import numpy as np
from scipy.spatial import cKDTree

from ..geometry import tolerances
from ..geometry.array_types import BoolArray, FloatArray, IntArray
from .hop_graph import CourseGraph

DIRECTIONS = 64
"""Number of pairs of end directions of a leg that are compared with those of the other legs."""

ALIGNED = 16
"""Number of routes of a leg that fit the directions of the other legs best."""

DIFFERENT = 8
"""Number of further routes of a leg, which run elsewhere."""

ALL_DIRECTIONS, ALL_ROUTES = 1_600, 600
"""Caps on the totals of direction pairs and routes over all legs; every leg gets a few anyway."""

MAX_RELATIVE_ROUTE_COST = 8.0
"""Greatest cost of a further route, relative to the cheapest route of its leg."""

VIA_CELLS = 120
"""Greatest number of cells through which further routes are tried."""

SAME_ROUTE = 1.5
"""Distance, in median hop lengths, within which two routes count as the same."""

NORMAL_WEIGHT = 0.8
"""Weight of the difference of two unit normals in that distance, so that routes on opposite sides
of a thin part differ."""


@dataclass(frozen=True)
class Routes:
    """The routes of one leg.

    Attributes
    ----------
    start, end : int
        Indices of the control points at both ends.
    cells : list of (c,) int arrays
        Cells of each of the r routes, including both control points.
    first, last : (r,) int array
        First and last state of each route.
    cost : (r,) float array
        Cost of each route.
    alike : (r, r) bool array
        Pairs of routes that run beside each other.
    """

    start: int
    end: int
    cells: list[IntArray]
    first: IntArray
    last: IntArray
    cost: FloatArray
    alike: BoolArray


@dataclass(frozen=True)
class LegStates:
    """The best leg through each of some states, by ascending cost.

    Attributes
    ----------
    state : (s,) int array
    cost : (s,) float array
        Cost of the leg through each state.
    first, last : (s,) int array
        First and last state of each leg.
    """

    state: IntArray
    cost: FloatArray
    first: IntArray
    last: IntArray

    def backward(self, graph: CourseGraph) -> LegStates:
        """The same legs in the opposite direction."""
        reverse = graph.reverse
        return LegStates(reverse[self.state], self.cost, reverse[self.last], reverse[self.first])


@dataclass(frozen=True)
class LegChoices:
    """Legs between two control points among which routes are chosen.

    Attributes
    ----------
    by_direction : LegStates
        The best legs with different pairs of end directions.
    by_cell : LegStates
        The best legs through different cells.
    """

    by_direction: LegStates
    by_cell: LegStates

    def backward(self, graph: CourseGraph) -> LegChoices:
        """The same legs in the opposite direction."""
        return LegChoices(self.by_direction.backward(graph), self.by_cell.backward(graph))


def leg_choices(
    graph: CourseGraph, pairs: Iterable[tuple[int, int]], n_legs: int
) -> dict[tuple[int, int], LegChoices]:
    """Find choices for legs between pairs of control points, in both directions.

    Parameters
    ----------
    graph : CourseGraph
    pairs : iterable of (int, int)
        Indices of two control points each.
    n_legs : int
        Number of legs of a course.
    """
    n_directions = min(DIRECTIONS, max(20, ALL_DIRECTIONS // n_legs))
    found = {}
    for start, end in pairs:
        total, directions, cells = nicmm_kernels.best_legs(
            graph.for_kernels, (start, end), graph.weights, tolerances.SAME_COST
        )
        first, last = graph.first[start], graph.last(end)
        both_ends = first[directions] * len(total) + last[directions]
        directions = directions[np.lexsort((both_ends, total[directions]))][:n_directions]
        cells = cells[np.argsort(total[cells], kind="stable")]
        cells = cells[total[cells] <= MAX_RELATIVE_ROUTE_COST * total[cells[:1]]]
        cells = cells[:: max(1, -(-len(cells) // VIA_CELLS))]
        choices = LegChoices(
            *(
                LegStates(state, total[state], first[state], last[state])
                for state in (directions, cells)
            )
        )
        found[start, end], found[end, start] = choices, choices.backward(graph)
    return found


def routes_of_legs(
    graph: CourseGraph,
    choices: Mapping[tuple[int, int], LegChoices],
    legs: IntArray,
    closed: bool,
    beside: IntArray,
) -> list[Routes]:
    """Find routes of consecutive legs, (l, 2).

    Some routes are chosen because their directions fit those of the other legs, some because they
    run elsewhere. The result is empty if any leg has no route.

    Parameters
    ----------
    graph : CourseGraph
    choices : mapping
        Choices for each of the legs, by its two points.
    legs : (l, 2) int array
    closed : bool
    beside : (n + k, w) int array
        The result of `cells_beside`.
    """
    n_routes = max(6, ALL_ROUTES // max(1, len(legs)))
    n_aligned = min(ALIGNED, (2 * n_routes) // 3)
    n_different = min(DIFFERENT, n_routes // 3)
    by_direction = [choices[start, end].by_direction for start, end in legs.tolist()]
    by_cell = [choices[start, end].by_cell for start, end in legs.tolist()]
    if not all(len(choice.state) for choice in by_direction):
        return []
    totals = least_totals(graph, by_direction, closed)
    routes = []
    for (start, end), aligned, other, least in zip(
        legs.tolist(), by_direction, by_cell, totals, strict=True
    ):
        best = np.argsort(without_rounding_errors(least), kind="stable")[: 3 * n_aligned]
        states = np.concatenate([aligned.state[best], other.state])
        cost = np.concatenate([aligned.cost[best], other.cost])
        chosen, first, last, cells, alike = nicmm_kernels.distinct_routes(
            graph.for_kernels, (start, end), beside, states, len(best), n_aligned, n_different
        )
        routes.append(Routes(start, end, cells, first, last, cost[chosen], alike))
    return routes if all(len(leg.cells) for leg in routes) else []


def junction_cost(graph: CourseGraph, arriving: IntArray, leaving: IntArray) -> FloatArray:
    """Bending at a control point, (a, b), where `a` states end and `b` states start."""
    hops = graph.hops
    if graph.corners[hops.end[arriving[:1]] - len(graph.graph.vertex)].any():
        return np.zeros((len(arriving), len(leaving)))
    cosine = hops.arriving[arriving] @ hops.leaving[leaving].T
    step = 0.5 * (hops.length[arriving][:, None] + hops.length[leaving])
    return np.arccos(cosine.clip(-1.0, 1.0)) ** 2 / np.maximum(step, tolerances.TINY)


def without_rounding_errors(cost: FloatArray) -> FloatArray:
    """Costs without rounding errors, so that equal costs compare as equal.

    The best legs through two states may be the same leg; both costs then differ only by rounding.
    """
    unit = tolerances.SAME_COST * float(cost.min(initial=np.inf))
    return np.round(cost / unit) * unit if 0.0 < unit < np.inf else cost


def least_totals(graph: CourseGraph, legs: list[LegStates], closed: bool) -> list[FloatArray]:
    """For each leg, the least cost of a whole curve through each of its choices.

    Viterbi's algorithm runs forward and backward; on a closed curve, it does so for every choice of
    the first leg.
    """
    count = len(legs)
    joints = [
        junction_cost(graph, legs[i].last, legs[(i + 1) % count].first)
        for i in range(count if closed else count - 1)
    ]
    begin = legs[0].cost[None]
    if closed:
        begin = np.where(np.eye(len(legs[0].cost), dtype=bool), begin, np.inf)
    forward = [begin]
    for i in range(1, count):
        forward.append(nicmm_kernels.least_sums(forward[-1], joints[i - 1]) + legs[i].cost)
    backward = [joints[-1] if closed else np.zeros((len(legs[-1].cost), 1))]
    for i in range(count - 2, -1, -1):
        onward = legs[i + 1].cost[:, None] + backward[0]
        backward.insert(0, nicmm_kernels.least_sums(joints[i], onward))
    return [(f + b.T).min(axis=0) for f, b in zip(forward, backward, strict=True)]


def cells_beside(graph: CourseGraph) -> IntArray:
    """The cells that lie beside each of the n + k cells, as `nicmm_kernels.cell_sets`."""
    scale = max(float(np.median(graph.hops.length)), tolerances.TINY)
    places = np.concatenate([graph.positions / scale, NORMAL_WEIGHT * graph.normals], axis=1)
    one, other = cKDTree(places).query_pairs(SAME_ROUTE, output_type="ndarray").T
    beside = np.eye(len(places), dtype=bool)
    beside[one, other] = beside[other, one] = True
    return nicmm_kernels.cell_sets(beside)
