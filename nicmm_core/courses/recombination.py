"""Combines legs of relaxed courses into new courses.

Relaxation makes every course as good as its neighbours in the graph allow, but hardly any course is
good everywhere. Legs of different courses start and end at the same control points. So the best
legs of all courses are combined, as routes of the graph were before, now with the energies of
relaxed legs.
"""

from __future__ import annotations

import nicmm_kernels
import numpy as np

from ..geometry import tolerances
from ..geometry.array_types import BoolArray, FloatArray, IntArray
from ..geometry.surface_points import SurfacePoints
from ..geometry.vectors import lengths
from ..progress import checkpoint
from ..relaxation.batch_relaxation import curves_of
from ..relaxation.curve_nodes import CurveSurface, Nodes, nodes_at
from ..relaxation.elastic_energy import comparable_energies, comparable_terms
from ..relaxation.node_traces import places_along, traces_between_nodes
from .comparison import SAME_COURSE
from .leg_combinations import (
    LegCurves,
    cheapest_combinations,
    course_nodes,
    crossing_legs,
    most_cost,
)
from .leg_orders import legs_of_order

NODES_OF_A_LEG = 24
"""Number of nodes of a leg while legs are combined."""

MOST_COMBINED_LEGS, FEWEST_COURSES = 300, 4
"""Number of legs up to which the best courses are combined, in all courses together; and number of
courses that are combined anyway."""

FEWEST_POINTS = 3
"""Number of control points below which there is nothing to combine."""


