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
    n = len(polyline)
    n_segments = n if closed else n - 1
    segment = np.arange(n_segments)
    end = nicmm_kernels.segment_ends(all_faces, *polyline.for_kernels, segment)
    start = polyline.barycentric[:n_segments, :2]
    first, second = meeting_segments(polyline.faces[:n_segments], start, end).T
    apart = np.abs(first - second)
    neighbours = (apart == 1) | (closed & (apart == n_segments - 1))
    inside = np.stack([first[~neighbours], second[~neighbours]], axis=1)
    return np.concatenate([inside, _vertices_passed_twice(all_faces, polyline, n_segments)])


def meeting_segments(group: IntArray, start: FloatArray, end: FloatArray) -> IntArray:
    """Pairs of segments of the same group that have a common point, (p, 2).

    Parameters
    ----------
    group : (s,) int array
        Index of the group of each segment. All segments of a group lie in one face.
    start, end : (s, 2) float array
        First two barycentric coordinates of the ends of each segment in this face.
    """
    # Without checkpoints: a curve is tested even after its relaxation has been cancelled, and a
    # checkpoint would then raise an error.
    return nicmm_kernels.meeting_segments(
        np.ascontiguousarray(group, np.int64),
        np.ascontiguousarray(start),
        np.ascontiguousarray(end),
        TOUCHING,
        lambda: None,
    )


def _vertices_passed_twice(
    all_faces: IntArray, polyline: SurfacePoints, n_segments: int
) -> IntArray:
    """Pairs of segments of different strands that begin at the same vertex, shape (p, 2)."""
    n = len(polyline)
    here = polyline.barycentric > 0.0
    place = np.flatnonzero(here.sum(axis=1) == 1)
    vertex = all_faces[polyline.faces[place]][here[place]]
    order = np.argsort(vertex, kind="stable")
    first, second = place[order[:-1]], place[order[1:]]
    apart = second - first
    again = (vertex[order[:-1]] == vertex[order[1:]]) & (apart > 1)
    again &= (n_segments < n) | (apart < n - 1)
    return np.minimum(np.stack([first, second], axis=1)[again], n_segments - 1)
