"""Samples vertices that are about evenly spread over a surface.

They become the seeds of the coarse mesh and the cells of the hop graph. Where the surface or its
triangulation changes a little, most of them stay the same.
"""

from __future__ import annotations

import numpy as np
from scipy.spatial import cKDTree

from .array_types import FloatArray, IntArray
from .mesh import Mesh
from .numbering import PrincipalFrame, rounded_to_integers, uniform_hash

CANDIDATES = 8
"""Number of candidate vertices per seed."""

PACKING = 0.84
"""Least distance between two seeds, relative to the square root of the area per seed."""

NORMAL_WEIGHT = 0.6
"""Weight of the difference of two unit normals in the distance, in least distances between seeds.

Opposite normals differ by 2, which with this weight exceeds the least distance. So the two sides of
a plate or of a thin limb get separate seeds.
"""

BLOCK = 0.25
"""Side of the blocks of space of which each gives one candidate, in least distances of seeds.

They are so large that small changes of the surface hardly move a vertex to another block.
"""


def spread_vertices(
    mesh: Mesh,
    frame: PrincipalFrame,
    normals: FloatArray,
    areas: FloatArray,
    n_candidates: int,
    distance: float,
    normal_weight: float = NORMAL_WEIGHT,
) -> IntArray:
    """Choose vertices that are at least a distance apart.

    They depend on positions and areas only, not on the numbering.

    Parameters
    ----------
    mesh : Mesh
    frame : PrincipalFrame
        The frame of the mesh, in which space is divided into blocks.
    normals : (V, 3) float array
        Unit normals at the vertices.
    areas : (V,) float array
        Area of the surface around each vertex. Vertices without area are never chosen.
    n_candidates : int
        Greatest number of candidates, which are sampled with probabilities in proportion to the
        areas in their blocks.
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
    places = frame.coordinates(mesh.vertices[there]) * (frame.unit / (BLOCK * distance))
    central, times = _blocks(places, normals[there] @ frame.axes, areas[there])
    candidates = there[central[np.argsort(times, kind="stable")[:n_candidates]]]
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


def _blocks(
    places: FloatArray, normals: FloatArray, areas: FloatArray
) -> tuple[IntArray, FloatArray]:
    """The vertex nearest to the centre of each block, and an exponentially distributed time.

    The blocks with the smallest times are a sample without replacement, weighted by area. Hashes of
    the positions of blocks replace random numbers. A block counts once for each direction of the
    surface in it, so that both sides of a thin plate give candidates.

    Parameters
    ----------
    places : (n, 3) float array
        Positions of vertices, in sides of the blocks.
    normals : (n, 3) float array
        Unit normals in the same coordinates.
    areas : (n,) float array

    Returns
    -------
    (b,) int array, (b,) float array
    """
    block = rounded_to_integers(places)
    sides = np.concatenate([block, rounded_to_integers(normals)], axis=1)
    _, first, number = np.unique(uniform_hash(sides), return_index=True, return_inverse=True)
    away = ((places - block) ** 2).sum(axis=1)
    least = np.full(len(first), np.inf)
    np.minimum.at(least, number, away)
    nearest = np.flatnonzero(away == least[number])[::-1]
    central = np.empty(len(first), dtype=np.int64)
    central[number[nearest]] = nearest  # of several, the one of lowest index
    return central, -np.log(uniform_hash(block[first])) / np.bincount(number, areas)
