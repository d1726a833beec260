# SPDX-License-Identifier: GPL-3.0-or-later
"""The energy of a curve, contacts of its strands, and steps that lower the energy."""

from __future__ import annotations

import ctypes
from collections.abc import Callable

import numpy as np

from . import library
from .library import (
    BOOL,
    COUNT,
    FLOAT,
    NUMBER,
    POINTER,
    BoolArray,
    FloatArray,
    IntArray,
    Kernel,
    address,
    rows,
)
from .nodes import NodeArrays, NodePointers, SpacingRules, SurfaceArrays, SurfacePointers
from .traces import TraceLimits


class ContactRules(ctypes.Structure):
    """When two nodes of a curve are in contact.

    Parameters
    ----------
    clearance : float
        Distance below which strands repel, in mean distances between neighbouring nodes.
    different_strands : float
        Distance along the curve, in clearances, above which nodes belong to different strands.
    same_side : float
        Least cosine between the normals of two nodes in contact.
    rounded : float
        Least mean distance between neighbouring nodes, relative to the greatest coordinate.
    nearby : float
        Distance, in clearances, up to which pairs are kept for contacts after short moves; they are
        sought again after longer ones. With 1, the same pairs are kept after all moves.
    """

    _fields_ = [
        ("clearance", NUMBER),
        ("different_strands", NUMBER),
        ("same_side", NUMBER),
        ("rounded", NUMBER),
        ("nearby", NUMBER),
    ]


class EnergyRules(ctypes.Structure):
    """How the terms of the energy are balanced.

    Parameters
    ----------
    smoothness : float
        Divisor of the tension and of the weight of a map.
    tautness : float
        Factor of the tension, but not of the weight of a map.
    over_tension : float
        Multiple of the tension that is added to the weight of a map.
    contact : float
        Contact energy of a curve whose strands touch everywhere, relative to its energy without
        maps; 0 if strands may cross.
    """

    _fields_ = [
        ("smoothness", NUMBER),
        ("tautness", NUMBER),
        ("over_tension", NUMBER),
        ("contact", NUMBER),
    ]


class StepRules(ctypes.Structure):
    """How many steps are taken in an iteration, and how far they go.

    Lengths are in mean distances between neighbouring nodes.

    Parameters
    ----------
    steps : int
        Greatest number of steps that lower the energy.
    tries : int
        Greatest number of trial steps until one of them does.
    doubles : bool
        Whether a step is doubled if the energy falls far.
    longest_move : float
        Trust radius of the linearised energy.
    least_damping, most_damping : float
        Lower bound of the damping, and the damping above which no step is tried.
    damping_factor : float
        Factor by which damping rises after a failed step and falls after a successful one.
    shortest : float
        Least length of a step by which the tension is divided, in mesh units.
    """

    _fields_ = [
        ("steps", COUNT),
        ("tries", COUNT),
        ("doubles", COUNT),
        ("longest_move", NUMBER),
        ("least_damping", NUMBER),
        ("most_damping", NUMBER),
        ("damping_factor", NUMBER),
        ("shortest", NUMBER),
    ]


