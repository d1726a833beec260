"""Finds contacts between strands of a curve, for the energy term that repels the strands."""

from __future__ import annotations

from dataclasses import dataclass

import nicmm_kernels
import numpy as np
from scipy.spatial import cKDTree

from ..geometry import tolerances
from ..geometry.array_types import FloatArray, IntArray
from ..geometry.vectors import dot, lengths
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


@dataclass(frozen=True)
class Contacts:
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
    lengths = nodes.by_curve(nodes.step_lengths)
    total = lengths.sum(axis=1)
    clearance = nodes.spread(_clearances(nodes))
    places = nodes.positions / clearance[:, None]
    if nodes.curves > 1:
        # An additional coordinate keeps different curves apart.
        curve = nodes.spread(2.0 * reach * np.arange(nodes.curves))
        places = np.concatenate([places, curve[:, None]], axis=1)
    tree = cKDTree(places, balanced_tree=False, compact_nodes=False)
    pairs = tree.query_pairs(reach, output_type="ndarray")
    arc = (np.cumsum(lengths, axis=1) - lengths).ravel()
    along = np.abs(arc[pairs[:, 0]] - arc[pairs[:, 1]])
    if nodes.closed:
        along = np.minimum(along, nodes.spread(total)[pairs[:, 0]] - along)
    return pairs[along > DIFFERENT_STRANDS * clearance[pairs[:, 0]]]


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
        if 2.0 * moved + _clearances(nodes)[0] > self._reach:
            self._update(nodes)
        return contacts_of_pairs(nodes, self._pairs)

    def _update(self, nodes: Nodes) -> None:
        """Find the pairs that may come into contact by short moves of these nodes."""
        self._positions, self._reach = nodes.positions, NEARBY * _clearances(nodes)[0]
        self._pairs = close_pairs(nodes, NEARBY)


def contacts_of_pairs(nodes: Nodes, pairs: IntArray) -> Contacts:
    """Contacts among given pairs: closer than the clearance, on the same side of the surface."""
    ends, size = pairs.T, nodes.per_curve
    clearance = _clearances(nodes).take(ends[0] // size)
    one, other = (nodes.positions.take(end, axis=0).T for end in ends)
    distance = np.maximum(lengths(one - other), tolerances.TINY)
    close = np.flatnonzero(distance < clearance)
    pairs, ends, offset = pairs[close], ends[:, close], (one - other)[:, close]
    distance, clearance = distance[close], clearance[close]
    facing = dot(*(nodes.normals.take(end, axis=0).T for end in ends)) > SAME_SIDE
    pairs, distance, clearance = pairs[facing], distance[facing], clearance[facing]
    away, towards = (
        dot(offset[:, facing], nodes.conormals.take(end[facing], axis=0).T) for end in ends
    )
    approach = np.array([-away, towards]) / (distance * clearance)
    return Contacts(pairs, 1.0 - distance / clearance, approach.T)


def _clearances(nodes: Nodes) -> FloatArray:
    """The clearance of each curve, (c,)."""
    lengths = nodes.by_curve(nodes.step_lengths)
    steps = len(nodes.lengths) if nodes.curves == 1 else lengths.shape[1]
    # The clearance is positive even if the curve has no length.
    least = max(tolerances.TINY, tolerances.ROUNDED * float(np.abs(nodes.positions).max()))
    return CLEARANCE * np.maximum(lengths.sum(axis=1) / steps, least)
