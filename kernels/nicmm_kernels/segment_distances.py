# SPDX-License-Identifier: GPL-3.0-or-later
"""Exact distances along the surface from segments that lie in faces."""

from __future__ import annotations

import ctypes
from collections.abc import Callable
from copy import copy
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

GROWTH = 4
"""Factor by which the room for windows grows if it is too small; then all are found anew."""

MOST_WINDOWS = 4_000_000
"""Number of windows for which there is room at most, which takes some 0.6 GB."""

_NUMBERS = 14


class PathPointers(ctypes.Structure):
    """`SegmentPaths` as the library reads and writes them."""

    _fields_ = [
        ("s", COUNT),
        ("faces", POINTER),
        ("starts", POINTER),
        ("ends", POINTER),
        ("previous", POINTER),
        ("following", POINTER),
        ("arcs", POINTER),
        ("limit", NUMBER),
        ("scale", NUMBER),
        ("distances", POINTER),
        ("room", COUNT),
        ("count", COUNT),
        ("sides", POINTER),
        ("windows", POINTER),
        ("feet", POINTER),
        ("beside", POINTER),
        ("outer", POINTER),
        ("k", COUNT),
        ("knots", POINTER),
        ("widths", POINTER),
        ("least_width", NUMBER),
        ("corners", POINTER),
        ("arrivals", POINTER),
        ("leaving", POINTER),
        ("arriving", POINTER),
        ("queued", COUNT),
        ("costs", POINTER),
        ("items", POINTER),
        ("places", POINTER),
    ]


_SEGMENT_DISTANCES = Kernel(
    "segment_distances", MeshPointers, PathPointers, COUNT, ctypes.POINTER(COUNT)
)
_NEAREST_TO_POINTS = Kernel("nearest_to_points", MeshPointers, PathPointers, COUNT, *(POINTER,) * 5)


class TooManyWindowsError(KernelError):
    """Shortest paths up to the limit cross too many edges."""


class SegmentPaths:
    """Shortest paths from s segments of a curve, each in one face, up to a limit.

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
    arcs : (s, 2) float array
        Arc lengths at their ends.
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
        arcs: FloatArray,
        limit: float,
        scale: float,
        meanwhile: Callable[[], object],
    ) -> None:
        self.mesh, self._limit, self._scale = mesh, limit, scale
        s, v = rows("faces", faces), mesh.vertex_count
        pointers = [
            address("faces", faces, INT, s), address("starts", starts, FLOAT, s, 3),
            address("ends", ends, FLOAT, s, 3), address("previous", previous, INT, s),
            address("following", following, INT, s), address("arcs", arcs, FLOAT, s, 2),
        ]  # fmt: skip
        room = WINDOWS_OF_A_SEGMENT * (s + 1)
        while True:
            self.vertex_distances = np.full(v, np.inf)
            self._feet, self._beside, self._outer = np.zeros(v), np.zeros(v), np.zeros((s, 2))
            self._corners, self._leaving, self._arriving = (
                np.full(v, -1, dtype=np.int64) for _ in range(3)
            )
            sides, windows = np.empty(room, dtype=np.int64), np.empty((room, _NUMBERS))
            if self._follow(pointers, s, sides, windows, meanwhile):
                break
            if room >= MOST_WINDOWS:
                raise TooManyWindowsError(
                    f"segment_distances: paths up to {limit:g} need more than {room} windows"
                )
            room = min(GROWTH * room, MOST_WINDOWS)
        used = np.flatnonzero(sides >= 0)
        order = used[np.argsort(sides[used], kind="stable")]
        self.sides, self._windows = sides[order], windows[order]
        in_order = np.argsort(faces, kind="stable")
        self._faces, self._arcs = faces[in_order], arcs[in_order]
        self._starts, self._ends = starts[in_order], ends[in_order]
        self._outer = self._outer[in_order]
        for marks in (self._leaving, self._arriving):
            marks[marks >= 0] = np.argsort(in_order)[marks[marks >= 0]]
        self._knots, self._widths = np.zeros(0), np.zeros(0)

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
        items, arrivals = np.empty(v + room, dtype=np.int64), np.empty(v)
        costs, places = np.empty(v + room), np.full(v + room, -1)
        work = PathPointers(
            s, *pointers, self._limit, self._scale, self.vertex_distances.ctypes.data, room, 0,
            sides.ctypes.data, windows.ctypes.data, self._feet.ctypes.data,
            self._beside.ctypes.data, self._outer.ctypes.data, 0, 0, 0, 0.0,
            self._corners.ctypes.data, arrivals.ctypes.data, self._leaving.ctypes.data,
            self._arriving.ctypes.data, 0, costs.ctypes.data, items.ctypes.data, places.ctypes.data,
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

    def relative_to(self, knots: FloatArray, widths: FloatArray) -> SegmentPaths:
        """The same paths, with distances relative to a width that varies along the curve.

        Parameters
        ----------
        knots : (k,) float array
            Arc lengths, ascending.
        widths : (k,) float array
            Widths there, positive, and linear in between.

        Returns
        -------
        SegmentPaths
            Its distances are divided by the width at the nearest place of the curve, and multiplied
            by the least width.
        """
        k = rows("knots", knots)
        address("knots", knots, FLOAT, k)
        address("widths", widths, FLOAT, k)
        found = copy(self)
        found._knots, found._widths = knots, widths
        found.__dict__.pop("pointers", None)
        return found

    def nearest(
        self, faces: IntArray, barycentric: FloatArray
    ) -> tuple[FloatArray, FloatArray, FloatArray]:
        """The nearest places of the curve to m points.

        Parameters
        ----------
        faces : (m,) int array
        barycentric : (m, 3) float array

        Returns
        -------
        distances : (m,) float array
        arcs : (m,) float array
            Arc lengths of the nearest places.
        sides : (m,) float array
            1 for points to the left of the curve, seen with the normals upwards; -1 for points to
            the right.
        """
        m = rows("faces", faces)
        given = address("faces", faces, INT, m), address("barycentric", barycentric, FLOAT, m, 3)
        distances, arcs, sides = np.zeros(m), np.zeros(m), np.zeros(m)
        _NEAREST_TO_POINTS(
            self.mesh.pointers, self.pointers, m, *given, distances.ctypes.data, arcs.ctypes.data,
            sides.ctypes.data,
        )  # fmt: skip
        return distances, arcs, sides

    @cached_property
    def pointers(self) -> PathPointers:
        """The paths as the library reads them."""
        return PathPointers(
            s=len(self._faces), faces=self._faces.ctypes.data, starts=self._starts.ctypes.data,
            ends=self._ends.ctypes.data, arcs=self._arcs.ctypes.data, scale=self._scale,
            distances=self.vertex_distances.ctypes.data, feet=self._feet.ctypes.data,
            beside=self._beside.ctypes.data, outer=self._outer.ctypes.data,
            corners=self._corners.ctypes.data, leaving=self._leaving.ctypes.data,
            arriving=self._arriving.ctypes.data, room=len(self.sides), count=len(self.sides),
            sides=self.sides.ctypes.data, windows=self._windows.ctypes.data,
            k=len(self._knots), knots=self._knots.ctypes.data,
            widths=self._widths.ctypes.data, least_width=min(self._widths, default=0.0),
        )  # fmt: skip
