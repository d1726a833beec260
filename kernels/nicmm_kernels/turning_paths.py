# SPDX-License-Identifier: GPL-3.0-or-later
"""Shortest paths in a graph of hops in which turning has a cost."""

from __future__ import annotations

import ctypes
from collections.abc import Callable

import numpy as np

from .library import (
    COUNT,
    FLOAT,
    INT,
    POINTER,
    FloatArray,
    IntArray,
    Kernel,
    KernelError,
    address,
    in_several_calls,
    rows,
)
from .threads import in_threads


class _Pairs(ctypes.Structure):
    _fields_ = [
        ("n", COUNT),
        ("count", COUNT),
        ("begins", POINTER),
        ("states", POINTER),
        ("bendings", POINTER),
    ]


class _HopGraph(ctypes.Structure):
    _fields_ = [
        ("k", COUNT),
        ("begins", POINTER),
        ("weights", POINTER),
        ("onward", _Pairs),
        ("leaving", _Pairs),
        ("arriving", _Pairs),
    ]


StatePairs = tuple[IntArray, IntArray, FloatArray]
"""Pairs of each of n states with other states: the index of the first pair of each state and the
number p of pairs, (n + 1,), the other states, (p,), and the bending of both, (p,)."""

_TURNING_ITEMS = Kernel("turning_items", COUNT, COUNT)
_TURNING_PATHS = Kernel(
    "turning_paths", _HopGraph, *[POINTER] * 4, COUNT, COUNT, ctypes.POINTER(COUNT)
)


def _count(name: str, begins: IntArray) -> int:
    """Number of items from the indices at which they begin, and the end."""
    count = rows(name, begins) - 1
    if count < 0:
        raise KernelError(f"{name} has shape (0,); pass one entry more than items")
    return count


def _pairs(name: str, n: int, pairs: StatePairs) -> _Pairs:
    begins, states, bendings = pairs
    count = rows(f"states of {name}", states)
    return _Pairs(
        n, count, address(f"begins of {name}", begins, INT, n + 1),
        address(f"states of {name}", states, INT, count),
        address(f"bendings of {name}", bendings, FLOAT, count),
    )  # fmt: skip


def turning_paths(
    begins: IntArray,
    weights: FloatArray,
    onward: StatePairs,
    leaving: StatePairs,
    arriving: StatePairs,
    meanwhile: Callable[[], object],
) -> tuple[FloatArray, IntArray, IntArray]:
    """Best paths from k control points to all states, in several threads.

    States are m hops between cells, then d departures from control points, then d arrivals. Going
    on from a state to another one costs the bending of both and the weight of the other one. Of
    several states that lead to the same one at the same cost, that of the least cost of its own
    precedes it, and among these that of the lowest index.

    Parameters
    ----------
    begins : (k + 1,) int array
        Index of the first departure of each control point, and d.
    weights : (m + 2 d,) float array
        Costs of the states without bending; not negative.
    onward, leaving : StatePairs
        The m hops, and the d departures, with the hops that may follow them.
    arriving : StatePairs
        The d arrivals with the hops and departures that may precede them.
    meanwhile : callable
        Called between two calls of the kernel, at least after every `MOST_WORK` pairs.

    Returns
    -------
    (k, m + 2 d) float array
        Costs of the paths; infinite if there is none.
    (k, m + 2 d) int array
        The state before each state on its path, -1 if it is the first.
    (k, m + 2 d) int array
        The first state of each path; the state itself if there is no path.
    """
    k, m, d = (_count("begins", given) for given in (begins, onward[0], leaving[0]))
    size = m + 2 * d
    address("begins", begins, INT, k + 1)
    of_weights = address("weights", weights, FLOAT, size)
    pairs = (
        _pairs("onward", m, onward), _pairs("leaving", d, leaving), _pairs("arriving", d, arriving)
    )  # fmt: skip
    costs = np.empty((k, size))
    previous, first = np.empty((k, size), dtype=np.int64), np.empty((k, size), dtype=np.int64)

    def search(part: slice, meanwhile: Callable[[], object]) -> None:
        count = part.stop - part.start
        graph = _HopGraph(count, begins[part.start :].ctypes.data, of_weights, *pairs)
        arrays = [each[part].ctypes.data for each in (costs, previous, first)]
        scratch = np.empty(_TURNING_ITEMS.result(m, d))
        in_several_calls(_TURNING_PATHS, count, (graph, *arrays), scratch, meanwhile)

    in_threads(search, k, meanwhile)
    return costs, previous, first
