"""Remove crossings of a curve with itself by joining its nodes in another order.

Two strands that cross twice, without a control point between the crossings, exchange their parts
there. A loop with at most one control point is passed in the other direction. Both keep the order
of the control points and the places of all nodes. Where any order is allowed, other loops are
passed in the other direction too ("2-opt"; Croes, 1958).
"""

from __future__ import annotations

import numpy as np

from ..geometry.array_types import IntArray
from ..geometry.surface_points import SurfacePoints
from ..relaxation.curve_nodes import CurveSurface, Nodes, nodes_at
from ..relaxation.node_traces import crossing_steps
from ..relaxation.relaxing_together import curves_of

ROUNDS = 4
"""New steps may cross others; so often crossings are sought and removed."""


def uncrossed(
    surface: CurveSurface, nodes: Nodes, visit: IntArray, any_order: bool
) -> tuple[Nodes, IntArray]:
    """Curves with fewer crossings; without crossings wherever possible.

    Parameters
    ----------
    surface : CurveSurface
    nodes : Nodes
        c curves, each beginning at a control point.
    visit : (n,) int array
        Number of the control point at each node, -1 at the others.
    any_order : bool
        Whether control points may be visited in another order.

    Returns
    -------
    Nodes
    (n,) int array
        The control points of these.
    """
    size = len(nodes.positions) // nodes.curves
    order = np.arange(len(nodes.positions)).reshape(nodes.curves, size)
    which = np.arange(nodes.curves)
    now = nodes
    for _ in range(ROUNDS):
        pairs = crossing_steps(surface, now)
        curve = pairs[:, 0] // size
        changed = []
        for number in np.unique(curve).tolist():
            own = order[which[number]]
            sequence = _reordered(
                pairs[curve == number] - number * size, visit[own] >= 0, nodes.closed, any_order
            )
            if sequence is not None:
                order[which[number]] = own[sequence]
                changed.append(which[number])
        if not changed:
            break
        which = np.array(changed)
        now = _reordered_nodes(surface, nodes, order[which])
    order = order.ravel()
    return _reordered_nodes(surface, nodes, order.reshape(nodes.curves, size)), visit[order]


def _reordered_nodes(surface: CurveSurface, nodes: Nodes, order: IntArray) -> Nodes:
    places = nodes.places[order.ravel()]
    return nodes_at(surface, places, nodes.closed, len(order))


def _reordered(
    pairs: IntArray, control: np.ndarray, closed: bool, any_order: bool
) -> IntArray | None:
    """The order of the nodes of one curve, (n,), after crossings, (p, 2), are removed."""
    sequence = np.arange(len(control))
    left = [tuple(pair) for pair in pairs.tolist()]
    while left:
        place = np.empty(len(control), dtype=np.int64)
        place[sequence] = np.arange(len(control))
        count = np.append(0, np.cumsum(control[sequence]))  # control points before each place
        # Steps by their places now; a step may run in the other direction.
        now = []
        for one, other in left:
            ends = [sorted((int(place[i]), int(place[(i + 1) % len(control)]))) for i in (one, other)]
            steps = [hi if (lo == 0 and hi == len(control) - 1) else lo for lo, hi in ends]
            now.append((min(steps), max(steps), (one, other)))
        move = _bigon(now, count) or _loop(now, count, closed, any_order)
        if move is None:
            break
        parts, used = move
        sequence = np.concatenate(
            [sequence[a:b] if a <= b else sequence[b:a][::-1] for a, b in parts]
        )
        gone = {step for pair in used for step in pair}
        left = [pair for pair in left if pair[0] not in gone and pair[1] not in gone]
    return None if np.array_equal(sequence, np.arange(len(control))) else sequence


Crossing = tuple[int, int, tuple[int, int]]
Move = tuple[list[tuple[int, int]], list[tuple[int, int]]]
"""Parts of the sequence, backward where they descend, and the crossings that they remove."""


def _bigon(crossings: list[Crossing], count: IntArray) -> Move | None:
    """Exchange two strands between two crossings, the shortest first."""
    n = len(count) - 1
    best: tuple[int, Move] | None = None
    for i1, j1, one in crossings:
        for i2, j2, other in crossings:
            if not (i1 < i2 < min(j1, j2)) or j1 == j2 or set(one) & set(other):
                continue
            low, high = min(j1, j2), max(j1, j2)
            # No control point between the crossings.
            if count[i2 + 1] != count[i1 + 1] or count[high + 1] != count[low + 1]:
                continue
            first, middle, last = (i1 + 1, i2 + 1), (i2 + 1, low + 1), (low + 1, high + 1)
            if j2 > j1:
                parts = [(0, i1 + 1), last, middle, first, (high + 1, n)]
            else:
                parts = [(0, i1 + 1), last[::-1], middle, first[::-1], (high + 1, n)]
            size = i2 - i1 + high - low
            if best is None or size < best[0]:
                best = size, (parts, [one, other])
    return None if best is None else best[1]


def _loop(
    crossings: list[Crossing], count: IntArray, closed: bool, any_order: bool
) -> Move | None:
    """Pass a loop in the other direction, the shortest first."""
    n = len(count) - 1
    best: tuple[tuple[bool, int], Move] | None = None
    for i, j, pair in crossings:
        inside = count[j + 1] - count[i + 1]
        if closed:
            inside = min(inside, count[-1] - inside)
        if inside > 1 and not any_order:
            continue
        size = min(j - i, n - j + i) if closed else j - i
        key = bool(inside > 1), size
        if best is None or key < best[0]:
            best = key, ([(0, i + 1), (j + 1, i + 1), (j + 1, n)], [pair])
    return None if best is None else best[1]
