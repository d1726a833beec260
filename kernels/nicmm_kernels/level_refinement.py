# SPDX-License-Identifier: GPL-3.0-or-later
"""Bisection of triangles near a line at a constant distance from segments."""

from __future__ import annotations

import ctypes
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from . import library
from .library import (
    BOOL,
    COUNT,
    FLOAT,
    INT,
    NUMBER,
    POINTER,
    TOO_SMALL,
    BoolArray,
    FloatArray,
    IntArray,
    Kernel,
    address,
    rows,
)
from .segment_distances import PathPointers, SegmentPaths
from .traces import MeshPointers

GROWTH, FEWEST = 2, 16
"""The room for triangles and vertices is this factor of their number, and so many more."""


class LevelLimits(NamedTuple):
    """Where triangles are bisected, in mesh units.

    Parameters
    ----------
    level : float
        Distance of the line from the segments.
    clearance : float
        Least radius of the line where it is an arc about a point.
    coarsest : float
        Greatest length of the longest side of a triangle at the line.
    finest : float
        Length of the longest side up to which any triangle is accurate enough.
    error : float
        Greatest error of distances that are interpolated in a triangle.
    """

    level: float
    clearance: float
    coarsest: float
    finest: float
    error: float


class PartArrays(NamedTuple):
    """Triangles that are parts of faces of a mesh.

    Parameters
    ----------
    faces : (f, 3) int array
        Vertices of each triangle.
    opposite : (3 f,) int array
        For side 3 i + j the same edge as a side of the adjacent triangle; the side itself at a
        boundary.
    parents : (f,) int array
        The face of the mesh that contains each triangle.
    corners : (f, 3, 3) float array
        Barycentric coordinates of the corners in it.
    vertices : (v, 3) float array
    distances : (v,) float array
        Distances of the vertices.
    fixed : (v,) bool array
        A side between two such vertices is not bisected.
    """

    faces: IntArray
    opposite: IntArray
    parents: IntArray
    corners: FloatArray
    vertices: FloatArray
    distances: FloatArray
    fixed: BoolArray


class _Refinement(ctypes.Structure):
    _fields_ = [
        ("face_room", COUNT),
        ("face_count", COUNT),
        ("faces", POINTER),
        ("opposite", POINTER),
        ("parents", POINTER),
        ("corners", POINTER),
        ("vertex_room", COUNT),
        ("vertex_count", COUNT),
        ("vertices", POINTER),
        ("distances", POINTER),
        ("fixed", POINTER),
        ("reached", POINTER),
        ("level", NUMBER),
        ("clearance", NUMBER),
        ("coarsest", NUMBER),
        ("finest", NUMBER),
        ("error", NUMBER),
        ("pending", POINTER),
        ("is_pending", POINTER),
        ("pending_count", COUNT),
    ]


_REFINE = Kernel(
    "refine_at_level", MeshPointers, PathPointers, _Refinement, COUNT, ctypes.POINTER(COUNT)
)


def refine_at_level(
    paths: SegmentPaths,
    parts: PartArrays,
    reached: BoolArray,
    limits: LevelLimits,
    meanwhile: Callable[[], object],
) -> PartArrays:
    """Bisect triangles near a line at a constant distance until they resolve it.

    Parameters
    ----------
    paths : SegmentPaths
        Shortest paths from the segments over the mesh.
    parts : PartArrays
        The triangles, which conform.
    reached : (F,) bool array
        Faces of the mesh that the paths reach. Triangles elsewhere are bisected only with others.
    limits : LevelLimits
    meanwhile : callable
        Called between two calls of the kernel.

    Returns
    -------
    PartArrays
        The triangles and vertices that were given keep their indices.
    """
    f, v = rows("faces", parts.faces), rows("vertices", parts.vertices)
    address("faces", parts.faces, INT, f, 3)
    address("opposite", parts.opposite, INT, 3 * f)
    address("parents", parts.parents, INT, f)
    address("corners", parts.corners, FLOAT, f, 3, 3)
    address("vertices", parts.vertices, FLOAT, v, 3)
    address("distances", parts.distances, FLOAT, v)
    address("fixed", parts.fixed, BOOL, v)
    on_mesh = address("reached", reached, BOOL, paths.mesh.face_count)
    pending, is_pending = np.arange(f)[::-1].astype(np.int64), np.ones(f, dtype=bool)
    count, done = f, COUNT(0)
    while not done.value:
        room, vertex_room = (GROWTH * each + FEWEST for each in (f, v))
        faces, parents, corners = (
            _with_room(each, room) for each in (parts.faces, parts.parents, parts.corners)
        )
        opposite = _with_room(parts.opposite, 3 * room)
        vertices, distances, fixed = (_with_room(each, vertex_room) for each in parts[4:])
        pending, is_pending = _with_room(pending, room), _with_room(is_pending, room)
        work = _Refinement(
            room, f, faces.ctypes.data, opposite.ctypes.data, parents.ctypes.data,
            corners.ctypes.data, vertex_room, v, vertices.ctypes.data, distances.ctypes.data,
            fixed.ctypes.data, on_mesh, *limits, pending.ctypes.data, is_pending.ctypes.data, count,
        )  # fmt: skip
        code = 0
        while not (done.value or code):
            code = _REFINE.result(
                paths.mesh.pointers, paths.pointers, work, library.MOST_WORK, done
            )
            meanwhile()
        if code != TOO_SMALL:
            _REFINE.check(code)
        f, v, count = work.face_count, work.vertex_count, work.pending_count
        parts = PartArrays(
            faces[:f], opposite[: 3 * f], parents[:f], corners[:f], vertices[:v], distances[:v],
            fixed[:v],
        )  # fmt: skip
    return parts


def _with_room(array: NDArray[Any], room: int) -> NDArray[Any]:
    """A copy that is longer."""
    longer = np.zeros((room, *array.shape[1:]), dtype=array.dtype)
    longer[: len(array)] = array
    return longer
