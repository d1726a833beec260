# SPDX-License-Identifier: GPL-3.0-or-later
"""Straight traces between the nodes of curves."""

from __future__ import annotations

import ctypes
from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from . import library
from .library import (
    BOOL,
    COUNT,
    FLOAT,
    INT,
    NUMBER,
    POINTER,
    BoolArray,
    FloatArray,
    IntArray,
    Kernel,
    address,
    rows,
)
from .nodes import NodeArrays, NodePointers, SurfaceArrays, SurfacePointers
from .threads import in_threads
from .traces import FoundTraces, PointList

STEPS_OF_A_THREAD = 1_000
"""Least number of steps for which another thread is worthwhile."""


class NodePlaces(ctypes.Structure):
    """Nodes, and limits of the traces between them, as the library reads them."""

    _fields_ = [
        ("faces", POINTER),
        ("barycentric", POINTER),
        ("detour", NUMBER),
        ("fold_margin", NUMBER),
        ("most_faces", COUNT),
    ]


class _StepTraces(ctypes.Structure):
    _fields_ = [
        ("m", COUNT),
        ("from", POINTER),
        ("to", POINTER),
        ("reached", POINTER),
        ("point_counts", POINTER),
    ]


class _TracedPolyline(ctypes.Structure):
    _fields_ = [
        ("is_control", POINTER),
        ("kept", POINTER),
        ("former_index", POINTER),
        ("former_count", COUNT),
        ("former_faces", POINTER),
        ("former_places", POINTER),
        ("before", COUNT),
        ("node_index", POINTER),
        ("lost", POINTER),
    ]


class StepLimits(NamedTuple):
    """Limits of traces between nodes.

    Attributes
    ----------
    detour : float
        Greatest length of a trace, relative to the distance of its nodes.
    fold_margin : float
        Additional length, in mesh units, before parts over folded faces are subtracted.
    most_faces : int
        Number of faces after which a trace ends.
    """

    detour: float
    fold_margin: float
    most_faces: int


Places = tuple[IntArray, FloatArray]
"""Faces of points, (n,), and barycentric coordinates in them, (n, 3)."""

_TRACE_STEPS = Kernel(
    "trace_steps", SurfacePointers, NodePlaces, NodePointers, COUNT, _StepTraces, PointList,
    COUNT, ctypes.POINTER(COUNT),
)  # fmt: skip
_TRACE_POLYLINE = Kernel(
    "trace_polyline", SurfacePointers, NodePlaces, NodePointers, _TracedPolyline, PointList,
    COUNT, ctypes.POINTER(COUNT),
)  # fmt: skip


def node_places(places: Places, n: int, limits: StepLimits) -> NodePlaces:
    """The places of n nodes, with limits of traces."""
    return NodePlaces(
        address("faces", places[0], INT, n), address("barycentric", places[1], FLOAT, n, 3),
        *limits,
    )  # fmt: skip


def trace_steps(
    surface: SurfaceArrays,
    nodes: NodeArrays,
    places: Places,
    start: IntArray,
    end: IntArray,
    limits: StepLimits,
    meanwhile: Callable[[], object],
) -> tuple[IntArray, IntArray, FloatArray]:
    """Trace from m nodes to the next or the previous nodes.

    The plane of a trace contains the mean normal of both nodes. Where the trace fails, the plane
    contains the mean direction of the curve before and after it.

    Parameters
    ----------
    surface : SurfaceArrays
    nodes : NodeArrays
    places : tuple of (n,) int array and (n, 3) float array
        Faces of all nodes and coordinates in them; those of the starts are positive.
    start, end : (m,) int array
        Indices of the nodes at which the traces start and end.
    limits : StepLimits
    meanwhile : callable
        Called between two calls of the kernel, at least after every `MOST_WORK` faces.

    Returns
    -------
    (m,) int array
        Number of points of each trace, including both ends; 0 if it did not reach its end.
    (q,) int array, (q, 3) float array
        The points in order: the face of the segment after each, and coordinates in it.
    """
    m = rows("start", start)
    address("start", start, INT, m)
    address("end", end, INT, m)
    placed = node_places(places, nodes.count, limits)

    def trace(
        part: slice, meanwhile: Callable[[], object]
    ) -> tuple[IntArray, tuple[IntArray, FloatArray]]:
        count = part.stop - part.start
        found = FoundTraces(count, limits.most_faces + 2)
        steps = _StepTraces(
            count, start[part].ctypes.data, end[part].ctypes.data, found.reached.ctypes.data,
            found.counts.ctypes.data,
        )  # fmt: skip
        while found.next_call(meanwhile):
            _TRACE_STEPS(
                surface.pointers, placed, nodes.pointers, nodes.curves, steps, found.crossings,
                library.MOST_WORK, found.done,
            )  # fmt: skip
        return found.counts, found.crossings_in_order()

    parts = in_threads(trace, m, meanwhile, STEPS_OF_A_THREAD)
    counts = np.concatenate([counts for counts, _ in parts])
    faces, barycentric = (np.concatenate(each) for each in zip(*(p for _, p in parts), strict=True))
    return counts, faces, barycentric


def trace_polyline(
    surface: SurfaceArrays,
    nodes: NodeArrays,
    places: Places,
    is_control: BoolArray,
    kept: BoolArray,
    former_index: IntArray,
    former: Places,
    limits: StepLimits,
    meanwhile: Callable[[], object],
) -> tuple[IntArray, FloatArray, IntArray, BoolArray]:
    """Trace a polyline through the n nodes of a curve.

    Parameters
    ----------
    surface : SurfaceArrays
    nodes : NodeArrays
    places : tuple of (n,) int array and (n, 3) float array
        Faces of the nodes and coordinates in them; positive unless a node is a control point.
    is_control : (n,) bool array
        Which nodes are control points. No trace joins two of them.
    kept : (n,) bool array
        Nodes after which the former polyline is kept.
    former_index : (n,) int array
        Index of each node in the former polyline, ascending.
    former : tuple of (p,) int array and (p, 3) float array
        Faces of the segments of the former polyline, and coordinates of its points in them.
    limits : StepLimits
    meanwhile : callable
        Called between two calls of the kernel, at least after every `MOST_WORK` faces.

    Returns
    -------
    (q,) int array, (q, 3) float array
        Faces of the segments of the polyline, and coordinates of its points in them.
    (n,) int array
        Index of each node in it.
    (n,) bool array
        Nodes whose trace to the next node failed; there the polyline has no points in between.
    """
    n, p = nodes.count, rows("former faces", former[0])
    node_index, found = np.zeros(n, dtype=np.int64), FoundTraces(n, max(p, limits.most_faces) + 1)
    lost = found.reached
    polyline = _TracedPolyline(
        address("is_control", is_control, BOOL, n), address("kept", kept, BOOL, n),
        address("former_index", former_index, INT, n), p,
        address("former faces", former[0], INT, p),
        address("former barycentric", former[1], FLOAT, p, 3), 0, node_index.ctypes.data,
        lost.ctypes.data,
    )  # fmt: skip
    placed, pointers = node_places(places, n, limits), nodes.one()
    while found.next_call(meanwhile):
        polyline.before = found.count
        _TRACE_POLYLINE(
            surface.pointers, placed, pointers, polyline, found.crossings, library.MOST_WORK,
            found.done,
        )  # fmt: skip
    faces, barycentric = found.crossings_in_order()
    return faces, barycentric, node_index, lost
