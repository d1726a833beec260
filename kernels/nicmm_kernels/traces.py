# SPDX-License-Identifier: GPL-3.0-or-later
"""Meshes, and straight traces over their faces."""

from __future__ import annotations

import ctypes
from collections.abc import Callable
from typing import Any

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
    optional_address,
    rows,
)


class MeshPointers(ctypes.Structure):
    """`MeshArrays` as the library reads them."""

    _fields_ = [
        ("vertices", POINTER),
        ("faces", POINTER),
        ("face_normals", POINTER),
        ("opposite_sides", POINTER),
        ("vertex_count", COUNT),
        ("face_count", COUNT),
        ("is_oriented", COUNT),
    ]


class MeshArrays:
    """The arrays of a mesh, checked once for all calls. They must not change afterwards.

    Parameters
    ----------
    vertices : (V, 3) float array
        Positions.
    faces : (F, 3) int array
        Vertices of each face.
    face_normals : (F, 3) float array
        Unit vectors; zero where a face has no area.
    opposite_sides : (3 F,) int array
        For side 3 f + j, opposite corner j of face f, the same edge as a side of the adjacent face;
        the side itself where there is none, or more than one.
    is_oriented : bool
        Whether no two faces traverse an edge in the same direction.
    """

    def __init__(
        self,
        vertices: FloatArray,
        faces: IntArray,
        face_normals: FloatArray,
        opposite_sides: IntArray,
        is_oriented: bool,
    ) -> None:
        self.vertex_count = rows("vertices", vertices)
        self.face_count = rows("faces", faces)
        self._given = (vertices, faces, face_normals, opposite_sides, is_oriented)
        self.pointers = MeshPointers(
            address("vertices", vertices, FLOAT, self.vertex_count, 3),
            address("faces", faces, INT, self.face_count, 3),
            address("face_normals", face_normals, FLOAT, self.face_count, 3),
            address("opposite_sides", opposite_sides, INT, 3 * self.face_count),
            self.vertex_count,
            self.face_count,
            int(is_oriented),
        )

    def __reduce__(self) -> tuple[Any, ...]:
        """Copies have pointers of their own."""
        return MeshArrays, self._given


class TraceLimits(ctypes.Structure):
    """Limits of traces.

    Parameters
    ----------
    least_inside : float
        Least barycentric coordinate of a point strictly inside its face.
    most_faces : int
        Number of faces after which a trace ends.
    """

    _fields_ = [("least_inside", NUMBER), ("most_faces", COUNT)]


_TRACE_FROM = Kernel(
    "trace_from", MeshPointers, POINTER, TraceLimits, COUNT, *[POINTER] * 5,
    ctypes.POINTER(COUNT), COUNT, ctypes.POINTER(COUNT),
)  # fmt: skip


def trace_from(
    mesh: MeshArrays,
    faces: IntArray,
    barycentric: FloatArray,
    directions: FloatArray,
    lengths: FloatArray,
    folded: BoolArray | None,
    limits: TraceLimits,
    meanwhile: Callable[[], object],
) -> tuple[IntArray, FloatArray, BoolArray, int]:
    """Move m points straight along the surface.

    Parameters
    ----------
    mesh : MeshArrays
    faces : (m,) int array
        Faces of the points.
    barycentric : (m, 3) float array
        Coordinates in them, all of them positive unless the point does not move.
    directions : (m, 3) float array
        Unit vectors, nearly tangent to the faces.
    lengths : (m,) float array
        Distances to move, in mesh units; not negative.
    folded : (F,) bool array or None
        Faces over which traces run backward.
    limits : TraceLimits
    meanwhile : callable
        Called after every `library.MOST_WORK` faces.

    Returns
    -------
    (m,) int array, (m, 3) float array
        Faces of the moved points and coordinates in them.
    (m,) bool array
        Whether each point stopped at a boundary or a non-manifold edge.
    int
        Greatest number of faces that a point passed.
    """
    m = rows("faces", faces)
    address("faces", faces, INT, m)
    address("barycentric", barycentric, FLOAT, m, 3)
    faces, barycentric, blocked = faces.copy(), barycentric.copy(), np.zeros(m, dtype=np.bool_)
    done, most_passed = COUNT(0), COUNT(0)
    arguments = (
        mesh.pointers, optional_address("folded", folded, BOOL, mesh.face_count), limits, m,
        faces.ctypes.data, barycentric.ctypes.data,
        address("directions", directions, FLOAT, m, 3), address("lengths", lengths, FLOAT, m),
        blocked.ctypes.data, most_passed, library.MOST_WORK, done,
    )  # fmt: skip
    while done.value < m:
        if done.value:
            meanwhile()
        _TRACE_FROM(*arguments)
    return faces, barycentric, blocked, most_passed.value


class _TracePairs(ctypes.Structure):
    _fields_ = [
        ("start_faces", POINTER),
        ("starts", POINTER),
        ("end_faces", POINTER),
        ("ends", POINTER),
        ("normals", POINTER),
        ("ahead", POINTER),
        ("longest", POINTER),
        ("fold_margin", NUMBER),
        ("reached", POINTER),
        ("crossing_counts", POINTER),
    ]


