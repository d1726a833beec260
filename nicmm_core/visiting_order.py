"""The order in which a loop visits its control points: the shortest cyclic or open tour."""

from __future__ import annotations

import numpy as np

from .array_types import FloatArray, IntArray

EXACT_UP_TO = 9
"""Tours of more points are improved by exchanges instead of being optimal (2^k states)."""


def shortest_order(distance: FloatArray, closed: bool) -> IntArray:
    """Order that makes the tour through all points short, starting at point 0.

    Parameters
    ----------
    distance : (k, k) float array
        Symmetric distances along the surface.
    closed : bool
        Whether the tour returns to its start. An open tour may start anywhere.

    Returns
    -------
    (k,) int array
        Optimal for up to `EXACT_UP_TO` points (Held and Karp 1962); beyond, the nearest
        neighbour's tour improved until no reversal of a stretch shortens it (2-opt, Croes 1958).
    """
    if not closed:
        # An open tour is a closed one through an extra point at distance zero from all.
        padded = np.pad(distance, ((1, 0), (1, 0)))
        return shortest_order(padded, closed=True)[1:] - 1
    if len(distance) <= EXACT_UP_TO:
        return _held_karp(distance)
    return _two_opt(distance, _nearest_neighbour(distance))


def _held_karp(distance: FloatArray) -> IntArray:
    k = len(distance)
    if k <= 3:
        return np.arange(k)
    # best[subset, last]: shortest path from 0 through the subset of 1 … k-1 that ends at last.
    n_subsets = 1 << (k - 1)
    best = np.full((n_subsets, k - 1), np.inf)
    previous = np.zeros((n_subsets, k - 1), dtype=np.int64)
    between = distance[1:, 1:]
    for last in range(k - 1):
        best[1 << last, last] = distance[0, last + 1]
    for subset in range(1, n_subsets):
        for last in range(k - 1):
            rest = subset ^ (1 << last)
            if subset >> last & 1 and rest:
                through = best[rest] + between[:, last]
                previous[subset, last] = through.argmin()
                best[subset, last] = through.min()
    subset = n_subsets - 1
    last = int((best[subset] + distance[1:, 0]).argmin())
    tour = []
    while subset:
        tour.append(last + 1)
        subset, last = subset ^ (1 << last), int(previous[subset, last])
    return np.array([0, *reversed(tour)], dtype=np.int64)


def _nearest_neighbour(distance: FloatArray) -> IntArray:
    unvisited = np.ones(len(distance), dtype=bool)
    tour = [0]
    unvisited[0] = False
    while unvisited.any():
        nearest = int(np.where(unvisited, distance[tour[-1]], np.inf).argmin())
        tour.append(nearest)
        unvisited[nearest] = False
    return np.array(tour, dtype=np.int64)


def _two_opt(distance: FloatArray, tour: IntArray) -> IntArray:
    k = len(tour)
    while True:
        following = np.roll(tour, -1)
        leg = distance[tour, following]
        # gain[i, j]: what replacing legs i and j by their two cross connections saves.
        gain = leg[:, None] + leg[None] - distance[np.ix_(tour, tour)]
        gain -= distance[np.ix_(following, following)]
        gain[np.tril_indices(k)] = -np.inf
        i, j = np.unravel_index(gain.argmax(), gain.shape)
        # Below rounding an exchange could undo itself for ever.
        if gain[i, j] <= 1e-12 * leg.sum():
            return np.roll(tour, -int(np.flatnonzero(tour == 0)[0]))
        tour[i + 1 : j + 1] = tour[i + 1 : j + 1][::-1].copy()
