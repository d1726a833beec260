# SPDX-License-Identifier: GPL-3.0-or-later
"""Curves that differ from each other."""

from __future__ import annotations

import ctypes
from collections.abc import Callable

import numpy as np

from . import library
from .library import COUNT, FLOAT, INT, NUMBER, POINTER, FloatArray, IntArray, Kernel, address, rows


class _CurveNodes(ctypes.Structure):
    _fields_ = [("c", COUNT), ("n", COUNT), ("positions", POINTER)]


_DISTINCT_CURVES = Kernel(
    "distinct_curves", _CurveNodes, POINTER, NUMBER, COUNT, *[ctypes.POINTER(COUNT)] * 2, POINTER
)


def distinct_curves(
    positions: FloatArray, order: IntArray, limit: float, meanwhile: Callable[[], object]
) -> IntArray:
    """Choose curves in turn that differ from all chosen before.

    Two curves differ if a node of one of them is farther than a limit from all nodes of the other.

    Parameters
    ----------
    positions : (c, n, 3) float array
        Nodes of the curves.
    order : (c,) int array
        Indices of the curves, in the order in which they are compared.
    limit : float
        In mesh units.
    meanwhile : callable
        Called between two calls of the kernel, at least after every `MOST_WORK` distances.

    Returns
    -------
    (r,) int array
        Indices of the chosen curves, in order.
    """
    c = rows("order", order)
    n = positions.shape[1] if rows("positions", positions) == c and positions.ndim == 3 else 0
    curves = _CurveNodes(c, n, address("positions", positions, FLOAT, c, n, 3))
    of_order, chosen = address("order", order, INT, c), np.zeros(c, dtype=np.int64)
    done, count = COUNT(0), COUNT(0)
    while done.value < c:
        if done.value:
            meanwhile()
        _DISTINCT_CURVES(
            curves, of_order, limit, library.MOST_WORK, done, count, chosen.ctypes.data
        )
    return chosen[: count.value]
