"""Strands of a curve that come close to each other, and the push that keeps them apart."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.spatial import cKDTree

from .. import tolerances
from ..array_types import FloatArray, IntArray
from .curve_nodes import Nodes

CLEARANCE = 2.0
"""Distance between strands, in mean steps, below which they push each other."""

ALONG = 4.0
"""Least distance along the curve between two nodes of different strands, in clearances."""

SAME_SIDE = 0.3
"""Least cosine between two normals; the other side of a thin part is near in space only."""


@dataclass(frozen=True)
class Contacts:
    """Pairs of near nodes, each once for either of the two.

    Attributes
    ----------
    node : (p,) int array
    overlap : (p,) float array
        1 - distance / clearance.
    derivative : (p,) float array
        Of the overlap by the node's sideways move.
    """

    node: IntArray
    overlap: FloatArray
    derivative: FloatArray


def contact_residuals(nodes: Nodes) -> Contacts:
    """Which nodes of different strands are closer than the clearance."""
    clearance = CLEARANCE * float(nodes.lengths.mean())
    first, second = cKDTree(nodes.positions).query_pairs(clearance, output_type="ndarray").T
    arc = np.concatenate([[0.0], np.cumsum(nodes.lengths)])
    along = np.abs(arc[first] - arc[second])
    if nodes.closed:
        along = np.minimum(along, arc[-1] - along)
    cosine = (nodes.normals[first] * nodes.normals[second]).sum(axis=1)
    # Without an orientation of the surface, normals may differ in sign on one side of it too.
    kept = (along > ALONG * clearance) & (cosine > SAME_SIDE)
    first, second = first[kept], second[kept]
    node, other = np.concatenate([first, second]), np.concatenate([second, first])
    offset = nodes.positions[node] - nodes.positions[other]
    distance = np.maximum(np.linalg.norm(offset, axis=1), tolerances.TINY)
    approach = (offset * nodes.sideways[node]).sum(axis=1) / distance
    return Contacts(node, 1.0 - distance / clearance, -approach / clearance)
