# SPDX-License-Identifier: GPL-3.0-or-later
"""Points and segments of the traces between the nodes of curves."""

from __future__ import annotations

import ctypes
from typing import Any

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
from .traces import MeshArrays, MeshPointers


class _Traces(ctypes.Structure):
    _fields_ = [
        ("n", COUNT),
        ("p", COUNT),
        ("begins", POINTER),
        ("faces", POINTER),
        ("barycentric", POINTER),
        ("arcs", POINTER),
    ]


_MEASURE_TRACES = Kernel("measure_traces", MeshPointers, _Traces)
_PLACES_ON_TRACES = Kernel(
    "places_on_traces", MeshPointers, _Traces, COUNT, POINTER, POINTER, NUMBER, *[POINTER] * 3
)
_SEGMENT_ENDS = Kernel(
    "segment_ends", COUNT, POINTER, COUNT, POINTER, POINTER, COUNT, POINTER, POINTER
)


class TraceArrays:
    """Traces between nodes, checked once for all calls. They must not change afterwards.

    Parameters
    ----------
    mesh : MeshArrays
    begins : (n + 1,) int array
        Index of the first point of the trace from each node, and the number p of points. A trace
        that failed has no points.
    faces : (p,) int array
        Face of the segment after each point.
    barycentric : (p, 3) float array
        The points, in these faces.

    Attributes
    ----------
    arcs : (p,) float array
        Arc length of each point from the beginning of its trace.
    """

    def __init__(
        self, mesh: MeshArrays, begins: IntArray, faces: IntArray, barycentric: FloatArray
    ) -> None:
        n, p = rows("begins", begins) - 1, rows("faces", faces)
        if n < 0:
            raise KernelError("begins has shape (0,); pass one entry more than nodes")
        self.mesh, self.arcs = mesh, np.zeros(p)
        self._given = (mesh, begins, faces, barycentric)
        self.pointers = _Traces(
            n, p, address("begins", begins, INT, n + 1), address("faces", faces, INT, p),
            address("barycentric", barycentric, FLOAT, p, 3), self.arcs.ctypes.data,
        )  # fmt: skip
        _MEASURE_TRACES(mesh.pointers, self.pointers)

    def __reduce__(self) -> tuple[Any, ...]:
        """Copies have pointers of their own."""
        return TraceArrays, self._given


def places_on_traces(
    traces: TraceArrays, nodes: IntArray, shares: FloatArray, least_inside: float
) -> tuple[IntArray, FloatArray, BoolArray]:
    """Points at given shares of traces.

    Parameters
    ----------
    traces : TraceArrays
    nodes : (q,) int array
        Nodes at which the traces begin.
    shares : (q,) float array
        Shares of the lengths of the traces, 0 … 1.
    least_inside : float
        Least barycentric coordinate of the points.

    Returns
    -------
    (q,) int array, (q, 3) float array
        Faces of the points, and coordinates in them.
    (q,) bool array
        Whether the trace failed, so that there is no point on it.
    """
    q = rows("nodes", nodes)
    faces, barycentric = np.zeros(q, dtype=np.int64), np.zeros((q, 3))
    lost = np.zeros(q, dtype=np.bool_)
    _PLACES_ON_TRACES(
        traces.mesh.pointers, traces.pointers, q, address("nodes", nodes, INT, q),
        address("shares", shares, FLOAT, q), least_inside, faces.ctypes.data,
        barycentric.ctypes.data, lost.ctypes.data,
    )  # fmt: skip
    return faces, barycentric, lost


def segment_ends(
    all_faces: IntArray, faces: IntArray, barycentric: FloatArray, segments: IntArray
) -> FloatArray:
    """First two coordinates of the ends of s segments of a polyline in their faces, (s, 2).

    Parameters
    ----------
    all_faces : (F, 3) int array
        Vertices of all faces of a mesh.
    faces : (p,) int array
        Face of the segment after each point of the polyline.
    barycentric : (p, 3) float array
        The points, in these faces.
    segments : (s,) int array
        Indices of the points at which the segments begin. The last point is followed by the first.
    """
    count, p, s = rows("all_faces", all_faces), rows("faces", faces), rows("segments", segments)
    ends = np.zeros((s, 2))
    _SEGMENT_ENDS(
        count, address("all_faces", all_faces, INT, count, 3), p,
        address("faces", faces, INT, p),
        address("barycentric", barycentric, FLOAT, p, 3), s,
        address("segments", segments, INT, s), ends.ctypes.data,
    )  # fmt: skip
    return ends
