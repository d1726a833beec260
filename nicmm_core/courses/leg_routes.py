"""Routes of one leg: good paths between two control points that differ from each other.

Paths from both ends meet in every state of the graph. So every state gives the best path by it, and
these paths differ in their route and in their directions at both ends.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import sparse
from scipy.spatial import cKDTree

from ..geometry import tolerances
from ..geometry.array_types import BoolArray, FloatArray, IntArray
from .hop_graph import CourseGraph

DIRECTIONS = 64
"""Pairs of directions at both ends of a leg that are compared with those of other legs."""

ALIGNED = 16
"""Routes of a leg that fit those of its neighbours best."""

DIFFERENT = 8
"""Further routes of a leg, each along another way."""

ALL_DIRECTIONS, ALL_ROUTES = 320, 120
"""Caps on the sums of these over all legs, except that every leg has a few."""

WORST = 8.0
"""Greatest cost of a route relative to the best of its leg."""

VIA_CELLS = 120
"""Most cells by which other ways are tried."""

BESIDE = 1.5
"""Distance, in median lengths of hops, within which two routes count as the same."""

NORMAL_WEIGHT = 0.8
"""Weight of the difference of two unit normals in that distance: routes on both sides of a thin
part differ."""


@dataclass(frozen=True)
class Routes:
    """The routes of one leg.

    Attributes
    ----------
    start, end : int
        Control points.
    cells : list of (c,) int arrays
        Cells of each of r routes, with both control points.
    first, last : (r,) int array
        The states at both ends of each.
    cost : (r,) float array
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
class _ByState:
    """The best legs through states."""

    state: IntArray
    cost: FloatArray
    first: IntArray  # states at both ends
    last: IntArray


@dataclass(frozen=True)
class _Paths:
    """Paths one after another, each as the states on it."""

    states: IntArray
    begins: IntArray  # (p + 1,)


