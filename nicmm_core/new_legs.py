"""Searches for courses of the legs of a start that control points have joined or left.

A new point may be far from the curve. If the curve is only moved to it (`start`), it may keep a
detour or sharp bends that no relaxation removes. So the part of the curve between the two nearest
control points that stay is also searched for anew. All other legs keep their courses.
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass, replace

import igl
import numpy as np

from .courses.bent_part import DIRECTION
from .errors import CurveError
from .geometry.array_types import FloatArray, IntArray
from .geometry.surface_points import SurfacePoints, joined
from .relaxation.curve_nodes import CurveSurface
from .relaxation.discrete_curve import DiscreteCurve
from .relaxation.simple_curve import simple_curve
from .relaxation.warm_start import LONGEST_MOVE
from .request import Request
from .start import OTHER_ORDER, too_far, unchanged_points, with_other_points

ON_CURVE = 1e-3
"""Distance from a curve, relative to its length, up to which a new point lies on it."""


@dataclass(frozen=True)
class Leg:
    """A leg of a curve between two control points that stay, or between one and an open end.

    Attributes
    ----------
    points : (m,) int array
        Indices of all its control points in the request, in the order visited.
    nodes : (n,) int array
        Nodes of the start along the leg, with both ends; at an open end with new points, only the
        node of the point that stays.
    is_new : bool
        Whether it is not a leg of the start.
    """

    points: IntArray
    nodes: IntArray
    is_new: bool


def legs_of(surface: CurveSurface, curve: DiscreteCurve, request: Request) -> list[Leg]:
    """Find which legs of a start stay and which are new, if control points have come or gone.

    Parameters
    ----------
    surface : CurveSurface
    curve : DiscreteCurve
        The curve of the start.
    request : Request
        A request with another number of control points.

    Returns
    -------
    list of Leg
        All legs in the order visited; those of a closed curve begin at a control point that stays.

    Raises
    ------
    CurveError
        If no control point is where it was, if the start visits the points in another order, or if
        a new point is farther from its leg than `LONGEST_MOVE`.
    """
    unchanged = unchanged_points(surface, curve, request)
    visited = np.arange(len(unchanged))
    if request.order == "shortest":
        visited = with_other_points(surface, curve, request)[1]
    if curve.closed:
        visited = np.roll(visited, -int((unchanged[visited] >= 0).argmax()))
        visited = np.append(visited, visited[0])
    at, count = np.flatnonzero(unchanged[visited] >= 0), len(curve.control_nodes)
    places = unchanged[visited[at]]
    steps = np.diff(places)
    if curve.closed:
        steps = (steps - 1) % count + 1  # a whole turn if only one point stays
    if (steps < 1).any() or (curve.closed and steps.sum() > count):
        raise CurveError(OTHER_ORDER)
    legs = [
        Leg(
            visited[low : high + 1],
            _nodes_between(curve, int(place), int(step)),
            bool(step > 1 or high > low + 1),
        )
        for low, high, place, step in zip(at[:-1], at[1:], places[:-1], steps, strict=True)
    ]
    if at[0] > 0:
        legs.insert(0, Leg(visited[: at[0] + 1], curve.control_nodes[places[:1]], True))
    if at[-1] < len(visited) - 1:
        legs.append(Leg(visited[at[-1] :], curve.control_nodes[places[-1:]], True))
    for leg in legs:
        away = _distances(surface, curve, leg, request)
        if away.max() > LONGEST_MOVE:
            raise too_far(int(leg.points[away.argmax()]), float(away.max()))
    return legs


def may_need_search(
    surface: CurveSurface, curve: DiscreteCurve, legs: Sequence[Leg], request: Request
) -> bool:
    """Whether a new leg may need another course than the start.

    It does not if only points on the curve have come, or if points have gone from an open end. If
    only one point of a closed curve stays, there is no part to search for.
    """
    if len(legs) == 1 and curve.closed:
        return False
    return any(
        np.isin(leg.nodes[1:-1], curve.control_nodes).any()
        or _distances(surface, curve, leg, request).max() > ON_CURVE
        for leg in legs
        if leg.is_new
    )


def widened(legs: Sequence[Leg], closed: bool) -> list[Leg]:
    """Legs in which each new one has been joined with its two neighbours.

    An empty list if no leg would stay.
    """
    new = np.array([leg.is_new for leg in legs])
    before, after = np.roll(new, 1), np.roll(new, -1)
    if not closed:
        before[0] = after[-1] = False
    beside = new | before | after
    if beside.all():
        return []
    begin = int((~beside).argmax()) if closed else 0
    runs = itertools.groupby(
        zip(np.roll(beside, -begin), [*legs[begin:], *legs[:begin]], strict=True),
        key=lambda pair: bool(pair[0]),
    )
    result: list[Leg] = []
    for is_new, pairs in runs:
        run = [leg for _, leg in pairs]
        result += [_merged(run)] if is_new else run
    return result


def _merged(legs: list[Leg]) -> Leg:
    """Consecutive legs as one new leg."""
    points = np.concatenate([legs[0].points, *(leg.points[1:] for leg in legs[1:])])
    nodes = np.concatenate([legs[0].nodes, *(leg.nodes[1:] for leg in legs[1:])])
    return Leg(points, nodes, True)


def _nodes_between(curve: DiscreteCurve, place: int, step: int) -> IntArray:
    """The nodes from a control point, given by its place in the order, to one some places later."""
    ends, count = curve.control_nodes, len(curve.nodes.positions)
    turns, last = divmod(place + step, len(ends))
    return np.arange(ends[place], ends[last] + turns * count + 1) % count


def _distances(
    surface: CurveSurface, curve: DiscreteCurve, leg: Leg, request: Request
) -> FloatArray:
    """Distances of the control points of a leg from the start there, relative to its length."""
    line = curve.nodes.positions[leg.nodes]
    numbers = np.arange(len(line))
    segments = np.stack([numbers, np.append(numbers[1:], numbers[-1])], axis=1)
    positions = request.points[leg.points].positions(surface.mesh)
    squared = igl.point_mesh_squared_distance(positions, line, segments)[0]
    distances: FloatArray = np.sqrt(np.ravel(squared)) / curve.length
    return distances


def request_for_leg(
    surface: CurveSurface, curve: DiscreteCurve, legs: Sequence[Leg], number: int, request: Request
) -> tuple[Request, slice]:
    """The request for courses of a new leg alone, with the tension of the whole curve.

    A course also passes a node on each neighbouring leg that stays, which fixes its direction at
    its ends. The slice tells which control points of the request are on the leg itself.
    """
    leg, places = legs[number], curve.nodes.places
    before = _node_beside(curve, legs, number, -1)
    after = _node_beside(curve, legs, number, 1)
    points = joined([places[before], request.points[leg.points], places[after]])
    chords = np.diff(points.positions(surface.mesh), axis=0)
    length = float(np.linalg.norm(chords, axis=1).sum())
    of_leg = replace(
        request,
        points=points,
        closed=False,
        order="given",
        corners=len(before) + np.flatnonzero(request.are_corners(leg.points)),
        via_points={},
        smoothness=request.smoothness * (curve.length / length) ** 2,
    )
    return of_leg, slice(len(before), len(before) + len(leg.points))


def _node_beside(curve: DiscreteCurve, legs: Sequence[Leg], number: int, side: int) -> IntArray:
    """A node near a leg on the one before (-1) or after it (1), if that leg stays, (0 or 1,)."""
    beside = number + side
    if not curve.closed and not 0 <= beside < len(legs):
        return np.zeros(0, dtype=np.int64)
    nodes = legs[beside % len(legs)].nodes[::side]
    if legs[beside % len(legs)].is_new or len(nodes) < 3:
        return np.zeros(0, dtype=np.int64)
    steps = np.linalg.norm(np.diff(curve.nodes.positions[nodes], axis=0), axis=1)
    index = int(np.searchsorted(np.cumsum(steps), DIRECTION * curve.length)) + 1
    return nodes[[min(index, len(nodes) // 2)]]


def with_new_legs(
    surface: CurveSurface,
    curve: DiscreteCurve,
    legs: Sequence[Leg],
    courses: dict[int, tuple[SurfacePoints, IntArray]],
    request: Request,
) -> tuple[DiscreteCurve, IntArray] | None:
    """Replace the new legs of a start by courses.

    Parameters
    ----------
    surface : CurveSurface
    curve : DiscreteCurve
        The curve of the start.
    legs : sequence of Leg
    courses : dict from int to (SurfacePoints, (m,) int array)
        For the index of each new leg, the nodes of its course and which of them are at its m
        control points, the first and the last one included.
    request : Request

    Returns
    -------
    DiscreteCurve
        A simple curve.
    (k,) int array
        For each control node, the index of its control point in the request.

    None if the curve would cross itself.
    """
    pieces, control_nodes, count = [], [], 0
    for number, leg in enumerate(legs):
        whole = curve.nodes.places[leg.nodes], np.array([0, len(leg.nodes) - 1])
        places, at_points = courses.get(number, whole)
        with_last = not curve.closed and number == len(legs) - 1
        pieces.append(places[: len(places) - (not with_last)])
        control_nodes.append(count + (at_points if with_last else at_points[:-1]))
        count += len(pieces[-1])
    visited = np.concatenate([leg.points[:-1] for leg in legs])
    if not curve.closed:
        visited = np.append(visited, legs[-1].points[-1])
    places, at_points = joined(pieces), np.concatenate(control_nodes)
    first = int((visited == 0).argmax()) if curve.closed else 0  # where a given order begins
    order = np.roll(np.arange(count), -at_points[first])
    at_points = (np.roll(at_points, -first) - at_points[first]) % count
    visited = np.roll(visited, -first)
    points, corners = request.points[visited], request.are_corners(visited)
    found = simple_curve(surface, places[order], at_points, points, curve.closed, corners=corners)
    return None if found is None else (found, visited)
