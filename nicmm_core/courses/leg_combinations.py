"""Combines one curve per leg into whole courses, the cheapest first; crossings add to the cost.

The curves of the legs are routes of the hop graph, or legs of relaxed courses (`recombination`).
Routes are placed on the surface as straight traces between a few nodes. They are relaxed a little,
so that routes through the same cells separate. Then all curves are tested for crossings together.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from ..geometry import tolerances
from ..geometry.array_types import BoolArray, FloatArray, IntArray
from ..geometry.crossings import meeting_segments
from ..geometry.surface_points import SurfacePoints
from ..geometry.tracing import strictly_inside, trace_from
from ..progress import checkpoint
from ..relaxation.batch_relaxation import BatchConfig, curves_of, relax_batch
from ..relaxation.curve_nodes import CurveSurface, Nodes, nodes_at
from ..relaxation.even_nodes import resampled
from ..relaxation.node_traces import (
    NodeTraces,
    places_along,
    traced_segments,
    traces_between_nodes,
)
from .hop_graph import CourseGraph
from .leg_routes import Routes, junction_cost, without_rounding_errors

NODES_OF_A_ROUTE, FEWEST_NODES, MOST_NODES = 16, 6, 96
"""Number of nodes of a route, and its least value.

The number is reduced where its sum over all legs would exceed the third value.
"""

NODES, FEWEST_SHARED = 96, 48
"""Number of nodes of a course, and least number of them that its legs share by their lengths.

In addition, every leg gets `FEWEST_NODES`, so with many legs a course has more nodes.
"""

SEPARATING = BatchConfig(iterations=2, contact=False, longest_move=2.0)
"""Settings with which routes are relaxed before the test; their end directions are kept."""

CROSSING = 0.1
"""Cost of a crossing of two legs, relative to the sum of the least costs of all legs.

