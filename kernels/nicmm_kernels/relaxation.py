# SPDX-License-Identifier: GPL-3.0-or-later
"""Relaxes several curves, each on its own."""

from __future__ import annotations

import ctypes
from collections.abc import Callable

import numpy as np

from . import library, steps
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
    first_fixed,
    optional_address,
    rows_of_curves,
)
from .nodes import SurfaceArrays, SurfacePointers
from .steps import RelaxationRules
from .threads import in_threads


class BatchRules(ctypes.Structure):
    """How several curves are relaxed.

    Parameters
    ----------
    iterations : int
        Greatest number of iterations.
    respacing : int
        Number of iterations from one respacing of the nodes to the next.
    quiet : int
        Number of consecutive quiet iterations after which a curve has converged.
    least_decrease : float
        Relative decrease of the energy up to which an iteration is quiet, if no node has moved by
        more than half of the longest move either.
    """

    _fields_ = [
        ("iterations", COUNT),
        ("respacing", COUNT),
        ("quiet", COUNT),
        ("least_decrease", NUMBER),
    ]


class _CurveBatch(ctypes.Structure):
    _fields_ = [
        ("c", COUNT),
        ("n", COUNT),
        ("closed", COUNT),
        ("faces", POINTER),
        ("barycentric", POINTER),
        ("fixed", POINTER),
        ("corners", POINTER),
        ("iterations", POINTER),
        ("quiet", POINTER),
        ("dampings", POINTER),
    ]


_ITEMS = Kernel("relaxation_items", COUNT, COUNT)
_RELAX = Kernel(
    "relax_curves", SurfacePointers, RelaxationRules, BatchRules, _CurveBatch, COUNT, POINTER,
    COUNT, COUNT,
)  # fmt: skip


def relax_curves(
    surface: SurfaceArrays,
    faces: IntArray,
    barycentric: FloatArray,
    fixed: BoolArray,
    corners: BoolArray | None,
    closed: bool,
    rules: RelaxationRules,
    batch: BatchRules,
    meanwhile: Callable[[], object],
) -> tuple[IntArray, FloatArray]:
    """Relax c curves of n nodes each, on their own and in several threads.

    Parameters
    ----------
    surface : SurfaceArrays
    faces : (c, n) int array
        Faces of the nodes.
    barycentric : (c, n, 3) float array
        Coordinates in them.
    fixed : (c, n) bool array
        Nodes that do not move. The first one of each curve is one of them.
    corners : (c, n) bool array or None
        Those of them at which the curve may turn freely.
    closed : bool
        Whether the last node of each curve is joined to its first.
    rules : RelaxationRules
    batch : BatchRules
    meanwhile : callable
        Called after every `library.MOST_WORK` faces, or the time of as many.

    Returns
    -------
    (c, n) int array, (c, n, 3) float array
        Faces of the relaxed nodes and coordinates in them.
    """
    c, n = rows_of_curves("faces", faces)
    address("faces", faces, INT, c, n)
    address("barycentric", barycentric, FLOAT, c, n, 3)
    first_fixed(fixed, c, n)
    optional_address("corners", corners, BOOL, c, n)
    faces, barycentric = faces.copy(), barycentric.copy()

    def relax(part: slice, meanwhile: Callable[[], object]) -> None:
        count = part.stop - part.start
        iterations, quiet = np.zeros(count, dtype=np.int64), np.zeros(count, dtype=np.int64)
        dampings = np.full(count, rules.steps.least_damping)
        curves = _CurveBatch(
            count, n, int(closed), faces[part].ctypes.data, barycentric[part].ctypes.data,
            fixed[part].ctypes.data, None if corners is None else corners[part].ctypes.data,
            iterations.ctypes.data, quiet.ctypes.data, dampings.ctypes.data,
        )  # fmt: skip
        room, started = steps.PAIRS_OF_A_NODE * n, False
        while (iterations < batch.iterations).any():
            if started:
                meanwhile()
            started = True
            items = _ITEMS.result(n, room)
            scratch = np.empty(items)
            code = _RELAX.result(
                surface.pointers,
                rules,
                batch,
                curves,
                room,
                scratch.ctypes.data,
                items,
                library.MOST_WORK,
            )
            if code == library.TOO_SMALL and room < n * n:
                room = steps.more_room(room, n)
            else:
                _RELAX.check(code)

    in_threads(relax, c, meanwhile)
    return faces, barycentric
