"""Finds routes of each leg: good paths between its two control points that differ from each other.

Shortest paths from both ends of a leg meet in every state of the hop graph. So every state gives
the best path through it, and these paths differ in their course and in their directions at both
ends.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import sparse
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

ALL_DIRECTIONS, ALL_ROUTES = 320, 120
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


@dataclass(frozen=True)
class _Paths:
    """The states of several paths, concatenated."""

    states: IntArray
    begins: IntArray  # (p + 1,) where each path begins, and the end


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
        total = without_rounding_errors(graph.by_state(start, end))
        first, last = graph.first[start], graph.reverse[graph.first[end][graph.reverse]]
        ascending = np.argsort(total, kind="stable")
        ascending = ascending[: np.count_nonzero(np.isfinite(total))]
        both_ends = first[ascending] * len(total) + last[ascending]
        directions = _least_of_each(both_ends, ascending, total)[:n_directions]
        cells = _least_of_each(graph.hops.end[ascending], ascending, total)
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
    beside: sparse.csr_array,
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
    beside : sparse array
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
        paths = _paths(graph, start, end, states)
        passed = _passed_cells(graph, paths)
        alike = _alike(beside, passed)
        first, last = paths.states[paths.begins[:-1]], paths.states[paths.begins[1:] - 1]
        # A path that passes no cell twice passes one cell more than it has states.
        simple = passed.sum(axis=1) == 1 + np.diff(paths.begins)
        # A direct hop between the control points is both the first and the last state.
        ends = np.stack([graph.hops.end[first], graph.hops.start[last]], axis=1)
        chosen = _distinct_paths(simple, ends, alike, len(best), n_aligned, n_different)
        passes = [
            np.append(
                graph.hops.start[first[path]],
                graph.hops.end[paths.states[paths.begins[path] : paths.begins[path + 1]]],
            )
            for path in chosen
        ]
        routes.append(
            Routes(
                start, end, passes, first[chosen], last[chosen], cost[chosen],
                alike[np.ix_(chosen, chosen)],
            )
        )  # fmt: skip
    return routes if all(len(leg.cells) for leg in routes) else []


def junction_cost(graph: CourseGraph, arriving: IntArray, leaving: IntArray) -> FloatArray:
    """Bending at a control point, (a, b), where `a` states end and `b` states start."""
    hops = graph.hops
    cosine = hops.arriving[arriving] @ hops.leaving[leaving].T
    step = 0.5 * (hops.length[arriving][:, None] + hops.length[leaving])
    return np.arccos(cosine.clip(-1.0, 1.0)) ** 2 / np.maximum(step, tolerances.TINY)


def without_rounding_errors(cost: FloatArray) -> FloatArray:
    """Costs without rounding errors, so that equal costs compare as equal.

    The best legs through two states may be the same leg; both costs then differ only by rounding.
    """
    unit = tolerances.SAME_COST * float(cost[np.isfinite(cost)].min(initial=np.inf))
    return np.round(cost / unit) * unit if 0.0 < unit < np.inf else cost


def _least_of_each(key: IntArray, ascending: IntArray, cost: FloatArray) -> IntArray:
    """The cheapest state of each key; `ascending`, `key` and the result are in order of cost."""
    least = ascending[np.unique(key, return_index=True)[1]]
    return least[np.argsort(cost[least], kind="stable")]


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
        least = (forward[-1][:, :, None] + joints[i - 1]).min(axis=1)
        forward.append(least + legs[i].cost)
    backward = [joints[-1] if closed else np.zeros((len(legs[-1].cost), 1))]
    for i in range(count - 2, -1, -1):
        onward = legs[i + 1].cost[:, None] + backward[0]
        backward.insert(0, (joints[i][:, :, None] + onward).min(axis=1))
    return [(f + b.T).min(axis=0) for f, b in zip(forward, backward, strict=True)]


def _paths(graph: CourseGraph, start: int, end: int, states: IntArray) -> _Paths:
    """The best leg through each state, as a path of states."""
    before = _states_before(graph, start, states)
    after = _states_before(graph, end, graph.reverse[states])[-2::-1]
    # Paths from the end of the leg pass the states in reverse.
    whole = np.concatenate([before, np.where(after < 0, -1, graph.reverse[after])]).T
    passed = whole >= 0
    return _Paths(whole[passed], np.append(0, np.cumsum(passed.sum(axis=1))))


def _passed_cells(graph: CourseGraph, paths: _Paths) -> NDArray[np.float32]:
    """Incidence matrix, (p, n + k): 1 where a path passes a cell, 0 elsewhere."""
    count = np.diff(paths.begins)
    passed = np.zeros((len(count), len(graph.positions)), dtype=np.float32)
    path = np.arange(len(count)).repeat(count)
    passed[path, graph.hops.end[paths.states]] = 1.0
    passed[np.arange(len(count)), graph.hops.start[paths.states[paths.begins[:-1]]]] = 1.0
    return passed


def _states_before(graph: CourseGraph, control: int, states: IntArray) -> IntArray:
    """States on the best paths from a control point to s states, (most, s), after padding by -1."""
    previous = graph.previous[control]
    rows = [states]
    while True:
        before = np.where(rows[-1] < 0, -1, previous[rows[-1]])
        if (before < 0).all():
            return np.array(rows[::-1])
        rows.append(before)


def cells_beside(graph: CourseGraph) -> sparse.csr_array:
    """Which cells lie beside each other, (n + k, n + k)."""
    scale = max(float(np.median(graph.hops.length)), tolerances.TINY)
    places = np.concatenate([graph.positions / scale, NORMAL_WEIGHT * graph.normals], axis=1)
    pairs = cKDTree(places).query_pairs(SAME_ROUTE, output_type="ndarray")
    size = len(places)
    rows = np.concatenate([pairs[:, 0], pairs[:, 1], np.arange(size)])
    columns = np.concatenate([pairs[:, 1], pairs[:, 0], np.arange(size)])
    return sparse.csr_array((np.ones(len(rows), np.float32), (rows, columns)), shape=(size, size))


def _alike(beside: sparse.csr_array, passed: NDArray[np.float32]) -> BoolArray:
    """Pairs of paths that run beside each other, (p, p), from the cells that they pass."""
    away = (beside @ passed.T == 0.0).astype(np.float32)
    inside = passed @ away == 0.0
    return inside & inside.T


def _distinct_paths(
    simple: BoolArray,
    ends: IntArray,
    alike: BoolArray,
    n_first: int,
    n_aligned: int,
    n_different: int,
) -> list[int]:
    """Indices of paths that differ from each other: aligned paths, then further paths.

    Among the first `n_first` paths, two also differ if one of the cells next to their control
    points, `ends` (p, 2), differs.
    """
    same = alike & (ends[:, None] == ends).all(axis=2)
    aligned = _add_distinct(same, np.flatnonzero(simple[:n_first]), [], n_aligned)
    others = n_first + np.flatnonzero(simple[n_first:])
    return _add_distinct(alike, others, aligned, len(aligned) + n_different)


def _add_distinct(alike: BoolArray, order: IntArray, chosen: list[int], most: int) -> list[int]:
    """The chosen paths, extended in order by paths unlike all chosen so far, up to `most` paths."""
    chosen = chosen.copy()
    left = ~alike[chosen].any(axis=0)
    for number in order.tolist():
        if len(chosen) >= most:
            break
        if left[number]:
            chosen.append(number)
            left &= ~alike[number]
    return chosen
