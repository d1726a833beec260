"""Finds contacts between strands of a curve, for the energy term that repels the strands."""

from __future__ import annotations

from typing import NamedTuple

import nicmm_kernels

from ..geometry import tolerances
from ..geometry.array_types import FloatArray, IntArray
from ..geometry.vectors import lengths
from .curve_nodes import Nodes

CLEARANCE = 2.0
"""Distance between strands, in mean distances between nodes, below which they repel."""

DIFFERENT_STRANDS = 4.0
"""Distance along the curve, in clearances, above which two nodes belong to different strands."""

SAME_SIDE = 0.3
"""Cosine between the normals of two nodes above which they may be in contact.

It excludes strands on opposite sides of a thin part.
"""

RULES = nicmm_kernels.ContactRules(CLEARANCE, DIFFERENT_STRANDS, SAME_SIDE, tolerances.ROUNDED)

NEARBY = 2.0
"""Distance, in clearances, within which pairs of nodes are kept for tests after short moves."""


class Contacts(NamedTuple):
    """Pairs of close nodes on different strands.

    Attributes
    ----------
    pairs : (p, 2) int array
        Indices of the two nodes; each pair occurs once.
    overlap : (p,) float array
        1 - distance / clearance.
    derivatives : (p, 2) float array
        Derivatives of the overlap by the moves of the two nodes along their conormals.
    """

    pairs: IntArray
    overlap: FloatArray
    derivatives: FloatArray


def contacts_between(nodes: Nodes) -> Contacts:
    """Pairs of nodes of different strands of a curve that are closer than the clearance."""
    return contacts_of_pairs(nodes, close_pairs(nodes))


def close_pairs(nodes: Nodes, reach: float = 1.0) -> IntArray:
    """Pairs of nodes of a curve, (p, 2), that are close in space but far apart along the curve.

    Nodes are close if their distance is at most `reach`, in clearances.
    """
    return nicmm_kernels.close_pairs(nodes.for_kernels, RULES, reach)


class NearStrands:
    """Pairs of nodes of one curve that may be in contact, updated only after long moves.

    Whether two nodes are far enough apart along the curve is decided only when pairs are updated.

    Parameters
    ----------
    nodes : Nodes
    """

    def __init__(self, nodes: Nodes) -> None:
        self._update(nodes)

    def contacts(self, nodes: Nodes) -> Contacts:
        """Contacts between the same nodes at new positions."""
        moved = float(lengths(nodes.positions.T - self._positions.T).max())
        if 2.0 * moved + _clearance(nodes) > self._reach:
            self._update(nodes)
        return contacts_of_pairs(nodes, self._pairs)

    def _update(self, nodes: Nodes) -> None:
        """Find the pairs that may come into contact by short moves of these nodes."""
        self._positions, self._reach = nodes.positions, NEARBY * _clearance(nodes)
        self._pairs = close_pairs(nodes, NEARBY)


def contacts_of_pairs(nodes: Nodes, pairs: IntArray) -> Contacts:
    """Contacts among given pairs: closer than the clearance, on the same side of the surface."""
    return Contacts(*nicmm_kernels.find_contacts(nodes.for_kernels, RULES, pairs))


def _clearance(nodes: Nodes) -> float:
    """Distance below which the strands of a curve repel."""
    return CLEARANCE * float(nodes.lengths.mean())
