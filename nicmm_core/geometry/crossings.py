"""Finds where a polyline on a mesh crosses or touches itself, face by face.

Every segment lies in one face. So two strands can meet only inside a face through which both run,
at a point of an edge between their faces, or at a vertex.
"""

from __future__ import annotations

import nicmm_kernels
import numpy as np

from .array_types import FloatArray, IntArray
from .curve import SurfaceCurve, checked_curve, weights_in_faces
from .mesh import Mesh
from .surface_points import SurfacePoints, weights_at
from .tolerances import TINY

PARALLEL = 1e-14
"""Cross product of two segments, in barycentric coordinates, up to which they are parallel."""

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


def meeting_places(mesh: Mesh, one: SurfaceCurve, other: SurfaceCurve) -> FloatArray:
    """Positions at which two curves cross or touch, (p, 3).

    Where they run along each other, the ends of the common parts count.
    """
    (face, start, end), others = (_segments(mesh, curve) for curve in (one, other))
    count = len(face)
    face, start, end = (
        np.concatenate(both) for both in zip((face, start, end), others, strict=True)
    )
    pairs = np.sort(meeting_segments(face, start[:, :2], end[:, :2]), axis=1)
    first, second = pairs[(pairs[:, 0] < count) & (pairs[:, 1] >= count)].T
    along, across = end[first] - start[first], end[second] - start[second]
    turn = _cross(along, across)
    # Of parallel segments, the end of one of them is taken that is nearest to the other.
    crossing = _cross(start[second] - start[first], across) / np.where(turn != 0.0, turn, 1.0)
    squared = np.maximum((along * along).sum(axis=1), TINY)
    feet = [
        ((place[second] - start[first]) * along).sum(axis=1) / squared for place in (start, end)
    ]
    nearest = np.where(np.abs(feet[0] - 0.5) < np.abs(feet[1] - 0.5), *feet)
    share = np.where(np.abs(turn) > PARALLEL, crossing, nearest).clip(0.0, 1.0)[:, None]
    weights = (1.0 - share) * start[first] + share * end[first]
    return SurfacePoints(face[first], weights).positions(mesh)


def _segments(mesh: Mesh, curve: SurfaceCurve) -> tuple[IntArray, FloatArray, FloatArray]:
    """The segments of a curve in every face that holds them: faces, (s,), and both ends, (s, 3)."""
    curve, faces = checked_curve(mesh, curve, across_gaps=True)
    count = len(faces) if curve.closed else len(faces) - 1
    segment, faces = np.arange(count), faces[:count]
    following = (segment + 1) % len(curve.faces)
    start, end = (
        weights_in_faces(mesh, curve.faces[ends], curve.barycentric[ends], faces)
        for ends in (segment, following)
    )
    used = (start > 0.0) | (end > 0.0)
    which, beside = [segment], [faces]
    for number in np.flatnonzero(used.sum(axis=1) < 3).tolist():
        around = mesh.faces_with(mesh.faces[faces[number]][used[number]])
        beside.append(around[around != faces[number]])
        which.append(np.full(len(beside[-1]), number))
    index, face = np.concatenate(which), np.concatenate(beside)
    start, end = (
        weights_at(mesh.faces[faces[index]], weights[index], mesh.faces[face])
        for weights in (start, end)
    )
    return face, start, end


def _cross(one: FloatArray, other: FloatArray) -> FloatArray:
    """Cross products of differences of barycentric coordinates, (p,)."""
    return one[:, 0] * other[:, 1] - one[:, 1] * other[:, 0]