class RelaxationRules(ctypes.Structure):
    """The rules of every relaxation.

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


class _Contacts(ctypes.Structure):
    _fields_ = [
        ("room", COUNT),
        ("pair_count", COUNT),
        ("pairs", POINTER),
        ("count", COUNT),
        ("ends", POINTER),
        ("overlaps", POINTER),
        ("approaches", POINTER),
        ("reach", NUMBER),
        ("positions", POINTER),
        ("arcs", POINTER),
    ]


class _Weights(ctypes.Structure):
    _fields_ = [
        ("tension", NUMBER),
        ("contact", NUMBER),
        ("feature", NUMBER),
        ("normal_bending", NUMBER),
        ("frozen_ds", POINTER),
    ]


class _System(ctypes.Structure):
    _fields_ = [("bands", POINTER), ("slope", POINTER)]


_FIND_CONTACTS = Kernel("find_contacts", NodePointers, ContactRules, _Contacts)
_LINEARISATION_ITEMS = Kernel("linearisation_items", COUNT, COUNT)
_LINEARISE = Kernel(
    "linearise_curve", SurfacePointers, NodePointers, RelaxationRules, COUNT, POINTER, COUNT,
    POINTER, _Weights, ctypes.POINTER(NUMBER), _System,
)  # fmt: skip
_CONORMAL_DERIVATIVES = Kernel(
    "conormal_derivatives", SurfacePointers, NodePointers, POINTER, POINTER
)
_STEP_ITEMS = Kernel("step_items", COUNT)
_STEP = Kernel(
    "step_of_curve", _System, COUNT, POINTER, NUMBER, POINTER, COUNT, POINTER,
    ctypes.POINTER(NUMBER),
)  # fmt: skip

PAIRS_OF_A_NODE = 8
"""Number of close nodes for which there is room at first; there is more room when it is needed."""


def more_room(room: int, n: int) -> int:
    """Room for more pairs of n nodes."""
    return min(max(4 * room, n), n * n)


def with_room_for_pairs(kernel: Kernel, n: int, call: Callable[[int], int]) -> None:
    """Call a kernel by a function of the room for pairs of n nodes, with more room if needed."""
    room = PAIRS_OF_A_NODE * n
    while (code := call(room)) == library.TOO_SMALL and room < n * n:
        room = more_room(room, n)
    kernel.check(code)


def find_contacts(
    nodes: NodeArrays, rules: ContactRules, before: NodeArrays | None = None
) -> tuple[IntArray, FloatArray, FloatArray]:
    """Contacts between the strands of a curve.

    Parameters
    ----------
    nodes : NodeArrays
    rules : ContactRules
    before : NodeArrays, optional
        The same nodes at other places, where pairs that may come into contact are found first.

    Returns
    -------
    (q, 2) int array
        Pairs of nodes in contact.
    (q,) float array
        1 - distance / clearance.
    (q, 2) float array
        Derivatives of this overlap by the moves of both nodes along their conormals.
    """
    n = nodes.count
    if before is not None and before.count != n:
        raise library.KernelError(f"before has {before.count} nodes; pass {n}")
    found: list[tuple[IntArray, FloatArray, FloatArray]] = []

    def call(room: int) -> int:
        pairs, ends = np.empty((2, room, 2), dtype=np.int64)
        overlaps, approaches = np.empty(room), np.empty((room, 2))
        positions, arcs = np.empty((n, 3)), np.empty(n)
        contacts = _Contacts(
            room, 0, pairs.ctypes.data, 0, ends.ctypes.data, overlaps.ctypes.data,
            approaches.ctypes.data, -1.0, positions.ctypes.data, arcs.ctypes.data,
        )  # fmt: skip
        for each in (nodes,) if before is None else (before, nodes):
            code: int = _FIND_CONTACTS.result(each.one(), rules, contacts)
            if code:
                return code
        q = contacts.count
        found.append((ends[:q].copy(), overlaps[:q].copy(), approaches[:q].copy()))
        return code

    with_room_for_pairs(_FIND_CONTACTS, n, call)
    return found[0]


class Linearised:
    """Energy of a curve, and half its derivatives by moves of the nodes along their conormals.

    Attributes
    ----------
    tension, contact, feature, normal_bending : float
        Weights of the terms.
    frozen_ds : (n,) float array or None
        ds at each node, held constant in the term of lanes; None without a map.
    energy : float
    bands : (3, n) float array
        The matrix: entries (i, i), (i, i + 1) and (i, i + 2), modulo n.
    slope : (n,) float array
        The first derivatives.
    """

    def __init__(self, surface: SurfaceArrays, nodes: NodeArrays, rules: RelaxationRules) -> None:
        n, weights, energy = nodes.count, _Weights(), NUMBER(0.0)
        has_map = surface.pointers.feature_map is not None
        frozen_ds = np.empty(n)
        self.bands, self.slope = np.empty((3, n)), np.empty(n)
        system = _System(self.bands.ctypes.data, self.slope.ctypes.data)

        def call(room: int) -> int:
            items = _LINEARISATION_ITEMS.result(n, room)
            scratch = np.empty(items)
            code: int = _LINEARISE.result(
                surface.pointers, nodes.one(), rules, room, scratch.ctypes.data, items,
                frozen_ds.ctypes.data, weights, energy, system,
            )  # fmt: skip
            return code

        with_room_for_pairs(_LINEARISE, n, call)
        self.tension, self.contact = weights.tension, weights.contact
        self.feature, self.normal_bending = weights.feature, weights.normal_bending
        self.energy = energy.value
        self.frozen_ds = frozen_ds if has_map else None


def conormal_derivatives(
    surface: SurfaceArrays, nodes: NodeArrays
) -> tuple[FloatArray, FloatArray]:
    """Derivatives of the normals, (n, 3), and of φ_fea, (n,), by moves along the conormals."""
    turns, drifts = np.empty((nodes.count, 3)), np.empty(nodes.count)
    pointers = nodes.one()
    _CONORMAL_DERIVATIVES(surface.pointers, pointers, turns.ctypes.data, drifts.ctypes.data)
    return turns, drifts


def damped_step(
    bands: FloatArray, slope: FloatArray, fixed: BoolArray, damping: float
) -> tuple[FloatArray, float]:
    """Moves of the nodes of a curve that lower the linearised energy.

    Parameters
    ----------
    bands, slope : float arrays
        A system, see `Linearised`.
    fixed : (n,) bool array
        Nodes that do not move.
    damping : float
        Added to the diagonal of the matrix, relative to its greatest entry of a free node.

    Returns
    -------
    (n,) float array
        Moves along the conormals.
    float
        The decrease of the linearised energy.
    """
    n = rows("slope", slope)
    system = _System(address("bands", bands, FLOAT, 3, n), address("slope", slope, FLOAT, n))
    moves, scratch, decrease = np.empty(n), np.empty(_STEP_ITEMS.result(n)), NUMBER(0.0)
    _STEP(
        system, n, address("fixed", fixed, BOOL, n), damping, scratch.ctypes.data, len(scratch),
        moves.ctypes.data, decrease,
    )  # fmt: skip
    return moves, decrease.value
