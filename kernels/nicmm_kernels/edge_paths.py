# SPDX-License-Identifier: GPL-3.0-or-later
"""Shortest paths along the edges of a mesh."""

from __future__ import annotations

import ctypes
from collections.abc import Callable
from typing import Any

import numpy as np

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
    in_several_calls,
    rows,
)
from .traces import FoundTraces, MeshArrays, MeshPointers, PointList


class EdgeGraphPointers(ctypes.Structure):
    """Pointers to the arrays of a graph."""

    _fields_ = [
        ("vertex_count", COUNT),
        ("arc_count", COUNT),
        ("begins", POINTER),
        ("ends", POINTER),
        ("faces", POINTER),
        ("lengths", POINTER),
    ]


class _EdgePoints(ctypes.Structure):
    _fields_ = [
        ("q", COUNT),
        ("starts", POINTER),
        ("ends", POINTER),
        ("shares", POINTER),
        ("longest", NUMBER),
        ("faces", POINTER),
        ("barycentric", POINTER),
    ]


class _PointPaths(ctypes.Structure):
    _fields_ = [
        ("q", COUNT),
        ("start_faces", POINTER),
        ("starts", POINTER),
        ("end_faces", POINTER),
        ("ends", POINTER),
        ("longest", POINTER),
        ("reached", POINTER),
        ("counts", POINTER),
    ]


RESUMED = (POINTER, COUNT, COUNT, ctypes.POINTER(COUNT))
_EDGE_GRAPH = Kernel("edge_graph", MeshPointers, EdgeGraphPointers, POINTER)
_SEARCH_ITEMS = Kernel("edge_search_items", COUNT)
_DISTANCES = Kernel(
    "distances_along_edges", EdgeGraphPointers, COUNT, POINTER, POINTER, *RESUMED, POINTER
)
_POINTS_ON_PATHS = Kernel(
    "points_on_edge_paths", MeshPointers, EdgeGraphPointers, _EdgePoints, *RESUMED
)
_PATHS = Kernel(
    "paths_along_edges", MeshPointers, EdgeGraphPointers, _PointPaths, PointList, *RESUMED
)


class EdgeGraphArrays:
    """The edges of a mesh as a graph, in which shortest paths are searched for.

    Parameters
    ----------
    mesh : MeshArrays
    """

    def __init__(self, mesh: MeshArrays) -> None:
        self.mesh = mesh
        v, room = mesh.vertex_count, 6 * mesh.face_count
        begins, ends, faces = (np.empty(size, dtype=np.int64) for size in (v + 1, room, room))
        lengths, last_seen = np.empty(room), np.empty(v, dtype=np.int64)
        self.pointers = EdgeGraphPointers(
            v, room, begins.ctypes.data, ends.ctypes.data, faces.ctypes.data, lengths.ctypes.data
        )
        self._arrays = (begins, ends, faces, lengths)
        _EDGE_GRAPH(mesh.pointers, self.pointers, last_seen.ctypes.data)

    def __reduce__(self) -> tuple[Any, ...]:
        """Copies have pointers of their own."""
        return EdgeGraphArrays, (self.mesh,)

    @property
    def vertex_count(self) -> int:
        """Number of vertices."""
        return self.mesh.vertex_count

    def scratch(self) -> FloatArray:
        """Memory for a search."""
        return np.empty(_SEARCH_ITEMS.result(self.vertex_count))


def distances_along_edges(
    graph: EdgeGraphArrays, corners: IntArray, away: FloatArray, meanwhile: Callable[[], object]
) -> FloatArray:
    """Distances along edges from k points to all vertices, (k, V); infinite if there is no path.

    Parameters
    ----------
    graph : EdgeGraphArrays
    corners : (k, 3) int array
        Vertices to which each point is joined.
    away : (k, 3) float array
        Its distances to them.
    meanwhile : callable
        Called between two calls of the kernel, at least after every `MOST_WORK` arcs.
    """
    k = rows("corners", corners)
    distances = np.zeros((k, graph.vertex_count))
    before = (
        graph.pointers, k, address("corners", corners, INT, k, 3),
        address("away", away, FLOAT, k, 3),
    )  # fmt: skip
    after = (distances.ctypes.data,)
    in_several_calls(_DISTANCES, k, before, graph.scratch(), meanwhile, after)
    return distances


def points_on_edge_paths(
    graph: EdgeGraphArrays,
    starts: IntArray,
    ends: IntArray,
    shares: FloatArray,
    longest: float,
    meanwhile: Callable[[], object],
) -> tuple[IntArray, FloatArray]:
    """Points at given shares of q shortest paths along edges.

    Parameters
    ----------
    graph : EdgeGraphArrays
    starts, ends : (q,) int array
        Vertices that the paths join.
    shares : (q,) float array
        Shares of the lengths of the paths. A point stays at the start if there is no path.
    longest : float
        Length up to which paths are searched for, in mesh units.
    meanwhile : callable
        Called between two calls of the kernel, at least after every `MOST_WORK` arcs.

    Returns
    -------
    (q,) int array, (q, 3) float array
        The first faces that contain the points, and coordinates in them.
    """
    q = rows("starts", starts)
    faces, barycentric = np.zeros(q, dtype=np.int64), np.zeros((q, 3))
    points = _EdgePoints(
        q, address("starts", starts, INT, q), address("ends", ends, INT, q),
        address("shares", shares, FLOAT, q), longest, faces.ctypes.data, barycentric.ctypes.data,
    )  # fmt: skip
    before = (graph.mesh.pointers, graph.pointers, points)
    in_several_calls(_POINTS_ON_PATHS, q, before, graph.scratch(), meanwhile)
    return faces, barycentric


def paths_along_edges(
    graph: EdgeGraphArrays,
    starts: tuple[IntArray, FloatArray],
    ends: tuple[IntArray, FloatArray],
    longest: FloatArray,
    meanwhile: Callable[[], object],
) -> tuple[BoolArray, IntArray, IntArray, FloatArray]:
    """Shortest paths along edges between q pairs of points, which are joined to their corners.

    Parameters
    ----------
    graph : EdgeGraphArrays
    starts, ends : tuple of (q,) int array and (q, 3) float array
        Faces of the points and barycentric coordinates in them.
    longest : (q,) float array
        Lengths up to which paths are searched for, in mesh units.
    meanwhile : callable
        Called between two calls of the kernel, at least after every `MOST_WORK` arcs.

    Returns
    -------
    (q,) bool array
        Whether there is a path.
    (q,) int array
        Number of points of each path, with its start and without its end; 0 without a path.
    (p,) int array, (p, 3) float array
        The points in order: the face of the segment after each, and coordinates in it.
    """
    q = rows("longest", longest)
    found, scratch = FoundTraces(q, graph.vertex_count + 2), graph.scratch()
    paths = _PointPaths(
        q, address("start faces", starts[0], INT, q), address("starts", starts[1], FLOAT, q, 3),
        address("end faces", ends[0], INT, q), address("ends", ends[1], FLOAT, q, 3),
        address("longest", longest, FLOAT, q),
        found.reached.ctypes.data, found.counts.ctypes.data,
    )  # fmt: skip
    while found.next_call(meanwhile):
        _PATHS(
            graph.mesh.pointers, graph.pointers, paths, found.crossings, scratch.ctypes.data,
            len(scratch), library.MOST_WORK, found.done,
        )  # fmt: skip
    return found.result()
