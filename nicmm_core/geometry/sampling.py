"""Vertices about evenly spread over a surface."""

from __future__ import annotations

import numpy as np
from scipy import sparse
from scipy.spatial import cKDTree

from ..progress import checkpoint
from .array_types import FloatArray, IntArray
from .mesh import Mesh

CANDIDATES = 8
"""Candidate vertices per seed."""

PACKING = 0.84
"""Least distance between two seeds, relative to the square root of the area per seed."""

NORMAL_WEIGHT = 0.6
"""Weight of the difference of two unit normals in the distance, in least distances of seeds.

Opposite normals differ by 2, which counts as more than the least distance; so the two sides of a
plate or of a thin limb get separate seeds.
"""


def spread_vertices(
    mesh: Mesh,
    normals: FloatArray,
    areas: FloatArray,
    chance: FloatArray,
    n_candidates: int,
    distance: float,
    normal_weight: float = NORMAL_WEIGHT,
) -> IntArray:
    """Vertices at least a distance apart, ascending; ``chance`` is a number in (0, 1) for each."""
    there = np.flatnonzero(areas > 0.0)
    # The smallest exponential times: a sample weighted by area, without replacement.
    times = -np.log(chance[there]) / areas[there]
    checkpoint()
    candidates = there[np.argsort(times)[:n_candidates]]
    scaled = np.concatenate(
        [mesh.vertices[candidates] / distance, normal_weight * normals[candidates]], axis=1
    )
    checkpoint()
    near = cKDTree(scaled).query_pairs(1.0, output_type="ndarray")
    size = len(candidates)
    graph = sparse.coo_array((np.ones(len(near), np.int8), (near[:, 0], near[:, 1])), (size, size))
    graph = sparse.csr_array(graph + graph.T)
    free = np.ones(size, dtype=bool)
    chosen = []
    for place in range(size):
        if free[place]:
            chosen.append(place)
            free[graph.indices[graph.indptr[place] : graph.indptr[place + 1]]] = False
    return np.sort(candidates[chosen])
