# SPDX-License-Identifier: GPL-3.0-or-later
"""Relaxes several curves, each on its own."""

from __future__ import annotations

import ctypes
from collections.abc import Callable

import numpy as np

from . import energy, library
from .energy import ContactRules, EnergyRules
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
    first_fixed,
    rows_of_curves,
)
from .nodes import SpacingRules, SurfaceArrays, SurfacePointers
from .traces import TraceLimits


class StepRules(ctypes.Structure):
    """How many steps are taken, and how far they go.

    Lengths are in mean distances between neighbouring nodes.

    Parameters
    ----------
    iterations : int
        Greatest number of steps.
    respacing : int
        Number of steps from one respacing of the nodes to the next.
    quiet : int
        Number of consecutive quiet steps after which a curve has converged.
    least_decrease : float
        Relative decrease of the energy up to which a step counts as quiet, if no node has moved by
        more than half of `longest_move` either.
    longest_move : float
        Trust radius of the linearised energy.
    least_damping, most_damping : float
        Damping of the first step and its lower bound, and the damping above which a curve stays.
    damping_factor : float
        Factor by which damping rises after a failed step and falls after a successful one.
    shortest : float
        Least length of a step by which the tension is divided, in mesh units.
    """

    _fields_ = [
        ("iterations", COUNT),
        ("respacing", COUNT),
        ("quiet", COUNT),
        ("least_decrease", NUMBER),
        ("longest_move", NUMBER),
        ("least_damping", NUMBER),
        ("most_damping", NUMBER),
        ("damping_factor", NUMBER),
        ("shortest", NUMBER),
    ]


class RelaxationRules(ctypes.Structure):
    """All rules of a relaxation.

    Parameters
    ----------
    traces : TraceLimits
    contact : ContactRules
    spacing : SpacingRules
    energy : EnergyRules
    steps : StepRules
    """

    _fields_ = [
        ("traces", TraceLimits),
        ("contact", ContactRules),
        ("spacing", SpacingRules),
        ("energy", EnergyRules),
        ("steps", StepRules),
    ]


class _CurveBatch(ctypes.Structure):
    _fields_ = [
        ("c", COUNT),
        ("n", COUNT),
        ("closed", COUNT),
        ("faces", POINTER),
        ("barycentric", POINTER),
        ("fixed", POINTER),
        ("iterations", POINTER),
        ("quiet", POINTER),
        ("dampings", POINTER),
    ]


_ITEMS = Kernel("relaxation_items", COUNT, COUNT)
_RELAX = Kernel(
    "relax_curves", SurfacePointers, RelaxationRules, _CurveBatch, COUNT, POINTER, COUNT, COUNT
)


def relax_curves(
    surface: SurfaceArrays,
    faces: IntArray,
    barycentric: FloatArray,
    fixed: BoolArray,
    closed: bool,
    rules: RelaxationRules,
    meanwhile: Callable[[], object],
) -> tuple[IntArray, FloatArray]:
    """Relax c curves of n nodes each; every curve is relaxed on its own.

    Parameters
    ----------
    surface : SurfaceArrays
    faces : (c, n) int array
        Faces of the nodes.
    barycentric : (c, n, 3) float array
        Coordinates in them.
    fixed : (c, n) bool array
        Nodes that do not move. The first one of each curve is one of them.
    closed : bool
        Whether the last node of each curve is joined to its first.
    rules : RelaxationRules
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
    of_fixed = first_fixed(fixed, c, n)
    faces, barycentric = faces.copy(), barycentric.copy()
    iterations, quiet = np.zeros(c, dtype=np.int64), np.zeros(c, dtype=np.int64)
    dampings = np.full(c, rules.steps.least_damping)
    curves = _CurveBatch(
        c, n, int(closed), faces.ctypes.data, barycentric.ctypes.data, of_fixed,
        iterations.ctypes.data, quiet.ctypes.data, dampings.ctypes.data,
    )  # fmt: skip
    room, started = energy.PAIRS_OF_A_NODE * n, False
    while (iterations < rules.steps.iterations).any():
        if started:
            meanwhile()
        started = True
        items = _ITEMS.result(n, room)
        scratch = np.empty(items)
        code = _RELAX.result(
            surface.pointers, rules, curves, room, scratch.ctypes.data, items, library.MOST_WORK
        )
        if code == library.TOO_SMALL and room < n * n:
            room = energy.more_room(room, n)
        else:
            _RELAX.check(code)
    return faces, barycentric