class PointList(ctypes.Structure):
    """Points of polylines and traces as the library reads and writes them."""

    _fields_ = [("room", COUNT), ("count", COUNT), ("faces", POINTER), ("barycentric", POINTER)]


_TRACE_BETWEEN = Kernel(
    "trace_between", MeshPointers, POINTER, COUNT, COUNT, _TracePairs, PointList, COUNT,
    ctypes.POINTER(COUNT),
)  # fmt: skip

CROSSINGS_OF_A_TRACE = 8
"""Number of crossings for which there is room for each trace; where it is not enough, traces are
found in several calls."""


class FoundTraces:
    """The results of kernels that find m traces in several calls.

    Parameters
    ----------
    m : int
        Number of traces.
    most_faces : int
        Number of faces after which a trace ends.
    """

    def __init__(self, m: int, most_faces: int) -> None:
        room = most_faces + CROSSINGS_OF_A_TRACE * m
        self.reached, self.counts = np.zeros(m, dtype=np.bool_), np.zeros(m, dtype=np.int64)
        self._faces, self._barycentric = np.empty(room, dtype=np.int64), np.empty((room, 3))
        self.crossings = PointList(room, 0, self._faces.ctypes.data, self._barycentric.ctypes.data)
        self.done = COUNT(0)
        self._parts: list[tuple[IntArray, FloatArray]] = []

    def next_call(self, meanwhile: Callable[[], object]) -> bool:
        """Whether another call is needed; then store what the last one has found."""
        if not self.done.value:
            return len(self.reached) > 0
        self._store()
        if self.done.value < len(self.reached):
            meanwhile()
            return True
        return False

    def _store(self) -> None:
        count, self.crossings.count = self.crossings.count, 0
        self._parts.append((self._faces[:count].copy(), self._barycentric[:count].copy()))

    @property
    def count(self) -> int:
        """Number of crossings found so far."""
        return sum(len(part[0]) for part in self._parts)

    def crossings_in_order(self) -> tuple[IntArray, FloatArray]:
        """Faces and coordinates of all crossings."""
        if len(self._parts) == 1:
            return self._parts[0]
        faces = np.concatenate([self._faces[:0], *(part[0] for part in self._parts)])
        return faces, np.concatenate([self._barycentric[:0], *(part[1] for part in self._parts)])

    def result(self) -> tuple[BoolArray, IntArray, IntArray, FloatArray]:
        """Which traces reached their ends, their numbers of crossings, and these crossings."""
        return self.reached, self.counts, *self.crossings_in_order()


def trace_between(
    mesh: MeshArrays,
    starts: tuple[IntArray, FloatArray],
    ends: tuple[IntArray, FloatArray],
    normals: FloatArray,
    longest: FloatArray,
    folded: BoolArray | None,
    fold_margin: float,
    ahead: FloatArray | None,
    most_faces: int,
    meanwhile: Callable[[], object],
) -> tuple[BoolArray, IntArray, IntArray, FloatArray]:
    """Trace between m pairs of points.

    Parameters
    ----------
    mesh : MeshArrays
    starts, ends : tuple of (m,) int array and (m, 3) float array
        Faces of the points and barycentric coordinates in them; those of starts are positive.
    normals : (m, 3) float array
        Vectors in the planes of the traces, besides those from the starts to the ends.
    longest : (m,) float array
        Greatest lengths up to the faces of the ends, in mesh units.
    folded : (F,) bool array or None
        Faces over which the length of traces counts as negative.
    fold_margin : float
        Additional length, in mesh units, before such parts are subtracted.
    ahead : (m, 3) float array or None
        Directions in which the traces leave their starts; by default those to the ends.
    most_faces : int
        Number of faces after which a trace ends.
    meanwhile : callable
        Called between two calls of the kernel, at least after every `library.MOST_WORK` faces.

    Returns
    -------
    (m,) bool array
        Whether each trace reached its end.
    (m,) int array
        Number of crossings of each trace with edges; 0 if it did not reach its end.
    (q,) int array, (q, 3) float array
        The crossings in order: the face that is entered, and barycentric coordinates in it.
    """
    m = rows("longest", longest)
    found = FoundTraces(m, most_faces)
    pairs = _TracePairs(
        address("start faces", starts[0], INT, m), address("starts", starts[1], FLOAT, m, 3),
        address("end faces", ends[0], INT, m), address("ends", ends[1], FLOAT, m, 3),
        address("normals", normals, FLOAT, m, 3), optional_address("ahead", ahead, FLOAT, m, 3),
        address("longest", longest, FLOAT, m), fold_margin,
        found.reached.ctypes.data, found.counts.ctypes.data,
    )  # fmt: skip
    of_folded = optional_address("folded", folded, BOOL, mesh.face_count)
    while found.next_call(meanwhile):
        _TRACE_BETWEEN(
            mesh.pointers, of_folded, most_faces, m, pairs, found.crossings, library.MOST_WORK,
            found.done,
        )  # fmt: skip
    return found.result()
