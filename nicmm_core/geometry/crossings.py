"""Finds where a polyline on a mesh crosses or touches itself, face by face.

Every segment lies in one face. So two strands can meet only inside a face through which both run,
at a point of an edge between their faces, or at a vertex.
"""

from __future__ import annotations

import nicmm_kernels
import numpy as np

from .array_types import FloatArray, IntArray
from .surface_points import SurfacePoints

TOUCHING = 1e-12
"""Distance in barycentric coordinates up to which strands touch. If strands cross on an edge,
rounding may place the crossing on the near side of the edge in both faces."""


def crossing_segments(all_faces: IntArray, polyline: SurfacePoints, closed: bool) -> IntArray:
    """Pairs of non-consecutive segments that have a common point, shape (p, 2).

    Parameters
    ----------
    all_faces : (F, 3) int array
        Faces of the mesh.
    polyline : SurfacePoints
        Points of the polyline, each in the face of the segment that begins there.
    closed : bool
        Whether the last point is joined to the first.
    """
    # Without checkpoints: a curve is tested even after its relaxation has been cancelled, and a
    # checkpoint would then raise an error.
    return nicmm_kernels.polyline_crossings(
        np.ascontiguousarray(all_faces), *polyline.for_kernels, closed, TOUCHING, lambda: None
    )


def meeting_segments(group: IntArray, start: FloatArray, end: FloatArray) -> IntArray:
    """Pairs of segments of the same group that have a common point, (p, 2).

    Parameters
    ----------
    group : (s,) int array
        Index of the group of each segment. All segments of a group lie in one face.
    start, end : (s, 2) float array
        First two barycentric coordinates of the ends of each segment in this face.
    """
    return nicmm_kernels.meeting_segments(
        np.ascontiguousarray(group, np.int64),
        np.ascontiguousarray(start),
        np.ascontiguousarray(end),
        TOUCHING,
        lambda: None,
    )
