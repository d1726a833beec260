"""Distances on a surface, propagated from where they are known.

Kimmel and Sethian's update ("Computing geodesic paths on manifolds", 1998), a plane wave across
each triangle, is repeated on all faces at the last changes instead of vertex by vertex. The cost
depends on the part that is reached, not on the mesh.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy import sparse

from ..progress import checkpoint
from .array_types import BoolArray, FloatArray, IntArray

SETTLED = 1e-6
"""Decreases of a distance below this, in edge lengths, are not propagated."""

OFTEN = 100
"""Number of decreases of a distance after which only smaller distances may lower it.

At most 50 occurred on the SHREC16 meshes with virtual splits. In a ring of needles, each may lower
the next by ever smaller amounts for thousands of rounds.
"""


@dataclass(frozen=True)
class DistanceSurface:
    """A mesh for distances: n vertices, m faces.

    Attributes
    ----------
    vertices : (n, 3) float array
    faces : (m, 3) int array
    faces_around : (n, m) sparse array
        1 where a face has a vertex.
    edge_length : float
    """

    vertices: FloatArray
    faces: IntArray
    faces_around: sparse.csr_array
    edge_length: float


def build_distance_surface(
    vertices: FloatArray, faces: IntArray, edge_length: float
) -> DistanceSurface:
    """Index the faces of each vertex."""
    entries = (np.ones(faces.size), (faces.ravel(), np.repeat(np.arange(len(faces)), 3)))
    around = sparse.csr_array(sparse.coo_array(entries, shape=(len(vertices), len(faces))))
    return DistanceSurface(vertices, faces, around, edge_length)


def distance_to_segments(points: FloatArray, start: FloatArray, end: FloatArray) -> FloatArray:
    """Distance of each point to its segment, shape (p,); arguments have shape (p, 3)."""
    along = end - start
    squared = np.maximum((along**2).sum(axis=1), np.finfo(np.float64).tiny)
    share = np.clip(((points - start) * along).sum(axis=1) / squared, 0.0, 1.0)
    return np.linalg.norm(points - start - share[:, None] * along, axis=1)


def spread(surface: DistanceSurface, distance: FloatArray, limit: float) -> None:
    """Propagate finite distances over the surface, in place, up to the limit."""
    settled = np.isfinite(distance)  # at the curve they are exact
    changed = np.flatnonzero(settled)
    least_gain = SETTLED * surface.edge_length
    times_lowered = np.zeros(len(distance), dtype=np.int64)
    while len(changed):
        checkpoint()
        faces = surface.faces[np.unique(surface.faces_around[changed].indices)]
        # Each corner in turn is reached from the other two.
        reached, first, second = (np.roll(faces, k, axis=1).ravel() for k in range(3))
        moving = ~settled[reached]
        reached, first, second = reached[moving], first[moving], second[moving]
        waits = times_lowered[reached] >= OFTEN
        arrival = _wave_arrival(surface.vertices, distance, reached, first, second, waits)
        touched = np.unique(reached)
        before = distance[touched]
        np.minimum.at(distance, reached, arrival)
        gain = before - distance[touched]
        times_lowered[touched[gain > 0.0]] += 1
        changed = touched[(gain > least_gain) & (distance[touched] < limit)]


def _wave_arrival(
    vertices: FloatArray,
    distance: FloatArray,
    reached: IntArray,
    first: IntArray,
    second: IntArray,
    waits: BoolArray,
) -> FloatArray:
    """Distance at a corner from those at the other two, inf where neither is finite.

    With linear distances on the opposite edge the wave is plane. Where it would have to enter
    through another edge, the shorter path along an edge counts. At an obtuse angle a corner may be
    nearer than the farther of the other two, but not one that waits.
    """
    side = vertices[second] - vertices[first]
    length = np.linalg.norm(side, axis=1)
    to_first = vertices[reached] - vertices[first]
    along = (to_first * side).sum(axis=1) / length
    off = np.sqrt(np.maximum((to_first**2).sum(axis=1) - along**2, 0.0))
    along_edges = np.minimum(
        distance[first] + np.hypot(along, off), distance[second] + np.hypot(length - along, off)
    )
    start, end = distance[first], distance[second]
    plane = np.isfinite(start) & np.isfinite(end)
    slope = np.zeros(len(length))
    slope[plane] = (end[plane] - start[plane]) / length[plane]
    plane &= np.abs(slope) < 1.0
    advance = np.sqrt(np.maximum(1.0 - slope**2, np.finfo(np.float64).tiny))
    entry = along - slope / advance * off
    plane &= (entry >= 0.0) & (entry <= length)
    across = np.where(plane, start, 0.0) + slope * along + advance * off
    across = np.maximum(across, np.where(plane & waits, np.maximum(start, end), 0.0))
    return np.where(plane, np.minimum(across, along_edges), along_edges)