def routes_of_legs(graph: CourseGraph, legs: IntArray, closed: bool) -> list[Routes]:
    """Routes for legs, (l, 2), which follow each other.

    Some are chosen because their directions fit those of the other legs, some because they run
    elsewhere. There are no routes at all if one leg has none.
    """
    beside = _cells_beside(graph)
    share = max(1, len(legs))
    n_directions = min(DIRECTIONS, max(20, ALL_DIRECTIONS // share))
    n_routes = max(6, ALL_ROUTES // share)
    n_aligned = min(ALIGNED, (2 * n_routes) // 3)
    n_different = min(DIFFERENT, n_routes // 3)
    by_direction, by_cell = [], []
    for start, end in legs.tolist():
        total = rounded(graph.by_state(start, end))
        first, last = graph.first[start], graph.reverse[graph.first[end][graph.reverse]]
        ascending = np.argsort(total, kind="stable")
        ascending = ascending[: np.count_nonzero(np.isfinite(total))]
        both_ends = first[ascending] * len(total) + last[ascending]
        directions = _least_of_each(both_ends, ascending, total)[:n_directions]
        cells = _least_of_each(graph.hops.end[ascending], ascending, total)
        cells = cells[total[cells] <= WORST * total[cells[:1]]]
        cells = cells[:: max(1, -(-len(cells) // VIA_CELLS))]
        by_direction.append(
            _ByState(directions, total[directions], first[directions], last[directions])
        )
        by_cell.append(_ByState(cells, total[cells], first[cells], last[cells]))
    if not all(len(choice.state) for choice in by_direction):
        return []
    totals = _least_totals(graph, by_direction, closed)
    routes = []
    for (start, end), aligned, other, least in zip(
        legs.tolist(), by_direction, by_cell, totals, strict=True
    ):
        best = np.argsort(rounded(least), kind="stable")[: 3 * n_aligned]
        states = np.concatenate([aligned.state[best], other.state])
        cost = np.concatenate([aligned.cost[best], other.cost])
        paths = _paths(graph, start, end, states)
        passed = _passed_cells(graph, paths)
        alike = _alike(beside, passed)
        first, last = paths.states[paths.begins[:-1]], paths.states[paths.begins[1:] - 1]
        # A path that passes each cell once has as many of them as states, and its start.
        simple = passed.sum(axis=1) == 1 + np.diff(paths.begins)
        # A hop between two control points is a departure and an arrival too.
        ends = np.stack([graph.hops.end[first], graph.hops.start[last]], axis=1)
        chosen = _different(simple, ends, alike, len(best), n_aligned, n_different)
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
    return routes


def junction_cost(graph: CourseGraph, arriving: IntArray, leaving: IntArray) -> FloatArray:
    """Bending at a control point, (a, b), between a states that end and b that start there."""
    hops = graph.hops
    cosine = hops.arriving[arriving] @ hops.leaving[leaving].T
    step = 0.5 * (hops.length[arriving][:, None] + hops.length[leaving])
    return np.arccos(cosine.clip(-1.0, 1.0)) ** 2 / np.maximum(step, tolerances.TINY)


def rounded(cost: FloatArray) -> FloatArray:
    """Costs without rounding errors: the best leg by each of its own states costs the same."""
    unit = tolerances.SAME_COST * float(cost[np.isfinite(cost)].min(initial=np.inf))
    return np.round(cost / unit) * unit if 0.0 < unit < np.inf else cost


def _least_of_each(key: IntArray, ascending: IntArray, cost: FloatArray) -> IntArray:
    """The first state of each key by ascending cost; states and their keys ascend by cost."""
    least = ascending[np.unique(key, return_index=True)[1]]
    return least[np.argsort(cost[least], kind="stable")]


def _least_totals(graph: CourseGraph, legs: list[_ByState], closed: bool) -> list[FloatArray]:
    """For each leg, the least cost of a whole curve with each of its choices.

    Viterbi's algorithm forward and backward; on a closed curve, for every choice of the first leg.
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
    """The best leg through each state."""
    before = _states_before(graph, start, states)
    after = _states_before(graph, end, graph.reverse[states])[-2::-1]
    # Paths from the end pass states in the other direction.
    whole = np.concatenate([before, np.where(after < 0, -1, graph.reverse[after])]).T
    passed = whole >= 0
    return _Paths(whole[passed], np.append(0, np.cumsum(passed.sum(axis=1))))


def _passed_cells(graph: CourseGraph, paths: _Paths) -> NDArray[np.float32]:
    """1 at the cells that each path passes, (p, n + k)."""
    count = np.diff(paths.begins)
    passed = np.zeros((len(count), len(graph.positions)), dtype=np.float32)
    path = np.arange(len(count)).repeat(count)
    passed[path, graph.hops.end[paths.states]] = 1.0
    passed[np.arange(len(count)), graph.hops.start[paths.states[paths.begins[:-1]]]] = 1.0
    return passed


def _states_before(graph: CourseGraph, control: int, states: IntArray) -> IntArray:
    """States on the paths from a control point to some states, (most, s), after -1 at first."""
    previous = graph.previous[control]
    rows = [states]
    while True:
        before = np.where(rows[-1] < 0, -1, previous[rows[-1]])
        if (before < 0).all():
            return np.array(rows[::-1])
        rows.append(before)


def _cells_beside(graph: CourseGraph) -> sparse.csr_array:
    """Which cells are beside each other, (n + k, n + k)."""
    scale = max(float(np.median(graph.hops.length)), tolerances.TINY)
    places = np.concatenate([graph.positions / scale, NORMAL_WEIGHT * graph.normals], axis=1)
    pairs = cKDTree(places).query_pairs(BESIDE, output_type="ndarray")
    size = len(places)
    rows = np.concatenate([pairs[:, 0], pairs[:, 1], np.arange(size)])
    columns = np.concatenate([pairs[:, 1], pairs[:, 0], np.arange(size)])
    return sparse.csr_array((np.ones(len(rows), np.float32), (rows, columns)), shape=(size, size))


def _alike(beside: sparse.csr_array, passed: NDArray[np.float32]) -> BoolArray:
    """Pairs of paths, by the cells they pass, of which each runs beside the other."""
    away = (beside @ passed.T == 0.0).astype(np.float32)
    inside = passed @ away == 0.0
    return inside & inside.T


def _different(
    simple: BoolArray,
    ends: IntArray,
    alike: BoolArray,
    n_first: int,
    n_aligned: int,
    n_different: int,
) -> list[int]:
    """Indices of paths that differ: of the first ones in their cells next to the ends too.

    These are `ends`, (p, 2).
    """
    same = alike & (ends[:, None] == ends).all(axis=2)
    aligned = _apart(same, np.flatnonzero(simple[:n_first]), [], n_aligned)
    others = n_first + np.flatnonzero(simple[n_first:])
    return _apart(alike, others, aligned, len(aligned) + n_different)


def _apart(alike: BoolArray, order: IntArray, chosen: list[int], most: int) -> list[int]:
    """The chosen ones and the next in an order that are like none of them, up to a number."""
    chosen = chosen.copy()
    left = ~alike[chosen].any(axis=0)
    for number in order.tolist():
        if len(chosen) >= most:
            break
        if left[number]:
            chosen.append(number)
            left &= ~alike[number]
    return chosen
