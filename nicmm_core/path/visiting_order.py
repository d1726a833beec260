"""The order in which a curve visits its control points: a short closed or open tour.

If points lie on boundaries, no simple curve may exist for the shortest tour.
`order_along_boundaries` gives a tour for which one exists.
"""

from __future__ import annotations

import itertools

import numpy as np

from ..geometry import tolerances
from ..geometry.array_types import FloatArray, IntArray
from ..progress import checkpoint

EXACT_UP_TO = 9
"""Largest number of points with an optimal tour; longer tours are improved by exchanges."""

LONGEST_MOVE = 3
"""Largest number of consecutive points moved together to another position in the tour."""


def shortest_order(distance: FloatArray, closed: bool) -> IntArray:
    """Find an order that makes the tour through all points short.

    A closed tour starts at the most remote point, the one with the largest sum of distances to all
    others, and goes to the nearer of its two neighbours first. An open tour starts at the more
    remote of its two ends. So the order does not depend on the numbering of the points.

    Parameters
    ----------
    distance : (k, k) float array
        Symmetric distances along the surface.
    closed : bool
        Whether the tour returns to its start. An open tour may start at any point.

    Returns
    -------
    (k,) int array
        Indices of the points in the order visited. The tour is optimal for up to `EXACT_UP_TO`
        points, or one fewer for an open tour. For more points it is the nearest-neighbour tour,
        improved until no reversal of a section (2-opt, Croes 1958) and no move of up to three
        points (Or 1976) shortens it.
    """
    by_remoteness = np.argsort(-distance.sum(axis=1), kind="stable")
    distance = distance[np.ix_(by_remoteness, by_remoteness)]
    if closed:
        tour = _tour(distance)
        if distance[0, tour[-1]] < distance[0, tour[1]]:
            tour = np.roll(tour[::-1], 1)
    else:
        # An open tour is a closed one through an extra point at distance zero from all.
        tour = _tour(np.pad(distance, ((1, 0), (1, 0))))[1:] - 1
        if tour[0] > tour[-1]:
            tour = tour[::-1]
    return by_remoteness[tour]


def _tour(distance: FloatArray) -> IntArray:
    """A short closed tour through all points, starting at point 0."""
    if len(distance) <= EXACT_UP_TO:
        return _shortest(distance)
    return _improved(distance, _nearest_neighbour(distance))


def order_along_boundaries(distance: FloatArray, loops: list[IntArray], closed: bool) -> IntArray:
    """Find a short order in which a simple curve can visit points even if some lie on boundaries.

    The boundary of a thin strip around a tree through all points is a simple curve. Where the tree
    reaches a boundary of the surface, the curve can follow that boundary and visit its points in
    their order along it.

    Parameters
    ----------
    distance : (k, k) float array
        Symmetric distances along the surface.
    loops : list of (b,) int array
        Points on each boundary loop, in the direction of the loop. If the surface is orientable, it
        lies on the same side of all loops.
    closed : bool
        Whether the tour returns to its start.

    Returns
    -------
    (k,) int array
        Indices of the points in the order visited.
    """
    inner = np.setdiff1d(np.arange(len(distance)), np.concatenate([*loops, np.zeros(0, np.int64)]))
    chains = [loop for loop in loops if len(loop)] + [np.array([point]) for point in inner]
    tour = chains[0]
    for chain in chains[1:]:
        tour = _insert_chain(distance, tour, chain)
    if not closed:
        legs = distance[tour, np.roll(tour, -1)]
        tour = np.roll(tour, -int(legs.argmax()) - 1)
    return tour


def _insert_chain(distance: FloatArray, tour: IntArray, chain: IntArray) -> IntArray:
    """Insert a cyclic chain of points into a closed tour, as a whole and where it costs least."""
    last = np.roll(chain, 1)  # the last point of the chain if it starts at chain[i] is last[i]
    following = np.roll(tour, -1)
    cost = distance[np.ix_(tour, chain)] + distance[np.ix_(following, last)]
    cost -= distance[tour, following][:, None]
    cost -= distance[last, chain]
    index, start = np.unravel_index(cost.argmin(), cost.shape)
    return np.concatenate([tour[: index + 1], np.roll(chain, -int(start)), tour[index + 1 :]])


