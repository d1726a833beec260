# SPDX-License-Identifier: GPL-3.0-or-later
"""Flips the diagonals of nearly flat quadrilaterals of a mesh towards a Delaunay triangulation."""

from __future__ import annotations

import ctypes
from collections.abc import Callable

import numpy as np

from . import library
from .library import COUNT, FLOAT, INT, NUMBER, POINTER, FloatArray, IntArray, Kernel, address, rows

MOST_FLIPS = 20
"""Greatest number of flips for each face. Where the surface is not flat, they may not converge."""


class _FlippedMesh(ctypes.Structure):
    _fields_ = [
        ("vertex_count", COUNT),
        ("face_count", COUNT),
        ("vertices", POINTER),
        ("valences", POINTER),
        ("faces", POINTER),
        ("opposites", POINTER),
    ]


class _FlipRules(ctypes.Structure):
    _fields_ = [("flattest", NUMBER), ("tie", NUMBER)]


_ITEMS = Kernel("flip_diagonals_items", COUNT)
_FLIP_DIAGONALS = Kernel(
    "flip_diagonals", _FlippedMesh, _FlipRules, COUNT, POINTER, COUNT, COUNT, POINTER
)


def flip_diagonals(
    vertices: FloatArray,
    faces: IntArray,
    opposites: IntArray,
    flattest: float,
    tie: float,
    meanwhile: Callable[[], object],
) -> IntArray:
    """Flip edges until each is the better diagonal of its two faces.

    That is the one with the smaller sum of opposite angles. If both sums are about equal, it is the
    one at the vertex of least index.

    Parameters
    ----------
    vertices : (V, 3) float array
    faces : (F, 3) int array
        Edges at which their orientation changes stay.
    opposites : (3 F,) int array
        For each side, the same edge as a side of the next face, or the side itself. Side 3 f + j is
        opposite corner j of face f.
    flattest : float
        Least cosine between any two normals of the faces on both diagonals. Other edges stay.
    tie : float
        Difference of the sums up to which they are about equal, in radians.
    meanwhile : callable
        Called between two calls of the kernel, at least after every `MOST_WORK` checks.

    Returns
    -------
    (F, 3) int array
    """
    v, f = rows("vertices", vertices), rows("faces", faces)
    address("faces", faces, INT, f, 3)
    if faces.min(initial=0) < 0 or faces.max(initial=-1) >= v:
        raise library.KernelError("faces: an index is out of range")
    address("opposites", opposites, INT, 3 * f)
    flipped, beyond = faces.copy(), opposites.copy()
    valences = np.bincount(faces.ravel(), minlength=v).astype(np.int64)
    mesh = _FlippedMesh(
        v, f, address("vertices", vertices, FLOAT, v, 3), valences.ctypes.data,
        flipped.ctypes.data, beyond.ctypes.data,
    )  # fmt: skip
    rules, scratch = _FlipRules(flattest, tie), np.empty(_ITEMS.result(f))
    ring = np.array([0, 3 * f, 0], dtype=np.int64)
    while ring[1]:
        _FLIP_DIAGONALS(
            mesh, rules, MOST_FLIPS * f, scratch.ctypes.data, len(scratch), library.MOST_WORK,
            ring.ctypes.data,
        )  # fmt: skip
        if ring[1]:
            meanwhile()
    return flipped
