"""Removes self-crossings of a curve by joining its nodes in another order.

Where two strands cross twice, without a control point between the crossings, they exchange the
parts between them. A loop with at most one control point is traversed in the other direction. Both
moves keep all nodes and the order of the control points. If the control points may be visited in
any order, every other loop is reversed as well ("2-opt": Croes, "A method for solving
traveling-salesman problems", 1958).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..geometry.array_types import BoolArray, IntArray
from ..relaxation.curve_nodes import CurveSurface, Nodes, nodes_at
from ..relaxation.node_traces import crossing_steps

ROUNDS = 4
"""Rounds in which crossings are removed; steps between nodes in a new order may cross again."""

MOST_CROSSINGS = 200
"""Number of crossings of a curve above which the curve is left unchanged."""


def remove_crossings(
    surface: CurveSurface, nodes: Nodes, visit: IntArray, any_order: bool
) -> tuple[Nodes, IntArray, BoolArray]:
    """Remove crossings of curves by joining their nodes in another order.

    Parameters
    ----------
    surface : CurveSurface
    nodes : Nodes
        Curves that begin at a control point.
    visit : (n,) int array
        Index of the control point at each node, -1 where there is none.
    any_order : bool
        Whether control points may be visited in another order.

    Returns
    -------
    Nodes
        The nodes in their new order.
    (n,) int array
        Index of the control point at each of these nodes, -1 where there is none.
    (c,) bool array
        Which curves do not cross themselves. Steps whose trace fails are not tested.
    """
    size = nodes.per_curve
    order = np.arange(len(nodes.positions)).reshape(nodes.curves, size)
    crossing = np.zeros(nodes.curves, dtype=bool)
    which, now = np.arange(nodes.curves), nodes
    for rounds in range(1 + ROUNDS):
        pairs = crossing_steps(surface, now)
        places = np.unique(pairs[:, 0] // size)
        crossing[which] = False
        crossing[which[places]] = True
        changed = []
        for place in places.tolist() if rounds < ROUNDS else []:
            number = which[place]
            crossings = pairs[pairs[:, 0] // size == place] - place * size
            if len(crossings) > MOST_CROSSINGS:
                continue
            control = visit[order[number]] >= 0
            sequence = reordered(crossings, control, nodes.closed, any_order)
            if not np.array_equal(sequence, np.arange(size)):
                order[number] = order[number][sequence]
                changed.append(number)
        if not changed:
            break
        which = np.array(changed)
        now = _in_order(surface, nodes, order[which])
    if now is nodes:
        return nodes, visit, ~crossing
    return _in_order(surface, nodes, order), visit[order.ravel()], ~crossing


def reordered(crossings: IntArray, control: BoolArray, closed: bool, any_order: bool) -> IntArray:
    """The order of the nodes of one curve after its crossings have been removed, (n,).

    Parameters
    ----------
    crossings : (p, 2) int array
        Pairs of nodes whose steps to the next nodes cross.
    control : (n,) bool array
        Which nodes are control points; the first node always is.
    closed : bool
    any_order : bool
    """
    n = len(control)
    sequence, place = np.arange(n), np.arange(n)
    left = crossings
    while len(left):
        # The place of the step between two nodes that were neighbours in the given sequence; those
        # of the step from the last node to the first are not neighbours now.
        first, second = place[left], place[(left + 1) % n]
        low, high = np.minimum(first, second), np.maximum(first, second)
        steps = np.where(high - low > 1, high, low)
        steps.sort(axis=1)
        before = np.append(0, np.cumsum(control[sequence]))
        move = _exchange(steps, before) or _reversal(steps, before, closed, any_order)
        if move is None:
            break
        parts = [
            sequence[first:end] if first <= end else sequence[end:first][::-1]
            for first, end in move.parts
        ]
        sequence = np.concatenate(parts)
        place[sequence] = np.arange(n)
        gone = np.zeros(n, dtype=bool)
        gone[left[move.removed]] = True
        left = left[~gone[left].any(axis=1)]
    return sequence


@dataclass(frozen=True)
class _Move:
    """A new order of a sequence, and the crossings that it removes.

    The order is given by parts of the sequence, (first, end), reversed where first > end.
    """

    parts: list[tuple[int, int]]
    removed: list[int]


def _exchange(steps: IntArray, before: IntArray) -> _Move | None:
    """Exchange the shortest pair of strands between two of their crossings.

    Parameters
    ----------
    steps : (p, 2) int array
        Places of the two steps of each crossing, ascending.
    before : (n + 1,) int array
        Number of control points before each place.
    """
    begin, first_end = steps[:, :1], steps[:, 1:]  # (p, 1), of the first crossing
    end, second_end = steps.T  # (p,), of the second crossing
    low, high = np.minimum(first_end, second_end), np.maximum(first_end, second_end)  # (p, p)
    free = (before[end + 1] == before[begin + 1]) & (before[high + 1] == before[low + 1])
    possible = free & (begin < end) & (end < low) & (low < high)
    if not possible.any():
        return None
    size = np.where(possible, end - begin + high - low, np.iinfo(np.int64).max)
    one, other = divmod(int(size.argmin()), len(steps))
    start, stop = int(begin[one, 0]), int(end[other])
    least, most = int(low[one, other]), int(high[one, other])
    nearer, farther = (start + 1, stop + 1), (least + 1, most + 1)
    if second_end[other] < first_end[one, 0]:  # the strands run in opposite directions
        nearer, farther = nearer[::-1], farther[::-1]
    rest = (most + 1, len(before) - 1)
    parts = [(0, start + 1), farther, (stop + 1, least + 1), nearer, rest]
    return _Move(parts, [one, other])


def _reversal(steps: IntArray, before: IntArray, closed: bool, any_order: bool) -> _Move | None:
    """Reverse the shortest loop, preferably one with at most one control point."""
    n = len(before) - 1
    begins, ends = steps.T
    inside = before[ends + 1] - before[begins + 1]
    sizes, points = [ends - begins], [inside]
    if closed:  # the rest of the curve is a loop, too
        sizes.append(n - sizes[0])
        points.append(before[-1] - inside)
    changes_order = np.stack(points, axis=1) > 1
    rank = np.stack(sizes, axis=1) + n * changes_order
    number, around = divmod(int(rank.argmin()), len(sizes))
    if changes_order[number, around] and not any_order:
        return None
    begin, end = steps[number].tolist()
    if around:
        parts = [(0, 1), (n, end + 1), (begin + 1, end + 1), (begin + 1, 1)]
    else:
        parts = [(0, begin + 1), (end + 1, begin + 1), (end + 1, n)]
    return _Move(parts, [number])


def _in_order(surface: CurveSurface, nodes: Nodes, order: IntArray) -> Nodes:
    """The curves through their nodes in a given order, (c, n)."""
    among = order.ravel()
    corners = None if nodes.corners is None else nodes.corners[among]
    return nodes_at(surface, nodes.places[among], nodes.closed, len(order), corners)
