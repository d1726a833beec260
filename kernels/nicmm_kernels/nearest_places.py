# SPDX-License-Identifier: GPL-3.0-or-later
"""The places of some faces that are nearest to positions."""

from __future__ import annotations

import ctypes
from collections.abc import Callable

import numpy as np

from . import library
from .library import COUNT, FLOAT, INT, POINTER, FloatArray, IntArray, Kernel, address, rows
from .traces import MeshArrays, MeshPointers


class _GroupedPositions(ctypes.Structure):
    _fields_ = [
        ("n", COUNT),
        ("g", COUNT),
        ("q", COUNT),
        ("positions", POINTER),
        ("groups", POINTER),
        ("begins", POINTER),
        ("faces", POINTER),
    ]


_NEAREST_PLACES = Kernel(
    "nearest_places", MeshPointers, _GroupedPositions, COUNT, ctypes.POINTER(COUNT),
    *[POINTER] * 2,
)  # fmt: skip


def nearest_places(
    mesh: MeshArrays,
    positions: FloatArray,
    groups: IntArray,
    begins: IntArray,
    faces: IntArray,
    meanwhile: Callable[[], object],
) -> tuple[IntArray, FloatArray]:
    """Find the place nearest to each position among the faces of its group.

    Parameters
    ----------
    mesh : MeshArrays
    positions : (n, 3) float array
    groups : (n,) int array
        Group of each position.
    begins : (g + 1,) int array
        Where the faces of each group begin, and where those of the last one end. Every group has a
        face.
    faces : (q,) int array
        Faces of all groups. Of several nearest places, that of the first face is found.
    meanwhile : callable
        Called between two calls of the kernel, at least after every `MOST_WORK` faces.

    Returns
    -------
    (n,) int array
        Face of each place.
    (n, 3) float array
        Barycentric coordinates.
    """
    n, ends, q = rows("positions", positions), rows("begins", begins), rows("faces", faces)
    if not ends:
        raise library.KernelError("begins is empty; pass where each group begins, and the end")
    given = _GroupedPositions(
        n, ends - 1, q,
        address("positions", positions, FLOAT, n, 3), address("groups", groups, INT, n),
        address("begins", begins, INT, ends), address("faces", faces, INT, q),
    )  # fmt: skip
    found, barycentric, done = np.empty(n, dtype=np.int64), np.empty((n, 3)), COUNT(0)
    while done.value < n:
        if done.value:
            meanwhile()
        _NEAREST_PLACES(
            mesh.pointers, given, library.MOST_WORK, done, found.ctypes.data,
            barycentric.ctypes.data,
        )  # fmt: skip
    return found, barycentric