def _shortest(distance: FloatArray) -> IntArray:
    """The shortest closed tour of at most `EXACT_UP_TO` points, by comparing all tours."""
    if len(distance) <= 3:
        return np.arange(len(distance))
    checkpoint()
    # Reversed, so that of several shortest tours the one that ends with the first points is taken.
    others = np.array(list(itertools.permutations(range(1, len(distance)))))[:, ::-1]
    tours = np.pad(others, ((0, 0), (1, 0)))
    lengths = np.cumsum(distance[tours, np.roll(tours, -1, axis=1)], axis=1)[:, -1]
    return tours[lengths.argmin()]


def _nearest_neighbour(distance: FloatArray) -> IntArray:
    """The tour from point 0 that always goes on to the nearest unvisited point."""
    tour, unvisited = [0], list(range(1, len(distance)))
    while unvisited:
        tour.append(unvisited.pop(int(distance[tour[-1], unvisited].argmin())))
    return np.array(tour, dtype=np.int64)


def _improved(distance: FloatArray, tour: IntArray) -> IntArray:
    """Improve a closed tour by the best exchange until none shortens it; start at point 0."""
    # Exchanges with gains below rounding errors could cycle.
    least = tolerances.ROUNDED * float(distance[tour, np.roll(tour, -1)].sum())
    while True:
        checkpoint()
        gain, i, j = _best_reversal(distance, tour)
        if gain > least:
            tour[i + 1 : j + 1] = tour[i + 1 : j + 1][::-1].copy()
            continue
        gain, moved = _best_move(distance, tour)
        if gain <= least:
            return np.roll(tour, -int(np.flatnonzero(tour == 0)[0]))
        tour = moved


def _best_reversal(distance: FloatArray, tour: IntArray) -> tuple[float, int, int]:
    """The largest gain from reversing a section of the tour from i + 1 to j, and i and j."""
    following = np.roll(tour, -1)
    leg = distance[tour, following]
    gain = leg[:, None] + leg[None] - distance[np.ix_(tour, tour)]
    gain -= distance[np.ix_(following, following)]
    gain[np.tril_indices(len(tour))] = -np.inf
    i, j = np.unravel_index(gain.argmax(), gain.shape)
    return float(gain[i, j]), int(i), int(j)


def _best_move(distance: FloatArray, tour: IntArray) -> tuple[float, IntArray]:
    """The largest gain from moving a few consecutive points to another leg, and the new tour."""
    k = len(tour)
    best, moved = 0.0, tour
    for count in range(1, min(LONGEST_MOVE, k - 3) + 1):
        # Row i is for moving the points i … i + count - 1, column j for the leg after point j.
        before, first = np.roll(tour, 1), tour
        last, after = np.roll(tour, 1 - count), np.roll(tour, -count)
        saved = distance[before, first] + distance[last, after] - distance[before, after]
        start, end = tour, np.roll(tour, -1)
        straight = distance[np.ix_(first, start)] + distance[np.ix_(last, end)]
        turned = distance[np.ix_(last, start)] + distance[np.ix_(first, end)]
        gain = saved[:, None] + distance[start, end] - np.minimum(straight, turned)
        offset = (np.arange(k)[None] - np.arange(k)[:, None]) % k
        gain[(offset < count) | (offset == k - 1)] = -np.inf
        i, j = np.unravel_index(gain.argmax(), gain.shape)
        if gain[i, j] > best:
            best = float(gain[i, j])
            onward = np.roll(tour, -int(i))
            section, others = onward[:count], onward[count:]
            if turned[i, j] < straight[i, j]:
                section = section[::-1]
            index = int(offset[i, j]) - count + 1
            moved = np.concatenate([others[:index], section, others[index:]])
    return best, moved
