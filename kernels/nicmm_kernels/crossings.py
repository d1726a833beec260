# SPDX-License-Identifier: GPL-3.0-or-later
"""Segments that have a common point, and where polylines cross themselves."""

from __future__ import annotations

import ctypes
from collections.abc import Callable

import numpy as np

from . import library
from .library import COUNT, FLOAT, INT, NUMBER, POINTER, FloatArray, IntArray, Kernel, address, rows
from .traces import PointList


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

_CROSSINGS_ITEMS = Kernel("crossings_items", COUNT)
_POLYLINE_CROSSINGS = Kernel(
    "polyline_crossings", COUNT, POINTER, PointList, COUNT, NUMBER, POINTER, COUNT, COUNT,
    _PairSearch,
)  # fmt: skip

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

    def search(found: _PairSearch) -> None:
        _MEETING_SEGMENTS(segments, touching, library.MOST_WORK, found)

    return _all_pairs(search, PAIRS_OF_A_SEGMENT * s + 1, s, meanwhile)


def polyline_crossings(
    all_faces: IntArray,
    faces: IntArray,
    barycentric: FloatArray,
    closed: bool,
    touching: float,
    meanwhile: Callable[[], object],
) -> IntArray:
    """Pairs of segments of a polyline, other than neighbours, that have a common point, (p, 2).

    Parameters
    ----------
    all_faces : (F, 3) int array
        Faces of the mesh.
    faces : (n,) int array
        Face of the segment after each point.
    barycentric : (n, 3) float array
        The points in these faces.
    closed : bool
        Whether the last point is joined to the first.
    touching : float
        Distance in barycentric coordinates up to which segments touch.
    meanwhile : callable
        Called between two calls of the kernel, at least after every `MOST_WORK` comparisons.
    """
    n, f = rows("faces", faces), rows("all_faces", all_faces)
    of_faces = address("all_faces", all_faces, INT, f, 3)
    points = PointList(
        n, n, address("faces", faces, INT, n), address("barycentric", barycentric, FLOAT, n, 3)
    )
    scratch = np.empty(_CROSSINGS_ITEMS.result(n))

    def search(found: _PairSearch) -> None:
        _POLYLINE_CROSSINGS(
            f, of_faces, points, int(closed), touching, scratch.ctypes.data, len(scratch),
            library.MOST_WORK, found,
        )  # fmt: skip

    return _all_pairs(search, PAIRS_OF_A_SEGMENT * n + 1, n + 1, meanwhile)


def _all_pairs(
    search: Callable[[_PairSearch], None], room: int, end: int, meanwhile: Callable[[], object]
) -> IntArray:
    """The pairs of a search, which is over when `first` has reached its end."""
    pairs = np.empty((room, 2), dtype=np.int64)
    found = _PairSearch(room, 0, pairs.ctypes.data, 0, 1)
    parts: list[IntArray] = []
    while found.first < end:
        if parts:
            meanwhile()
        found.count = 0
        search(found)
        parts.append(pairs[: found.count].copy())
    return np.concatenate([pairs[:0], *parts])
