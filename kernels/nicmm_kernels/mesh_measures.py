# SPDX-License-Identifier: GPL-3.0-or-later
"""Measures of the faces and edges of a mesh, and connected components of a graph."""

from __future__ import annotations

import ctypes
from collections.abc import Callable

import numpy as np

from . import library
from .library import COUNT, FLOAT, INT, POINTER, FloatArray, IntArray, Kernel, address, rows
from .threads import in_threads

ROWS_OF_A_THREAD = 50_000
"""Least number of faces or edges for which another thread is worthwhile."""


class _Vertices(ctypes.Structure):
    _fields_ = [("vertex_count", COUNT), ("vertices", POINTER)]


_AREA_VECTORS = Kernel("area_vectors", _Vertices, COUNT, POINTER, POINTER)
_EDGE_LENGTHS = Kernel("edge_lengths", _Vertices, COUNT, POINTER, POINTER)
_JOIN = Kernel("join_components", COUNT, COUNT, POINTER, POINTER, POINTER)
_NUMBER = Kernel("number_components", COUNT, POINTER, ctypes.POINTER(COUNT))


def area_vectors(
    vertices: FloatArray, faces: IntArray, meanwhile: Callable[[], object]
) -> FloatArray:
    """Normals of faces, (F, 3), whose lengths are twice the areas.

    Parameters
    ----------
    vertices : (V, 3) float array
    faces : (F, 3) int array
    meanwhile : callable
        Called between two calls of the kernel, at least after every `MOST_WORK` faces.
    """
    result = np.empty((rows("faces", faces), 3))
    _measure(_AREA_VECTORS, vertices, "faces", faces, 3, result, meanwhile)
    return result


def edge_lengths(
    vertices: FloatArray, edges: IntArray, meanwhile: Callable[[], object]
) -> FloatArray:
    """Lengths of edges, (E,).

    Parameters
    ----------
    vertices : (V, 3) float array
    edges : (E, 2) int array
        Vertices at their ends.
    meanwhile : callable
        Called between two calls of the kernel, at least after every `MOST_WORK` edges.
    """
    result = np.empty(rows("edges", edges))
    _measure(_EDGE_LENGTHS, vertices, "edges", edges, 2, result, meanwhile)
    return result


def _measure(
    kernel: Kernel,
    vertices: FloatArray,
    name: str,
    simplices: IntArray,
    corners: int,
    result: FloatArray,
    meanwhile: Callable[[], object],
) -> None:
    """Compute the rows of the result from the simplices of the same rows, in several threads."""
    v, n = rows("vertices", vertices), len(result)
    given = _Vertices(v, address("vertices", vertices, FLOAT, v, 3))
    address(name, simplices, INT, n, corners)

    def compute(part: slice, meanwhile: Callable[[], object]) -> None:
        for begin in range(part.start, part.stop, library.MOST_WORK):
            if begin > part.start:
                meanwhile()
            end = min(begin + library.MOST_WORK, part.stop)
            kernel(given, end - begin, simplices[begin:end].ctypes.data, result[begin:].ctypes.data)

    in_threads(compute, n, meanwhile, ROWS_OF_A_THREAD)


def connected_components(
    size: int, one: IntArray, other: IntArray, meanwhile: Callable[[], object]
) -> tuple[int, IntArray]:
    """Connected components of an undirected graph.

    Parameters
    ----------
    size : int
        Number of nodes.
    one, other : (m,) int array
        Nodes at the two ends of each arc.
    meanwhile : callable
        Called between two calls of the kernel, at least after every `MOST_WORK` arcs.

    Returns
    -------
    int
        Number of components.
    (size,) int array
        Index of the component of each node; components are in the order of their first nodes.
    """
    m = rows("one", one)
    address("one", one, INT, m)
    address("other", other, INT, m)
    label, number = np.arange(size, dtype=np.int64), COUNT(0)
    for begin in range(0, m, library.MOST_WORK):
        if begin:
            meanwhile()
        count = min(library.MOST_WORK, m - begin)
        _JOIN(size, count, one[begin:].ctypes.data, other[begin:].ctypes.data, label.ctypes.data)
    _NUMBER(size, label.ctypes.data, number)
    return number.value, label
