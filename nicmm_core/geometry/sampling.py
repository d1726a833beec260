"""Samples vertices that are about evenly spread over a surface.

They become the seeds of the coarse mesh and the cells of the hop graph.
"""

from __future__ import annotations

import numpy as np
from scipy.spatial import cKDTree

from .array_types import FloatArray, IntArray
from .mesh import Mesh

CANDIDATES = 8
"""Number of candidate vertices per seed."""

PACKING = 0.84
"""Least distance between two seeds, relative to the square root of the area per seed."""

NORMAL_WEIGHT = 0.6
"""Weight of the difference of two unit normals in the distance, in least distances between seeds.

Opposite normals differ by 2, which with this weight exceeds the least distance. So the two sides of
a plate or of a thin limb get separate seeds.
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
    """Choose vertices that are at least a distance apart.

    Parameters
    ----------
    mesh : Mesh
    normals : (V, 3) float array
        Unit normals at the vertices.
    areas : (V,) float array
        Area of the surface around each vertex. Vertices without area are never chosen.
    chance : (V,) float array
        Random numbers in (0, 1), which determine the candidates.
    n_candidates : int
        Number of candidates, which are sampled with probabilities in proportion to their areas.
    distance : float
        Least distance between two chosen vertices, in mesh units.
    normal_weight : float
        Weight of the difference of normals, in units of ``distance``; see `NORMAL_WEIGHT`.

    Returns
    -------
    (n,) int array
        The chosen vertices, ascending.
    """
    there = np.flatnonzero(areas > 0.0)
    # The vertices with the smallest exponentially distributed times are a sample without
    # replacement, weighted by area.
    times = -np.log(chance[there]) / areas[there]
    candidates = there[np.argsort(times)[:n_candidates]]
    scaled = np.concatenate(
        [mesh.vertices[candidates] / distance, normal_weight * normals[candidates]], axis=1
    )
    tree, free = cKDTree(scaled), np.ones(len(candidates), dtype=bool)
    chosen = []
    for number, place in enumerate(scaled):
        if free[number]:
            chosen.append(number)
            free[tree.query_ball_point(place, 1.0)] = False
    return np.sort(candidates[chosen])
