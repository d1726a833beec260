"""Signed distance to the zero set of a field, near that zero set, for the level-set solver.

The heat method gives distances to vertices. A solver that moves the curve repeatedly needs
distances to the curve itself, but only near it. Vertices of faces that the curve crosses get their
distance to the segments of the curve, and these distances are propagated outwards. The cost depends
on the size of the band, not on that of the mesh.
"""

from __future__ import annotations

import numpy as np
from scipy import sparse

from ..geometry.array_types import FloatArray, IntArray
from ..geometry.distances import DistanceSurface, distance_to_segments, propagate
from .contour import segment_ends, signs_with_zeros
from .sign_bundle import SignBundle
from .signed_distance import LEAST_DISTANCE


def redistanced(
    surface: DistanceSurface,
    field: FloatArray,
    zero_vertices: IntArray,
    limit: float = np.inf,
    bundle: SignBundle | None = None,
) -> FloatArray:
    """Replace a field by the signed distance to its zero set.

    Parameters
    ----------
    surface : DistanceSurface
        The working mesh, indexed for distances.
    field : (n,) float array
        Field with a zero set. Its signs are kept.
    zero_vertices : (k,) int array
        Vertices through which the zero set passes; they stay zero.
    limit : float
        Distance up to which distances are propagated. The absolute value of the result is constant
        beyond it.
    bundle : SignBundle, optional
        Signs with which faces read the values of their corners.

    Returns
    -------
    (n,) float array
        Signed distance in the unit of the surface, or a copy of the field if it has no zero set.
    """
    sign = signs_with_zeros(field, zero_vertices)
    distance = _distance_at_the_curve(surface, field, sign, bundle)
    distance[zero_vertices] = 0.0
    if not np.isfinite(distance).any():
        return field.copy()
    propagate(surface, distance, limit)
    distance = np.maximum(distance, LEAST_DISTANCE * surface.edge_length)
    reached = np.isfinite(distance)
    distance[~reached] = distance[reached].max()
    return sign * np.minimum(distance, limit)


def _distance_at_the_curve(
    surface: DistanceSurface, field: FloatArray, sign: IntArray, bundle: SignBundle | None
) -> FloatArray:
    """Distance of the vertices of crossed faces to nearby segments, inf at all other vertices."""
    crossed, start, end = segment_ends(surface.vertices, surface.faces, field, sign, bundle)
    touching = surface.faces_around[:, crossed]
    face, segment = sparse.coo_array(touching.T @ touching).coords
    distance = np.full(len(field), np.inf)
    for corner in range(3):
        vertex = surface.faces[crossed[face], corner]
        to_segment = distance_to_segments(surface.vertices[vertex], start[segment], end[segment])
        np.minimum.at(distance, vertex, to_segment)
    return distance
