"""Finds where a polyline on a mesh crosses or touches itself, face by face.

Every segment lies in one face. So two strands can meet only inside a face through which both run,
at a point of an edge between their faces, or at a vertex.
"""

from __future__ import annotations

import numpy as np

from .array_types import BoolArray, FloatArray, IntArray
from .surface_points import SurfacePoints, weights_at

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
    following = (segment + 1) % n
    faces = polyline.faces[:n_segments]
    start = polyline.barycentric[:n_segments, :2]
    theirs = all_faces[polyline.faces[following]]
    end = weights_at(theirs, polyline.barycentric[following], all_faces[faces][:, :2])

    first, second = overlapping_segments(faces, start, end)
    apart = np.abs(first - second)
    neighbours = (apart == 1) | (closed & (apart == n_segments - 1))
    first, second = first[~neighbours], second[~neighbours]
    meets = segments_meet(start, end, first, second)
    inside = np.stack([first[meets], second[meets]], axis=1)
    return np.concatenate([inside, _vertices_passed_twice(all_faces, polyline, n_segments)])


def overlapping_segments(
    group: IntArray, start: FloatArray, end: FloatArray
) -> tuple[IntArray, IntArray]:
    """Pairs of segments of the same group whose bounding boxes overlap.

    Parameters
    ----------
    group : (s,) int array
        Index of the group of each segment. All segments of a group lie in one face.
    start, end : (s, 2) float array
        First two barycentric coordinates of the ends of each segment in this face.
    """
    # Not `grouped`, which has checkpoints. A curve is tested even after its relaxation has been
    # cancelled, and a checkpoint would then raise an error.
    order = np.argsort(group, kind="stable")
    in_order = group[order]
    begins = np.flatnonzero(np.append(True, in_order[1:] != in_order[:-1])[: len(group)])
    count = np.append(begins[1:], len(group))[: len(begins)] - begins
    first, second = _pairs_in_groups(count)
    first, second = order[first], order[second]
    # Bounding boxes rule out most pairs. They are also necessary, since collinear segments pass the
    # other tests even if they are disjoint.
    low, high = np.minimum(start, end), np.maximum(start, end) + TOUCHING
    for axis in range(2):
        overlap = low[first, axis] <= high[second, axis]
        overlap &= low[second, axis] <= high[first, axis]
        first, second = first[overlap], second[overlap]
    return first, second


def segments_meet(
    start: FloatArray, end: FloatArray, first: IntArray, second: IntArray
) -> BoolArray:
    """Whether the segments of each pair have a common point, (p,); their boxes must overlap."""
    a, b, c, d = start[first], end[first], start[second], end[second]
    return _reaches_across(a, b, c, d) & _reaches_across(c, d, a, b)


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


def _pairs_in_groups(count: IntArray) -> tuple[IntArray, IntArray]:
    """All pairs of positions within consecutive groups of the given sizes."""
    ends = np.cumsum(count).repeat(count)
    position = np.arange(len(ends))
    after = ends - position - 1  # number of later positions in the same group
    first = position.repeat(after)
    begins = np.cumsum(after) - after
    return first, first + 1 + np.arange(len(first)) - begins.repeat(after)


def _reaches_across(a: FloatArray, b: FloatArray, c: FloatArray, d: FloatArray) -> BoolArray:
    """Whether c and d lie on different sides of the line ab, or at least one lies on it."""
    one, other = _turn(a, b, c), _turn(a, b, d)
    width = TOUCHING * np.linalg.norm(b - a, axis=1)
    return (np.minimum(one, other) <= width) & (np.maximum(one, other) >= -width)


def _turn(a: FloatArray, b: FloatArray, c: FloatArray) -> FloatArray:
    """Twice the signed area of the triangles abc."""
    one, other = b - a, c - a
    return one[:, 0] * other[:, 1] - one[:, 1] * other[:, 0]