Crossings are not forbidden, since `uncrossing` may remove them.
"""

BEAM_WIDTH = 3_000
"""Number of incomplete combinations kept after each leg."""


MAX_RELATIVE_COST, OF_MANY_LEGS, MANY_LEGS = 1.5, 2.5, 5
"""Cost of a combination, relative to the cheapest, above which it is not relaxed; its value for
many legs, and the number from which they are many. Short legs have few cells, so that costs are
less accurate."""


@dataclass(frozen=True)
class LegCurves:
    """Curves for the legs of courses, in one or more orders of the control points.

    Attributes
    ----------
    surface : CurveSurface
    nodes : Nodes
        r open curves, sorted by leg.
    leg : (r,) int array
        Leg of each curve, ascending.
    ends : (r, 2) int array
        Control points at both ends of each curve.
    n_legs : int
        Number of legs of a course; the legs of each order are consecutive.
    """

    surface: CurveSurface
    nodes: Nodes
    leg: IntArray
    ends: IntArray
    n_legs: int

    @cached_property
    def traces(self) -> NodeTraces:
        """Traces between the nodes."""
        return traces_between_nodes(self.surface, self.nodes)

    def only(self, which: IntArray) -> LegCurves:
        """Some of the curves, by their indices, which are sorted by leg."""
        nodes = curves_of(self.nodes, which)
        return LegCurves(self.surface, nodes, self.leg[which], self.ends[which], self.n_legs)

    def of_leg(self, leg: int) -> slice:
        """The curves of one leg."""
        return slice(*np.searchsorted(self.leg, [leg, leg + 1]).tolist())


@dataclass(frozen=True)
class Combinations:
    """Courses, each given by one curve per leg.

    Attributes
    ----------
    choice : (c, l) int array
        Index of the curve of each leg of each course, among all curves.
    cost : (c,) float array
        Cost of each course, ascending.
    """

    choice: IntArray
    cost: FloatArray


def curves_on_routes(
    graph: CourseGraph, routes: list[Routes], n_legs: int, smoothness: float
) -> LegCurves:
    """Place nodes on all routes; each route is an open curve with the same number of nodes.

    Routes are relaxed with few nodes. Then the number of nodes is doubled, so that hardly any trace
    between neighbours fails.

    Parameters
    ----------
    graph : CourseGraph
    routes : list of Routes
        The routes of each leg, in one or more orders of the control points.
    n_legs : int
        Number of legs of a course.
    smoothness : float
    """
    surface = graph.graph.surface
    count = 1 + max(FEWEST_NODES, min(NODES_OF_A_ROUTE, MOST_NODES // n_legs))
    paths = [path for leg in routes for path in leg.cells]
    cells = np.concatenate(paths)
    begins = np.cumsum([0, *(len(path) for path in paths)])
    paired = np.ones(len(cells) - 1, dtype=bool)
    paired[begins[1:-1] - 1] = False  # from one path to the next there is no hop
    state, steps = np.zeros(len(paired), dtype=np.int64), np.zeros(len(paired))
    state[paired] = graph.state_between(cells[:-1][paired], cells[1:][paired])
    steps[paired] = graph.hops.length[state[paired]]
    arc = np.append(0.0, np.cumsum(steps))
    at = np.linspace(arc[begins[:-1]], arc[begins[1:] - 1], count, axis=1)
    hop = np.searchsorted(arc, at, side="right") - 1
    hop = hop.clip(begins[:-1, None], begins[1:, None] - 2)
    along = ((at - arc[hop]) / np.maximum(steps[hop], tolerances.TINY)).clip(0.0, 1.0).ravel()
    one, other = cells[hop.ravel()], cells[hop.ravel() + 1]
    nearer = along <= 0.5 + tolerances.ROUNDED  # halfway counts as nearer to the first
    places = graph.cells[np.where(nearer, one, other)]
    taken = state[hop.ravel()]
    leaving, arriving = graph.hops.leaving[taken], graph.hops.arriving[taken]
    direction = np.where(nearer[:, None], leaving, -arriving)
    length = np.where(nearer, along, 1.0 - along) * graph.hops.length[taken]
    ends = _is_end(count, paths)
    length[ends | (length <= tolerances.SAME_POSITION * surface.mesh.diagonal)] = 0.0
    inside = SurfacePoints(places.faces, strictly_inside(places.barycentric))
    moved = trace_from(surface.mesh, inside, direction, length, surface.folded)[0]
    # Control points stay exactly where they are.
    faces = np.where(ends, places.faces, moved.faces)
    barycentric = np.where(ends[:, None], places.barycentric, moved.barycentric)
    nodes = nodes_at(surface, SurfacePoints(faces, barycentric), False, len(paths))
    clamped = np.zeros((len(paths), count), dtype=bool)
    clamped[:, [0, 1, -2, -1]] = True
    nodes = relax_batch(surface, nodes, clamped.ravel(), smoothness, SEPARATING)
    numbers = [len(leg.cells) for leg in routes]
    return LegCurves(
        surface,
        resampled(surface, nodes, clamped.ravel(), 2)[0],
        np.arange(len(routes)).repeat(numbers),
        np.array([[leg.start, leg.end] for leg in routes]).repeat(numbers, axis=0),
        n_legs,
    )


def _is_end(count: int, paths: list[IntArray]) -> BoolArray:
    """Whether each node is the first or the last of its path."""
    ends = np.zeros((len(paths), count), dtype=bool)
    ends[:, [0, -1]] = True
    return ends.ravel()


def crossing_legs(curves: LegCurves) -> BoolArray:
    """Which pairs of curves cross, of different legs in one order, or a curve itself, (r, r).

    Curves that share a control point may touch there.
    """
    segments = traced_segments(curves.traces)
    count, leg, legs = curves.nodes.per_curve, curves.leg, curves.ends
    curve = segments.node // count
    group = (leg[curve] // curves.n_legs) * len(curves.surface.mesh.faces) + segments.face
    one, other = meeting_segments(group, segments.start, segments.end).T
    first, second = curve[one], curve[other]
    kept = (leg[first] != leg[second]) | ((first == second) & (np.abs(one - other) > 1))
    one, other, first, second = one[kept], other[kept], first[kept], second[kept]
    common = np.zeros(len(one), dtype=bool)
    ends = (0, count - 2)  # the nodes whose segments touch control points
    for i, node in enumerate(ends):
        for j, node_there in enumerate(ends):
            common |= (
                (legs[first, i] == legs[second, j])
                & (segments.node[one] % count == node)
                & (segments.node[other] % count == node_there)
            )
    first, second = first[~common], second[~common]
    crosses = np.zeros((len(leg), len(leg)), dtype=bool)
    crosses[first, second] = crosses[second, first] = True
    return crosses


def junctions_of_routes(graph: CourseGraph, routes: list[Routes], closed: bool) -> list[FloatArray]:
    """Cost of the turn at every control point between two legs, for all pairs of their routes."""
    following = [*routes[1:], *routes[:1]] if closed else routes[1:]
    return [
        junction_cost(graph, before.last, after.first)
        for before, after in zip(routes, following, strict=False)
    ]


def cheapest_combinations(
    costs: list[FloatArray],
    junctions: list[FloatArray],
    crosses: BoolArray,
    closed: bool,
    kinds: list[IntArray] | None = None,
) -> Combinations:
    """Find the cheapest combinations of curves by beam search, leg by leg.

    Of several ones with curves of the same kinds, hardly more than the cheapest can become the
    beginning of the best whole course, since the other legs depend on the last curve and the first
    one only. So the others are left out, and the combinations that are kept really differ.

    Parameters
    ----------
    costs : list of float arrays
        Costs of the curves of each leg.
    junctions : list of (a, b) float arrays
        Cost of each pair of curves of two consecutive legs; of a closed course, also of the last
        leg and the first one.
    crosses : (r, r) bool array
        Which curves cross, by their indices among the curves of all legs.
    closed : bool
    kinds : list of int arrays, optional
        Kind of each curve of each leg, as a number below the number of curves; those that run
        beside each other have the same one. If omitted, all are different.
    """
    count = len(costs)
    offset = np.cumsum([0] + [len(cost) for cost in costs])
    price = CROSSING * sum(cost.min() for cost in costs)
    of_itself = np.where(np.diagonal(crosses), price, 0.0)
    choice = np.arange(offset[1])[:, None]
    cost = costs[0] + of_itself[: offset[1]]
    if kinds is None:
        kinds = [np.arange(len(each)) for each in costs]
    kind = kinds[0]  # a number for the kinds of all curves so far
    for number in range(1, count):
        checkpoint()
        here = slice(offset[number], offset[number + 1])
        total = cost[:, None] + costs[number] + of_itself[here]
        total = total + junctions[number - 1][choice[:, -1] - offset[number - 1]]
        if closed and number == count - 1:
            total = total + junctions[number][:, choice[:, 0]].T
        crossed = np.zeros(total.shape, dtype=np.uint8)  # number of crossings with earlier legs
        for earlier in range(number):
            crossed += crosses[:, here].take(choice[:, earlier], axis=0)
        total += price * crossed
        total = _least_of_each(total, kind * offset[1] + choice[:, 0])
        best = _least(without_rounding_errors(total).ravel(), BEAM_WIDTH)
        best = best[np.isfinite(total.ravel()[best])]
        row, curve = np.divmod(best, total.shape[1])
        choice = np.concatenate([choice[row], offset[number] + curve[:, None]], axis=1)
        cost = total.ravel()[best]
        pairs = kind[row] * len(costs[number]) + kinds[number][curve]
        kind = np.unique(pairs, return_inverse=True)[1]
    ascending = np.argsort(cost, kind="stable")  # the loop does not run for a single leg
    return Combinations(choice[ascending], cost[ascending])


def _least_of_each(costs: FloatArray, group: IntArray) -> FloatArray:
    """Costs, (b, a), that are infinite unless they are the least of a column in a group of rows."""
    order = np.argsort(group, kind="stable")
    ordered = costs[order]
    begins = np.diff(group[order], prepend=-1) > 0
    least = np.minimum.reduceat(ordered, np.flatnonzero(begins), axis=0)
    result = np.empty_like(costs)
    result[order] = np.where(ordered <= least[np.cumsum(begins) - 1], ordered, np.inf)
    return result


def _least(values: FloatArray, most: int) -> IntArray:
    """Indices of the `most` smallest values, by ascending value."""
    among = np.arange(len(values))
    if len(values) > most:
        among = np.flatnonzero(values <= np.partition(values, most - 1)[most - 1])
    return among[np.argsort(values[among], kind="stable")[:most]]


def distinct_combinations(
    alike: list[BoolArray], combinations: Combinations, most: int
) -> Combinations:
    """The cheapest combinations, no two of which run beside each other on all legs.

    Parameters
    ----------
    alike : list of (a, a) bool arrays
        Pairs of curves of each leg that run beside each other.
    combinations : Combinations
    most : int
        Greatest number of combinations.
    """
    offset = np.cumsum([0] + [len(pairs) for pairs in alike])[:-1]
    choice = combinations.choice - offset
    left = combinations.cost <= most_cost(len(alike), combinations.cost)
    chosen: list[int] = []
    while left.any() and len(chosen) < most:
        best = int(left.argmax())
        chosen.append(best)
        same = np.ones(len(choice), dtype=bool)
        for leg, pairs in enumerate(alike):
            same &= pairs[choice[best, leg]][choice[:, leg]]
        left &= ~same
    return Combinations(combinations.choice[chosen], combinations.cost[chosen])


def most_cost(n_legs: int, costs: FloatArray) -> float:
    """The cost up to which combinations of legs are relaxed, given their costs."""
    limit = OF_MANY_LEGS if n_legs >= MANY_LEGS else MAX_RELATIVE_COST
    return limit * float(costs.min(initial=np.inf))


def steps_of_course(n_legs: int) -> int:
    """Number of steps between the nodes of a course."""
    return max(NODES, FEWEST_SHARED + FEWEST_NODES * n_legs)


def course_nodes(
    curves: LegCurves, choice: IntArray, closed: bool, steps: int
) -> tuple[Nodes, BoolArray]:
    """Place nodes on whole courses.

    Parameters
    ----------
    curves : LegCurves
    choice : (c, l) int array
        Index of the curve that each course takes on each leg.
    closed : bool
    steps : int
        Number of steps of each course.

    Returns
    -------
    Nodes
        c curves.
    (n,) bool array
        Which of their nodes are ends of legs.
    """
    surface, nodes = curves.surface, curves.nodes
    size = nodes.per_curve
    lengths = nodes.by_curve(nodes.step_lengths).sum(axis=1)
    counts = _step_counts(lengths[choice], steps)
    course = np.arange(len(choice)).repeat(counts.sum(axis=1))
    of_legs = counts.ravel()
    leg = np.tile(np.arange(choice.shape[1]), len(choice)).repeat(of_legs)
    place = np.arange(len(leg)) - (of_legs.cumsum() - of_legs).repeat(of_legs)
    at = place * (size - 1) / of_legs.repeat(of_legs)
    node = np.floor(at).astype(np.int64)
    places = places_along(
        surface, nodes, curves.traces, choice[course, leg] * size + node, at - node
    )
    starts = place == 0
    own = nodes.places[(choice * size).ravel()]
    faces, barycentric = places.faces.copy(), places.barycentric.copy()
    faces[starts], barycentric[starts] = own.faces, own.barycentric
    if not closed:
        last = nodes.places[choice[:, -1] * size + size - 1]
        after = np.arange(1, len(choice) + 1) * (len(leg) // len(choice))
        faces = np.insert(faces, after, last.faces)
        barycentric = np.insert(barycentric, after, last.barycentric, axis=0)
        starts = np.insert(starts, after, True)
    places = SurfacePoints(faces, barycentric)
    return nodes_at(surface, places, closed, len(choice)), starts


def _step_counts(lengths: FloatArray, steps: int) -> IntArray:
    """Numbers of steps of the legs of courses, (c, l), from the lengths of the legs, (c, l).

    All courses have the same number of steps.
    """
    shared = steps - FEWEST_NODES * lengths.shape[1]
    total = np.cumsum(lengths, axis=1)
    ends = np.round(shared * total / np.maximum(total[:, -1:], tolerances.TINY)).astype(np.int64)
    return FEWEST_NODES + np.diff(ends, axis=1, prepend=0)
