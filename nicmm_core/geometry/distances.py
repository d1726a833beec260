"""Propagates distances over a surface from the vertices at which they are known.

Kimmel and Sethian's update ("Computing geodesic paths on manifolds", 1998), a plane wave across
each triangle, is not applied vertex by vertex, but repeatedly to all faces at the vertices that
have just changed. The cost depends on the part of the surface that is reached, not on its size.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy import sparse

from ..progress import checkpoint
from . import tolerances
from .array_types import BoolArray, FloatArray, IntArray
from .mesh import faces_around

SETTLED = 1e-6
"""Decreases of a distance by less than this, in edge lengths, are not propagated."""

MOST_DECREASES = 100
"""Number of decreases of a distance after which only smaller distances may lower it.

At most 50 occurred on the SHREC16 meshes with virtual splits. In a ring of needles, each distance
may lower the next one by ever smaller amounts for thousands of rounds.
"""


@dataclass(frozen=True)
class DistanceSurface:
    """A mesh over which distances are propagated.

    Attributes
    ----------
    vertices : (n, 3) float array
        Positions of the vertices.
    faces : (m, 3) int array
        Corner indices of each triangle.
    faces_around : (n, m) sparse array
        Incidence of vertices and faces: 1 where a face has a vertex.
    edge_length : float
        Typical length of an edge, the unit of `SETTLED`.
    """

    vertices: FloatArray
    faces: IntArray
    faces_around: sparse.csr_array
    edge_length: float


def build_distance_surface(
    vertices: FloatArray, faces: IntArray, edge_length: float
) -> DistanceSurface:
    """Build a `DistanceSurface`, with an index of the faces around each vertex."""
    return DistanceSurface(vertices, faces, faces_around(faces, len(vertices)), edge_length)


def distance_to_segments(points: FloatArray, start: FloatArray, end: FloatArray) -> FloatArray:
    """Distance of each point to its segment, shape (p,); arguments have shape (p, 3)."""
    along = end - start
    squared = np.maximum((along**2).sum(axis=1), tolerances.TINY)
    share = np.clip(((points - start) * along).sum(axis=1) / squared, 0.0, 1.0)
    return np.linalg.norm(points - start - share[:, None] * along, axis=1)


def propagate(surface: DistanceSurface, distance: FloatArray, limit: float) -> None:
    """Propagate distances over a surface, in place.

    Parameters
    ----------
    surface : DistanceSurface
    distance : (n,) float array
        Distance of each vertex, in the unit of the positions, infinite where it is unknown. Finite
        values count as exact and are not changed.
    limit : float
        Distances of at least this value are not propagated further.
    """
    settled = np.isfinite(distance)
    changed = np.flatnonzero(settled)
    least_gain = SETTLED * surface.edge_length
    times_lowered = np.zeros(len(distance), dtype=np.int64)
    while len(changed):
        checkpoint()
        faces = surface.faces[np.unique(surface.faces_around[changed].indices)]
        # Each corner in turn is reached from the other two corners.
        reached, first, second = (np.roll(faces, k, axis=1).ravel() for k in range(3))
        moving = ~settled[reached]
        reached, first, second = reached[moving], first[moving], second[moving]
        waits = times_lowered[reached] >= MOST_DECREASES
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
    """Distance at a corner of each face from those at the other two, inf where neither is finite.

    Distances that are linear on the opposite edge belong to a plane wave. Where this wave would
    have to enter through another edge, the shorter of the paths along the two edges counts. At an
    obtuse angle, the distance of a corner may be less than the greater of the other two distances;
    corners in `waits` do not get such a distance.
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
    advance = np.sqrt(np.maximum(1.0 - slope**2, tolerances.TINY))
    entry = along - slope / advance * off
    plane &= (entry >= 0.0) & (entry <= length)
    across = np.where(plane, start, 0.0) + slope * along + advance * off
    across = np.maximum(across, np.where(plane & waits, np.maximum(start, end), 0.0))
    return np.where(plane, np.minimum(across, along_edges), along_edges)
