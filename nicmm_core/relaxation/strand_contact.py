"""Contact between strands of a curve: where they are close, and the term that repels them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.spatial import cKDTree

from ..geometry import tolerances
from ..geometry.array_types import FloatArray, IntArray
from .curve_nodes import Nodes

CLEARANCE = 2.0
"""Distance between strands, in mean distances between nodes, below which they repel."""

ALONG = 4.0
"""Least distance along the curve between two nodes of different strands, in clearances."""

SAME_SIDE = 0.3
"""Least cosine between two normals; excludes strands on opposite sides of a thin part."""


@dataclass(frozen=True)
class Contacts:
    """Pairs of close nodes of different strands.

    Attributes
    ----------
    pairs : (p, 2) int array
        Each pair once.
    overlap : (p,) float array
        1 - distance / clearance.
    derivatives : (p, 2) float array
        Of the overlap by the two nodes' moves along their conormals.
    """

    pairs: IntArray
    overlap: FloatArray
    derivatives: FloatArray


def contacts_between(nodes: Nodes) -> Contacts:
    """Pairs of nodes of different strands that are closer than the clearance."""
    clearance = CLEARANCE * float(nodes.lengths.mean())
    pairs = cKDTree(nodes.positions).query_pairs(clearance, output_type="ndarray")
    arc = np.concatenate([[0.0], np.cumsum(nodes.lengths)])
    along = np.abs(arc[pairs[:, 0]] - arc[pairs[:, 1]])
    if nodes.closed:
        along = np.minimum(along, arc[-1] - along)
    pairs = pairs[along > ALONG * clearance]
    normals, positions = nodes.normals[pairs], nodes.positions[pairs]
    offset = positions[:, 0] - positions[:, 1]
    distance = np.maximum(np.linalg.norm(offset, axis=1), tolerances.TINY)
    direction = offset / distance[:, None]
    kept = (normals[:, 0] * normals[:, 1]).sum(axis=1) > SAME_SIDE
    pairs, distance, direction = pairs[kept], distance[kept], direction[kept]
    approach = np.einsum("pd,pkd->pk", direction, nodes.conormals[pairs]) * [-1.0, 1.0]
    return Contacts(pairs, 1.0 - distance / clearance, approach / clearance)
