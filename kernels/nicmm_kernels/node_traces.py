# SPDX-License-Identifier: GPL-3.0-or-later
"""Straight traces between the nodes of curves."""

from __future__ import annotations

import ctypes
from collections.abc import Callable

from . import library
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
    address,
    rows,
)
from .nodes import NodeArrays, NodePointers, SurfaceArrays, SurfacePointers
from .traces import Crossings, FoundTraces


class _StepTraces(ctypes.Structure):
    _fields_ = [
        ("m", COUNT),
        ("faces", POINTER),
        ("barycentric", POINTER),
        ("from", POINTER),
        ("to", POINTER),
        ("detour", NUMBER),
        ("fold_margin", NUMBER),
        ("reached", POINTER),
        ("crossing_counts", POINTER),
    ]


_TRACE_STEPS = Kernel(
    "trace_steps", SurfacePointers, COUNT, NodePointers, COUNT, _StepTraces, Crossings, COUNT,
    ctypes.POINTER(COUNT),
)  # fmt: skip


def trace_steps(
    surface: SurfaceArrays,
    nodes: NodeArrays,
    places: tuple[IntArray, FloatArray],
    start: IntArray,
    end: IntArray,
    detour: float,
    fold_margin: float,
    most_faces: int,
    meanwhile: Callable[[], object],
) -> tuple[BoolArray, IntArray, IntArray, FloatArray]:
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
    detour : float
        Greatest length of a trace, relative to the distance of its nodes.
    fold_margin : float
        Additional length, in mesh units, before parts over folded faces are subtracted.
    most_faces : int
        Number of faces after which a trace ends.
    meanwhile : callable
        Called between two calls of the kernel, at least after every `MOST_WORK` faces.

    Returns
    -------
    The same as `trace_between`.
    """
    m = rows("start", start)
    found = FoundTraces(m, most_faces)
    steps = _StepTraces(
        m, address("faces", places[0], INT, nodes.count),
        address("barycentric", places[1], FLOAT, nodes.count, 3), address("start", start, INT, m),
        address("end", end, INT, m), detour, fold_margin, found.reached.ctypes.data,
        found.counts.ctypes.data,
    )  # fmt: skip
    while found.next_call(meanwhile):
        _TRACE_STEPS(
            surface.pointers, most_faces, nodes.pointers, nodes.curves, steps, found.crossings,
            library.MOST_WORK, found.done,
        )  # fmt: skip
    return found.result()
