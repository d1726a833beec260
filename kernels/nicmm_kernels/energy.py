# SPDX-License-Identifier: GPL-3.0-or-later
"""Contacts, the energy of a curve, and steps that lower it."""

from __future__ import annotations

import ctypes

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
from .nodes import NodeArrays, NodePointers, SurfaceArrays, SurfacePointers


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
    """

    _fields_ = [
        ("clearance", NUMBER),
        ("different_strands", NUMBER),
        ("same_side", NUMBER),
        ("rounded", NUMBER),
    ]


class ContactPointers(ctypes.Structure):
    """Contacts as the library reads and writes them."""

    _fields_ = [
        ("room", COUNT),
        ("pair_count", COUNT),
        ("pairs", POINTER),
        ("count", COUNT),
        ("ends", POINTER),
        ("overlaps", POINTER),
        ("approaches", POINTER),
    ]


_FIND_CLOSE_PAIRS = Kernel(
    "find_close_pairs", NodePointers, ContactRules, NUMBER, POINTER, ContactPointers
)
_FIND_CONTACTS = Kernel("find_contacts", NodePointers, ContactRules, ContactPointers)

PAIRS_OF_A_NODE = 8
"""Number of close nodes for which there is room at first; there is more room when it is needed."""


def more_room(room: int, n: int) -> int:
    """Room for more pairs of n nodes."""
    return min(max(4 * room, n), n * n)


def close_pairs(nodes: NodeArrays, rules: ContactRules, reach: float) -> IntArray:
    """Pairs of nodes of a curve, (p, 2), that are close in space but far apart along the curve.

    Parameters
    ----------
    nodes : NodeArrays
    rules : ContactRules
    reach : float
        Distance up to which nodes are close, in clearances.
    """
    n, pointers = nodes.count, nodes.one()
    arcs, room = np.empty(n), PAIRS_OF_A_NODE * n
    while True:
        pairs = np.empty((room, 2), dtype=np.int64)
        found = ContactPointers(room, 0, pairs.ctypes.data)
        code = _FIND_CLOSE_PAIRS.result(pointers, rules, reach, arcs.ctypes.data, found)
        if code != library.TOO_SMALL or room >= n * n:
            _FIND_CLOSE_PAIRS.check(code)
            return pairs[: found.pair_count].copy()
        room = more_room(room, n)


def find_contacts(
    nodes: NodeArrays, rules: ContactRules, pairs: IntArray
) -> tuple[IntArray, FloatArray, FloatArray]:
    """Contacts among pairs of nodes of a curve: closer than the clearance, on one side.

    Parameters
    ----------
    nodes : NodeArrays
    rules : ContactRules
    pairs : (p, 2) int array

    Returns
    -------
    (q, 2) int array
        The pairs in contact.
    (q,) float array
        1 - distance / clearance.
    (q, 2) float array
        Derivatives of this overlap by the moves of both nodes along their conormals.
    """
    p = rows("pairs", pairs)
    ends, overlaps = np.empty((p, 2), dtype=np.int64), np.empty(p)
    approaches = np.empty((p, 2))
    found = ContactPointers(
        p, p, address("pairs", pairs, INT, p, 2), 0, ends.ctypes.data, overlaps.ctypes.data,
        approaches.ctypes.data,
    )  # fmt: skip
    _FIND_CONTACTS(nodes.one(), rules, found)
    q = found.count
    return ends[:q], overlaps[:q], approaches[:q]


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


class WeightPointers(ctypes.Structure):
    """Weights of the energy terms as the library reads them."""

    _fields_ = [
        ("tension", NUMBER),
        ("contact", NUMBER),
        ("feature", NUMBER),
        ("held_ds", POINTER),
    ]


class Weights:
    """Weights of the energy terms of one curve.

    Parameters
    ----------
    tension : float
        In 1/length².
    contact : float
        In 1/length.
    feature : float
        Of the map, in 1/length²; 0 without a map.
    held : (n,) float array or None
        ds at each node, held constant in the term of lanes; None without a map.
    """

    def __init__(
        self, tension: float, contact: float, feature: float, held: FloatArray | None
    ) -> None:
        self._numbers, self._held = (tension, contact, feature), held

    def pointers(self, n: int) -> WeightPointers:
        """The weights of a curve of n nodes as the library reads them."""
        return WeightPointers(*self._numbers, optional_address("held", self._held, FLOAT, n))


Contacts = tuple[IntArray, FloatArray, FloatArray]
"""Contacts as `find_contacts` returns them."""


def _contact_pointers(contacts: Contacts | None) -> ContactPointers | None:
    if contacts is None:
        return None
    ends, overlaps, approaches = contacts
    q = rows("pairs", ends)
    return ContactPointers(
        q, 0, None, q, address("pairs", ends, INT, q, 2), address("overlap", overlaps, FLOAT, q),
        address("derivatives", approaches, FLOAT, q, 2),
    )  # fmt: skip


class _System(ctypes.Structure):
    _fields_ = [("bands", POINTER), ("slope", POINTER)]


class _PairedSystem(ctypes.Structure):
    _fields_ = [
        ("n", COUNT),
        ("system", _System),
        ("pair_count", COUNT),
        ("pairs", POINTER),
        ("pair_entries", POINTER),
    ]


_ENERGY = Kernel(
    "energy_of_curve", NodePointers, WeightPointers, ContactPointers, ctypes.POINTER(NUMBER)
)
_BALANCE = Kernel(
    "balance_of_curve", SurfacePointers, NodePointers, EnergyRules, POINTER, WeightPointers
)
_SYSTEM_ITEMS = Kernel("system_items", COUNT)
_SYSTEM = Kernel(
    "system_of_curve", SurfacePointers, NodePointers, WeightPointers, NUMBER, ContactPointers,
    POINTER, COUNT, _System, POINTER,
)  # fmt: skip
_CONORMAL_DERIVATIVES = Kernel(
    "conormal_derivatives", SurfacePointers, NodePointers, POINTER, POINTER
)
_STEP_ITEMS = Kernel("step_items", COUNT, COUNT)
_STEP = Kernel("step_of_curve", _PairedSystem, POINTER, NUMBER, POINTER, COUNT, POINTER)
_PREDICTED_DECREASE = Kernel("predicted_decrease", _PairedSystem, POINTER, ctypes.POINTER(NUMBER))


def balance(
    surface: SurfaceArrays, nodes: NodeArrays, rules: EnergyRules
) -> tuple[float, float, float, FloatArray | None]:
    """The weights of a curve at its present nodes; see `Weights`."""
    has_map = surface.pointers.feature_map is not None
    held, weights = np.empty(nodes.count if has_map else 0), WeightPointers()
    _BALANCE(surface.pointers, nodes.one(), rules, held.ctypes.data, weights)
    return weights.tension, weights.contact, weights.feature, held if has_map else None


def elastic_energy(nodes: NodeArrays, weights: Weights, contacts: Contacts | None) -> float:
    """Energy of a curve, with contacts unless strands may cross."""
    energy = NUMBER(0.0)
    weighted = weights.pointers(nodes.count)
    _ENERGY(nodes.one(), weighted, _contact_pointers(contacts), energy)
    return energy.value


def elastic_system(
    surface: SurfaceArrays,
    nodes: NodeArrays,
    weights: Weights,
    shortest: float,
    contacts: Contacts | None,
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """The Gauss–Newton system of a curve: half the derivatives by moves along the conormals.

    Parameters
    ----------
    surface : SurfaceArrays
    nodes : NodeArrays
    weights : Weights
    shortest : float
        Least length of a step by which the tension is divided, in mesh units.
    contacts : Contacts or None

    Returns
    -------
    (3, n) float array
        The matrix without contact: entries (i, i), (i, i + 1) and (i, i + 2), modulo n.
    (n,) float array
        Half the first derivatives, with contact.
    (3, q) float array
        Contributions of the contacts to the entries (i, i), (i, j) and (j, j) of their nodes.
    """
    n, items = nodes.count, _SYSTEM_ITEMS.result(nodes.count)
    bands, slope, scratch = np.empty((3, n)), np.empty(n), np.empty(items)
    entries = np.empty((3, 0 if contacts is None else len(contacts[0])))
    _SYSTEM(
        surface.pointers, nodes.one(), weights.pointers(n), shortest, _contact_pointers(contacts),
        scratch.ctypes.data, items, _System(bands.ctypes.data, slope.ctypes.data),
        entries.ctypes.data,
    )  # fmt: skip
    return bands, slope, entries


def conormal_derivatives(
    surface: SurfaceArrays, nodes: NodeArrays
) -> tuple[FloatArray, FloatArray]:
    """Derivatives of the normals, (n, 3), and of φ_fea, (n,), by moves along the conormals."""
    turns, drifts = np.empty((nodes.count, 3)), np.empty(nodes.count)
    pointers = nodes.one()
    _CONORMAL_DERIVATIVES(surface.pointers, pointers, turns.ctypes.data, drifts.ctypes.data)
    return turns, drifts


def _paired(
    bands: FloatArray, slope: FloatArray, pairs: IntArray, entries: FloatArray
) -> _PairedSystem:
    n, p = rows("slope", slope), rows("pairs", pairs)
    system = _System(address("bands", bands, FLOAT, 3, n), address("slope", slope, FLOAT, n))
    return _PairedSystem(
        n, system, p, address("pairs", pairs, INT, p, 2),
        address("pair_entries", entries, FLOAT, 3, p),
    )  # fmt: skip


def damped_step(
    bands: FloatArray,
    slope: FloatArray,
    pairs: IntArray,
    entries: FloatArray,
    fixed: BoolArray,
    damping: float,
) -> FloatArray:
    """Moves of the nodes of a curve, (n,), that lower the linearised energy.

    Parameters
    ----------
    bands, slope, entries : float arrays
        A system as `elastic_system` returns it.
    pairs : (q, 2) int array
        The nodes of its contacts.
    fixed : (n,) bool array
        Nodes that do not move.
    damping : float
        Added to the diagonal of the matrix, relative to its greatest entry of a free node.
    """
    system = _paired(bands, slope, pairs, entries)
    n, p = system.n, system.pair_count
    moves, items = np.empty(n), _STEP_ITEMS.result(n, p)
    of_fixed = address("fixed", fixed, BOOL, n)
    while True:
        scratch = np.empty(items)
        code = _STEP.result(
            system, of_fixed, damping, scratch.ctypes.data, items, moves.ctypes.data
        )
        if code != library.TOO_SMALL or items > 40 * (n + 1) ** 2:
            _STEP.check(code)
            return moves
        items *= 4


def predicted_decrease(
    bands: FloatArray,
    slope: FloatArray,
    pairs: IntArray,
    entries: FloatArray,
    moves: FloatArray,
) -> float:
    """Decrease of the linearised energy by moves along the conormals, (n,); see `damped_step`."""
    system, decrease = _paired(bands, slope, pairs, entries), NUMBER(0.0)
    _PREDICTED_DECREASE(system, address("moves", moves, FLOAT, system.n), decrease)
    return decrease.value
