# SPDX-License-Identifier: GPL-3.0-or-later
"""Exact distances along the surface from segments that lie in faces."""

from __future__ import annotations

import ctypes
from collections.abc import Callable
from functools import cached_property

import numpy as np

from . import library
from .library import (
    COUNT,
    FLOAT,
    INT,
    NUMBER,
    POINTER,
    TOO_SMALL,
    FloatArray,
    IntArray,
    Kernel,
    KernelError,
    address,
    rows,
)
from .traces import MeshArrays, MeshPointers

WINDOWS_OF_A_SEGMENT = 256
"""Number of windows of each segment for which there is room at first."""

MOST_WINDOWS = 4_000_000
"""Number of windows for which there is room at most, which takes some 0.6 GB."""

_NUMBERS = 11


class PathPointers(ctypes.Structure):
    """`SegmentPaths` as the library reads and writes them."""

    _fields_ = [
        ("s", COUNT),
        ("faces", POINTER),
        ("starts", POINTER),
        ("ends", POINTER),
        ("previous", POINTER),
        ("following", POINTER),
        ("limit", NUMBER),
        ("scale", NUMBER),
        ("distances", POINTER),
        ("room", COUNT),
        ("count", COUNT),
        ("sides", POINTER),
        ("windows", POINTER),
        ("corners", POINTER),
        ("arrivals", POINTER),
        ("queued", COUNT),
        ("costs", POINTER),
        ("items", POINTER),
        ("places", POINTER),
    ]


_SEGMENT_DISTANCES = Kernel(
    "segment_distances", MeshPointers, PathPointers, COUNT, ctypes.POINTER(COUNT)
)
_DISTANCES_OF_POINTS = Kernel(
    "distances_of_points", MeshPointers, PathPointers, COUNT, POINTER, POINTER, POINTER
)


class TooManyWindowsError(KernelError):
    """Shortest paths up to the limit cross too many edges."""


class SegmentPaths:
    """Shortest paths from s segments, each in one face, up to a limit.

    Parameters
    ----------
    mesh : MeshArrays
        Paths end where a side has no opposite one.
    faces : (s,) int array
        Faces of the segments.
    starts, ends : (s, 3) float arrays
        Barycentric coordinates of their ends.
    previous, following : (s,) int arrays
        The segment that ends where each one begins, and the one that begins where it ends; -1 if
        no segment does or if that is unknown.
    limit : float
        Distance up to which paths are followed, in mesh units.
    scale : float
        Distance below which points are the same.
    meanwhile : callable
        Called between two calls of the kernel.

    Attributes
    ----------
    vertex_distances : (V,) float array
        Distance of each vertex. Greater distances than the limit may be too great or infinite.
    sides : (w,) int array
        Sides 3 f + j of faces f through which paths enter them, ascending.

    Raises
    ------
    TooManyWindowsError
    """

    def __init__(
        self,
        mesh: MeshArrays,
        faces: IntArray,
        starts: FloatArray,
        ends: FloatArray,
        previous: IntArray,
        following: IntArray,
        limit: float,
        scale: float,
        meanwhile: Callable[[], object],
    ) -> None:
        self.mesh, self._limit, self._scale = mesh, limit, scale
        s = rows("faces", faces)
        pointers = [
            address("faces", faces, INT, s), address("starts", starts, FLOAT, s, 3),
            address("ends", ends, FLOAT, s, 3), address("previous", previous, INT, s),
            address("following", following, INT, s),
        ]  # fmt: skip
        room = WINDOWS_OF_A_SEGMENT * (s + 1)
        while True:
            self.vertex_distances = np.full(mesh.vertex_count, np.inf)
            sides, windows = np.empty(room, dtype=np.int64), np.empty((room, _NUMBERS))
            if self._follow(pointers, s, sides, windows, meanwhile):
                break
            if 2 * room > MOST_WINDOWS:
                raise TooManyWindowsError(
                    f"segment_distances: paths up to {limit:g} need more than {room} windows"
                )
            room *= 2
        used = np.flatnonzero(sides >= 0)
        order = used[np.argsort(sides[used], kind="stable")]
        self.sides, self._windows = sides[order], windows[order]
        in_order = np.argsort(faces, kind="stable")
        self._faces, self._starts, self._ends = faces[in_order], starts[in_order], ends[in_order]

    def _follow(
        self,
        pointers: list[int],
        s: int,
        sides: IntArray,
        windows: FloatArray,
        meanwhile: Callable[[], object],
    ) -> bool:
        """Find all windows; returns whether there was room for them."""
        v, room = self.mesh.vertex_count, len(sides)
        corners, items = np.empty(v, dtype=np.int64), np.empty(v + room, dtype=np.int64)
        arrivals, costs, places = np.empty(v), np.empty(v + room), np.full(v + room, -1)
        work = PathPointers(
            s, *pointers, self._limit, self._scale, self.vertex_distances.ctypes.data, room, 0,
            sides.ctypes.data, windows.ctypes.data, corners.ctypes.data, arrivals.ctypes.data, 0,
            costs.ctypes.data, items.ctypes.data, places.ctypes.data,
        )  # fmt: skip
        done = COUNT(0)
        while not done.value:
            code = _SEGMENT_DISTANCES.result(self.mesh.pointers, work, library.MOST_WORK, done)
            if code == TOO_SMALL:
                return False
            _SEGMENT_DISTANCES.check(code)
            meanwhile()
        sides[work.count :] = -1
        return True

    def at(self, faces: IntArray, barycentric: FloatArray) -> FloatArray:
        """Distances of m points, by faces (m,) and barycentric coordinates (m, 3)."""
        m = rows("faces", faces)
        given = address("faces", faces, INT, m), address("barycentric", barycentric, FLOAT, m, 3)
        distances = np.zeros(m)
        _DISTANCES_OF_POINTS(self.mesh.pointers, self.pointers, m, *given, distances.ctypes.data)
        return distances

    @cached_property
    def pointers(self) -> PathPointers:
        """The paths as the library reads them."""
        return PathPointers(
            s=len(self._faces), faces=self._faces.ctypes.data, starts=self._starts.ctypes.data,
            ends=self._ends.ctypes.data, scale=self._scale, room=len(self.sides),
            distances=self.vertex_distances.ctypes.data, count=len(self.sides),
            sides=self.sides.ctypes.data, windows=self._windows.ctypes.data,
        )  # fmt: skip
