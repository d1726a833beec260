# SPDX-License-Identifier: GPL-3.0-or-later
"""Segments that have a common point."""

from __future__ import annotations

import ctypes
from collections.abc import Callable

import numpy as np

from . import library
from .library import COUNT, FLOAT, INT, NUMBER, POINTER, FloatArray, IntArray, Kernel, address, rows


class _Segments(ctypes.Structure):
    _fields_ = [
        ("s", COUNT),
        ("order", POINTER),
        ("groups", POINTER),
        ("starts", POINTER),
        ("ends", POINTER),
    ]


class _PairSearch(ctypes.Structure):
    _fields_ = [
        ("room", COUNT),
        ("count", COUNT),
        ("pairs", POINTER),
        ("first", COUNT),
        ("second", COUNT),
    ]


_ORDER_ITEMS = Kernel("order_items", COUNT)
_ORDER_OF_GROUPS = Kernel("order_of_groups", COUNT, POINTER, POINTER, COUNT, POINTER)
_MEETING_SEGMENTS = Kernel("meeting_segments", _Segments, NUMBER, COUNT, _PairSearch)

PAIRS_OF_A_SEGMENT = 4
"""Number of pairs for which there is room for each segment; more are found in several calls."""


def meeting_segments(
    groups: IntArray,
    starts: FloatArray,
    ends: FloatArray,
    touching: float,
    meanwhile: Callable[[], object],
) -> IntArray:
    """Pairs of segments of the same group that have a common point, (p, 2).

    Parameters
    ----------
    groups : (s,) int array
        Index of the group of each segment. All segments of a group lie in one face.
    starts, ends : (s, 2) float array
        First two barycentric coordinates of the ends of each segment in this face.
    touching : float
        Distance in barycentric coordinates up to which segments touch.
    meanwhile : callable
        Called between two calls of the kernel, at least after every `MOST_WORK` comparisons.
    """
    s = rows("groups", groups)
    of_groups = address("groups", groups, INT, s)
    order, scratch = np.empty(s, dtype=np.int64), np.empty(_ORDER_ITEMS.result(s))
    _ORDER_OF_GROUPS(s, of_groups, scratch.ctypes.data, len(scratch), order.ctypes.data)
    segments = _Segments(
        s, order.ctypes.data, of_groups, address("starts", starts, FLOAT, s, 2),
        address("ends", ends, FLOAT, s, 2),
    )  # fmt: skip
    room = PAIRS_OF_A_SEGMENT * s + 1
    pairs = np.empty((room, 2), dtype=np.int64)
    search = _PairSearch(room, 0, pairs.ctypes.data, 0, 1)
    parts: list[IntArray] = []
    while search.first < s:
        if parts:
            meanwhile()
            search.count = 0
        _MEETING_SEGMENTS(segments, touching, library.MOST_WORK, search)
        parts.append(pairs[: search.count].copy())
    return np.concatenate([pairs[:0], *parts])
