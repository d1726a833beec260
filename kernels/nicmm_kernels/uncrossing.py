# SPDX-License-Identifier: GPL-3.0-or-later
"""Removes self-crossings of curves by joining their nodes in another order."""

from __future__ import annotations

import ctypes
from collections.abc import Callable

import numpy as np

from . import library
from .library import BOOL, COUNT, INT, NUMBER, POINTER, BoolArray, IntArray, Kernel, address, rows
from .node_traces import NodePlaces, Places, StepLimits, node_places
from .nodes import NodeArrays, NodePointers, SurfaceArrays, SurfacePointers
from .threads import in_threads

POINTS_OF_A_NODE = 8
"""Number of points of traces for which there is room for each node; more if that is too few."""


class UncrossingRules(ctypes.Structure):
    """How crossings are removed.

    Parameters
    ----------
    rounds : int
        Rounds in which crossings are removed; steps between nodes in a new order may cross again.
    most_crossings : int
        Number of crossings above which a curve is left unchanged.
    any_order : int
        Whether control points may be visited in another order.
    touching : float
        Distance in barycentric coordinates up to which segments touch.
    """

    _fields_ = [
        ("rounds", COUNT),
        ("most_crossings", COUNT),
        ("any_order", COUNT),
        ("touching", NUMBER),
    ]


class _CrossingCurves(ctypes.Structure):
    _fields_ = [
        ("c", COUNT),
        ("n", COUNT),
        ("control", POINTER),
        ("order", POINTER),
        ("simple", POINTER),
    ]


_REORDERED_ITEMS = Kernel("reordered_items", COUNT, COUNT)
_REORDERED = Kernel(
    "reordered_nodes", COUNT, COUNT, POINTER, POINTER, COUNT, COUNT, POINTER, COUNT, POINTER
)
_ITEMS = Kernel("uncrossing_items", COUNT, COUNT, COUNT)
_REMOVE = Kernel(
    "remove_crossings", SurfacePointers, NodePlaces, NodePointers, UncrossingRules,
    _CrossingCurves, COUNT, POINTER, COUNT, COUNT, ctypes.POINTER(COUNT),
)  # fmt: skip


def reordered(crossings: IntArray, control: BoolArray, closed: bool, any_order: bool) -> IntArray:
    """The order of the n nodes of one curve after some crossings have been removed, (n,).

    Parameters
    ----------
    crossings : (p, 2) int array
        Pairs of nodes whose steps to the next nodes cross.
    control : (n,) bool array
        Which nodes are control points; the first node always is.
    closed : bool
    any_order : bool
        Whether control points may be visited in another order.
    """
    n, p = rows("control", control), rows("crossings", crossings)
    order, scratch = np.empty(n, dtype=np.int64), np.empty(_REORDERED_ITEMS.result(n, p))
    _REORDERED(
        n, p, address("crossings", crossings, INT, p, 2), address("control", control, BOOL, n),
        int(closed), int(any_order), scratch.ctypes.data, len(scratch), order.ctypes.data,
    )  # fmt: skip
    return order


def remove_crossings(
    surface: SurfaceArrays,
    nodes: NodeArrays,
    places: Places,
    limits: StepLimits,
    control: BoolArray,
    rules: UncrossingRules,
    meanwhile: Callable[[], object],
) -> tuple[IntArray, BoolArray]:
    """Remove crossings of c curves of n nodes each, in several threads.

    Parameters
    ----------
    surface : SurfaceArrays
    nodes : NodeArrays
    places : tuple of (c n,) int array and (c n, 3) float array
        Faces of all nodes and positive coordinates in them.
    limits : StepLimits
    control : (c, n) bool array
        Which nodes are control points; the first node of each curve is one.
    rules : UncrossingRules
    meanwhile : callable
        Called between two calls of the kernel, at least after every `MOST_WORK` faces.

    Returns
    -------
    (c, n) int array
        The new order of the nodes of each curve.
    (c,) bool array
        Which curves do not cross themselves. Steps whose trace fails are not tested.
    """
    c, placed = nodes.curves, node_places(places, nodes.count, limits)
    n = nodes.count // c
    address("control", control, BOOL, c, n)
    order, simple = np.empty((c, n), dtype=np.int64), np.empty(c, dtype=bool)

    def remove(part: slice, meanwhile: Callable[[], object]) -> None:
        curves = _CrossingCurves(
            part.stop, n, control.ctypes.data, order.ctypes.data, simple.ctypes.data
        )
        done, room = COUNT(part.start), POINTS_OF_A_NODE * n + limits.most_faces + 2
        while done.value < part.stop:
            if done.value > part.start:
                meanwhile()
            scratch = np.empty(_ITEMS.result(n, room, rules.most_crossings))
            code = _REMOVE.result(
                surface.pointers, placed, nodes.pointers, rules, curves, room,
                scratch.ctypes.data, len(scratch), library.MOST_WORK, done,
            )  # fmt: skip
            if code == library.TOO_SMALL and room < n * (limits.most_faces + 2):
                room *= 2
            else:
                _REMOVE.check(code)

    in_threads(remove, c, meanwhile)
    return order, simple
