# SPDX-License-Identifier: GPL-3.0-or-later
"""Legs between two control points, from the best paths of both to the states of a hop graph."""

from __future__ import annotations

import ctypes
from typing import NamedTuple

import numpy as np

from .library import (
    COUNT,
    FLOAT,
    INT,
    NUMBER,
    POINTER,
    BoolArray,
    FloatArray,
    IntArray,
    Kernel,
    KernelError,
    address,
    rows,
)

BITS = 64
"""Number of cells of which one item of a set tells whether they are in it."""


class _States(ctypes.Structure):
    _fields_ = [
        ("n", COUNT),
        ("states", COUNT),
        ("starts", POINTER),
        ("ends", POINTER),
        ("reverse", POINTER),
    ]


class _LegPaths(ctypes.Structure):
    _fields_ = [("costs", POINTER * 2), ("previous", POINTER * 2), ("first", POINTER * 2)]


class _Routes(ctypes.Structure):
    _fields_ = [
        ("room", COUNT),
        ("count", COUNT),
        ("legs", POINTER),
        ("first", POINTER),
        ("last", POINTER),
        ("lengths", POINTER),
        ("cells", POINTER),
        ("alike", POINTER),
        ("passed", POINTER),
        ("near", POINTER),
    ]


_DIRECTION_ITEMS = Kernel("direction_items", COUNT)
_BEST_LEGS = Kernel(
    "best_legs", _States, _LegPaths, POINTER, NUMBER, POINTER, COUNT, POINTER, POINTER,
    ctypes.POINTER(COUNT), POINTER,
)  # fmt: skip
_DISTINCT_ROUTES = Kernel(
    "distinct_routes", _States, _LegPaths, POINTER, COUNT, POINTER, *[COUNT] * 3, _Routes
)


class PathArrays(NamedTuple):
    """The states of a hop graph with n cells, and the best paths to them from k control points.

    Attributes
    ----------
    cells : int
        Number n of cells.
    starts, ends : (s,) int array
        Cells at both ends of each state.
    reverse : (s,) int array
        Index of the reverse of each state.
    costs : (k, s) float array
    previous, first : (k, s) int array
        The results of `turning_paths`.
    """

    cells: int
    starts: IntArray
    ends: IntArray
    reverse: IntArray
    costs: FloatArray
    previous: IntArray
    first: IntArray


def _of_leg(graph: PathArrays, leg: tuple[int, int]) -> tuple[_States, _LegPaths]:
    """The states, and the paths from both ends of a leg."""
    s, k = rows("starts", graph.starts), rows("costs", graph.costs)
    states = _States(
        graph.cells, s, address("starts", graph.starts, INT, s),
        address("ends", graph.ends, INT, s), address("reverse", graph.reverse, INT, s),
    )  # fmt: skip
    if graph.cells < 0:
        raise KernelError(f"cells is {graph.cells}; pass a number of cells")
    if not all(0 <= end < k for end in leg):
        raise KernelError(f"leg is {leg}; pass two of {k} control points")

    def rows_of_ends(address_of_first: int) -> ctypes.Array[ctypes.c_void_p]:
        return (POINTER * 2)(*(address_of_first + 8 * s * end for end in leg))

    paths = _LegPaths(
        rows_of_ends(address("costs", graph.costs, FLOAT, k, s)),
        rows_of_ends(address("previous", graph.previous, INT, k, s)),
        rows_of_ends(address("first", graph.first, INT, k, s)),
    )
    return states, paths


def best_legs(
    graph: PathArrays, leg: tuple[int, int], weights: FloatArray, rounding: float
) -> tuple[FloatArray, IntArray, IntArray]:
    """The cheapest legs between two control points by direction, and by cell.

    Parameters
    ----------
    graph : PathArrays
    leg : tuple of int
        The two control points.
    weights : (s,) float array
        Costs of the states without bending.
    rounding : float
        Differences of costs up to this, relative to the least cost, are rounding errors.

    Returns
    -------
    (s,) float array
        Cost of the best leg through each state, without rounding errors.
    by_direction : (p,) int array
        The cheapest state of each pair of a first and a last state, in no particular order.
    by_cell : (q,) int array
        The cheapest state that ends at each cell, for the cells that are reached.

    Of several states of the same cost, that of the lowest index is cheapest.
    """
    states, paths = _of_leg(graph, leg)
    s = states.states
    totals, by_direction = np.empty(s), np.empty(s, dtype=np.int64)
    by_cell, count = np.empty(graph.cells, dtype=np.int64), COUNT(0)
    scratch = np.empty(_DIRECTION_ITEMS.result(s))
    _BEST_LEGS(
        states, paths, address("weights", weights, FLOAT, s), rounding, scratch.ctypes.data,
        len(scratch), totals.ctypes.data, by_direction.ctypes.data, count, by_cell.ctypes.data,
    )  # fmt: skip
    return totals, by_direction[: count.value].copy(), by_cell[by_cell >= 0]


def cell_sets(members: BoolArray) -> IntArray:
    """Sets of n cells as bits, (m, n / 64 rounded up), from their members, (m, n)."""
    m, n = members.shape
    padded = np.zeros((m, -(-n // BITS) * BITS), dtype=np.bool_)
    padded[:, :n] = members
    return np.packbits(padded, axis=1, bitorder="little").view(np.int64)


def distinct_routes(
    graph: PathArrays,
    leg: tuple[int, int],
    beside: IntArray,
    via: IntArray,
    first_count: int,
    aligned: int,
    different: int,
) -> tuple[IntArray, IntArray, IntArray, list[IntArray], BoolArray]:
    """Choose legs between two control points that differ from each other, in turn.

    A leg that passes a cell twice is not chosen, nor one that runs beside an earlier one: every
    cell of each lies beside a cell of the other. But among the first legs, two also differ if their
    second cells differ, or their last but one.

    Parameters
    ----------
    graph : PathArrays
    leg : tuple of int
        The two control points.
    beside : (n, w) int array
        The cells beside each cell, including itself, by `cell_sets`.
    via : (p,) int array
        States; the best legs through them are compared.
    first_count : int
        Number of these states that are the first ones.
    aligned, different : int
        Greatest numbers of legs that are chosen among the first ones, and among the others.

    Returns
    -------
    (r,) int array
        Indices of the chosen legs.
    first, last : (r,) int array
        Their first and last states.
    list of (c,) int arrays
        Their cells, including both control points.
    (r, r) bool array
        Pairs of them that run beside each other.
    """
    states, paths = _of_leg(graph, leg)
    n, words, p = graph.cells, -(-graph.cells // BITS), rows("via", via)
    of_beside = address("beside", beside, INT, n, words)
    room = max(0, aligned) + max(0, different) + 1
    legs, first, last, lengths = np.empty((4, room), dtype=np.int64)
    cells, sets = np.empty((room, n), dtype=np.int64), np.empty((2, room, words), dtype=np.int64)
    alike = np.zeros((room, room), dtype=np.bool_)
    found = _Routes(
        room, 0, *(array.ctypes.data for array in (legs, first, last, lengths, cells, alike, *sets))
    )
    _DISTINCT_ROUTES(
        states, paths, of_beside, p, address("via", via, INT, p), first_count, aligned, different,
        found,
    )  # fmt: skip
    r = found.count
    alike = alike[:r, :r] | alike[:r, :r].T | np.eye(r, dtype=np.bool_)
    passed = [row[:length].copy() for row, length in zip(cells[:r], lengths[:r], strict=True)]
    return legs[:r], first[:r], last[:r], passed, alike