def recombined(
    surface: CurveSurface,
    nodes: Nodes,
    visit: IntArray,
    simple: BoolArray,
    smoothness: float,
    most: int,
) -> tuple[Nodes, IntArray] | None:
    """Combine the legs of courses into new courses in the order of the best course.

    Parameters
    ----------
    surface : CurveSurface
    nodes : Nodes
        c courses that begin at a control point; open ones also end at one.
    visit : (n,) int array
        Index of the control point at each node, -1 elsewhere.
    simple : (c,) bool array
        Which courses do not cross themselves.
    smoothness : float
        Divisor of the tension.
    most : int
        Greatest number of new courses.

    Returns
    -------
    (Nodes, (m,) int array) or None
        The new courses, with as many nodes each as the given ones, and the control point at each of
        their nodes. None if there are too few control points, or if there is no new course.
    """
    scale = float(nodes.by_curve(nodes.step_lengths).sum(axis=1).min())
    energy = comparable_energies(surface, nodes, smoothness, scale)
    size = nodes.per_curve
    place = np.nonzero(nodes.by_curve(visit) >= 0)[1].reshape(nodes.curves, -1)
    count = place.shape[1]
    if count < FEWEST_POINTS:
        return None
    kept = np.argsort(energy, kind="stable")[: max(FEWEST_COURSES, MOST_COMBINED_LEGS // count)]
    best = kept[np.argmax(simple[kept])]  # the first simple one, or else the first one
    kept = np.union1d(kept, best)
    nodes, visit, place = curves_of(nodes, kept), nodes.by_curve(visit)[kept], place[kept]
    order = np.take_along_axis(visit, place, axis=1)
    wanted = order[np.searchsorted(kept, best)]
    course, begin, end, leg, backward = _legs_in_order(place, order, wanted, nodes)
    checkpoint()
    curves = LegCurves(
        surface,
        _nodes_on_legs(surface, nodes, course, begin, end, backward),
        leg,
        legs_of_order(wanted, nodes.closed)[leg],
        int(leg[-1]) + 1,
    )
    terms = comparable_terms(surface, nodes, smoothness, scale)
    cost = _costs(nodes, terms, course, begin, end, leg)
    distinct, alike = _distinct_legs(curves, cost, SAME_COURSE * surface.mesh.diagonal)
    known = np.full((len(kept), curves.n_legs), -1)
    known[course, leg] = alike
    curves, cost = curves.only(distinct), cost[distinct]
    legs = [curves.of_leg(number) for number in range(curves.n_legs)]
    corners = np.unique(visit[nodes.by_curve(nodes.corners)]) if nodes.corners is not None else []
    turns = _turning_costs(curves.nodes, legs, np.isin(wanted, corners), nodes.closed, scale)
    found = cheapest_combinations(
        [cost[each] for each in legs], turns, crossing_legs(curves), nodes.closed
    )
    is_new = ~(found.choice[:, None] == known).all(axis=2).any(axis=1)
    choice, costs = found.choice[is_new], found.cost[is_new]
    choice = choice[costs <= most_cost(curves.n_legs, costs)][:most]
    if not len(choice):
        return None
    steps = size if nodes.closed else size - 1
    joined, at_points = course_nodes(curves, choice, nodes.closed, steps)
    point = np.full(len(at_points), -1)
    point[at_points] = np.tile(wanted, len(choice))
    return joined, point


def _legs_in_order(
    place: IntArray, order: IntArray, wanted: IntArray, nodes: Nodes
) -> tuple[IntArray, IntArray, IntArray, IntArray, BoolArray]:
    """The legs of all courses that also occur in one order of the control points, sorted by leg.

    Parameters
    ----------
    place : (c, k) int array
        Places of the control points among the nodes of their course.
    order : (c, k) int array
        Control points in the order that each course visits them.
    wanted : (k,) int array
        The order whose legs are wanted.
    nodes : Nodes

    Returns
    -------
    course, begin, end, leg : (r,) int arrays
        The course of each leg, the places of its ends, and its number in the wanted order. The last
        leg of a closed course ends at the place after its last node.
    backward : (r,) bool array
        Whether the course runs along the leg in the other direction.
    """
    count = len(wanted) if nodes.closed else len(wanted) - 1
    number = np.full((wanted.max() + 1,) * 2, -1)
    number[wanted[:count], np.roll(wanted, -1)[:count]] = np.arange(count)
    begin, end = place, np.append(place[:, 1:], np.full((len(place), 1), nodes.per_curve), axis=1)
    one, other = order, np.roll(order, -1, axis=1)
    begin, end, one, other = (each[:, :count] for each in (begin, end, one, other))
    forward, reverse = number[one, other], number[other, one]
    leg = np.where(forward >= 0, forward, reverse)
    course, which = np.nonzero(leg >= 0)
    ascending = np.argsort(leg[course, which], kind="stable")
    course, which = course[ascending], which[ascending]
    found = (course, which)
    return course, begin[found], end[found], leg[found], forward[found] < 0


def _nodes_on_legs(
    surface: CurveSurface,
    nodes: Nodes,
    course: IntArray,
    begin: IntArray,
    end: IntArray,
    backward: BoolArray,
) -> Nodes:
    """Place nodes evenly along legs of courses; each leg is an open curve."""
    size = nodes.per_curve
    steps = nodes.by_curve(nodes.step_lengths)
    arc = np.zeros((nodes.curves, size + 1))
    steps.cumsum(axis=1, out=arc[:, 1:])
    arc += (arc[:, -1].cumsum() - arc[:, -1])[:, None]
    first, last = arc[course, begin][:, None], arc[course, end][:, None]
    share = np.linspace(0.0, 1.0, NODES_OF_A_LEG)
    share = np.where(backward[:, None], 1.0 - share, share)
    wanted = first + share * (last - first)
    step = np.searchsorted(arc.ravel(), wanted, side="right") - 1 - course[:, None] * (size + 1)
    step = step.clip(begin[:, None], end[:, None] - 1)
    row = course[:, None]
    along = (wanted - arc[row, step]) / np.maximum(steps[row, step], tolerances.TINY)
    traces = traces_between_nodes(surface, nodes)
    places = places_along(
        surface, nodes, traces, (row * size + step).ravel(), along.clip(0.0, 1.0).ravel()
    )
    # Control points stay exactly where they are.
    ends = course[:, None] * size + np.stack([begin, end % size], axis=1)
    ends = np.where(backward[:, None], ends[:, ::-1], ends)
    at = np.arange(len(course))[:, None] * NODES_OF_A_LEG + [0, NODES_OF_A_LEG - 1]
    faces, barycentric = places.faces.copy(), places.barycentric.copy()
    faces[at], barycentric[at] = nodes.places.faces[ends], nodes.places.barycentric[ends]
    return nodes_at(surface, SurfacePoints(faces, barycentric), False, len(course))


def _costs(
    nodes: Nodes,
    terms: tuple[FloatArray, FloatArray, float],
    course: IntArray,
    begin: IntArray,
    end: IntArray,
    leg: IntArray,
) -> FloatArray:
    """Energies of legs, (r,), from the terms of `comparable_terms`; never negative.

    The term of lanes is a mean along the whole curve. So the mean along a leg counts by the typical
    share of this leg in the length of a course, and relative to the least one of this leg.
    """
    at_nodes, lanes, weight = terms

    def along_legs(values: FloatArray) -> FloatArray:
        """Sums of values at nodes along legs; a value at an end counts half."""
        rows = nodes.by_curve(values)
        rows = np.append(rows, rows[:, :1], axis=1)
        before = np.append(np.zeros((len(rows), 1)), rows.cumsum(axis=1), axis=1)
        whole = before[course, end + 1] - before[course, begin]
        result: FloatArray = whole - 0.5 * (rows[course, begin] + rows[course, end])
        return result

    length = np.maximum(along_legs(nodes.ds), tolerances.TINY)
    share = length / nodes.by_curve(nodes.step_lengths).sum(axis=1)[course]
    typical = np.bincount(leg, share) / np.bincount(leg)
    mean = along_legs(lanes) / length
    least = np.zeros(len(typical))
    np.minimum.at(least, leg, mean)
    return along_legs(at_nodes) + weight * typical[leg] * (mean - least[leg])


def _turning_costs(
    legs: Nodes, of_legs: list[slice], corners: BoolArray, closed: bool, scale: float
) -> list[FloatArray]:
    """Cost of joining two legs at a control point, for all pairs of curves of consecutive legs.

    It is zero at corners, given for the control points in the order visited, (k,).

    Two legs with an angle θ between them share it: each end turns by θ / 2. Turning one end of a
    clamped elastic rod of length ℓ by an angle α takes the energy 4 α² / ℓ, so together they cost
    θ² / ℓ for each leg.
    """
    count = legs.per_curve
    positions, normals = (each.reshape(-1, count, 3) for each in (legs.positions, legs.normals))
    length = legs.by_curve(legs.step_lengths).sum(axis=1)
    leaving = _tangents(positions[:, 1] - positions[:, 0], normals[:, 0])
    arriving = _tangents(positions[:, -1] - positions[:, -2], normals[:, -1])
    inverse = 1.0 / np.maximum(length, tolerances.TINY)
    following = [*of_legs[1:], *of_legs[:1]] if closed else of_legs[1:]
    costs = []
    for before, after, is_corner in zip(of_legs, following, np.roll(corners, -1), strict=False):
        angle = np.arccos((arriving[before] @ leaving[after].T).clip(-1.0, 1.0))
        if is_corner:
            angle = np.zeros_like(angle)
        costs.append(scale * angle**2 * (inverse[before, None] + inverse[after]))
    return costs


def _tangents(vectors: FloatArray, normals: FloatArray) -> FloatArray:
    """Unit vectors along the projections of vectors, (m, 3), onto planes with given normals."""
    flat = vectors - np.einsum("md,md->m", vectors, normals)[:, None] * normals
    return flat / np.maximum(np.linalg.norm(flat, axis=1), tolerances.TINY)[:, None]


def _distinct_legs(curves: LegCurves, cost: FloatArray, limit: float) -> tuple[IntArray, IntArray]:
    """The cheapest of the curves of each leg that run beside each other.

    Returns
    -------
    (d,) int array
        Their indices, sorted by leg.
    (r,) int array
        For each curve, the number of the one among them beside which it runs.
    """
    positions = np.ascontiguousarray(curves.nodes.positions).reshape(len(cost), -1, 3)
    found: list[int] = []
    alike = np.zeros(len(cost), dtype=np.int64)
    for number in range(curves.n_legs):
        own = curves.of_leg(number)
        chosen = nicmm_kernels.distinct_curves(
            positions[own], np.argsort(cost[own], kind="stable"), limit, checkpoint
        )
        apart = (positions[own, None] - positions[own][chosen]).reshape(-1, 3).T
        farthest = lengths(apart).reshape(own.stop - own.start, len(chosen), -1).max(axis=2)
        alike[own] = len(found) + farthest.argmin(axis=1)
        found.extend((own.start + chosen).tolist())
    return np.array(found), alike
