"""Where a polyline on a mesh crosses or touches itself, exactly face by face.

Every segment lies in one face, so two strands can only meet inside a face that both pass, or at a
point of an edge that belongs to segments of both sides.
"""

from __future__ import annotations

import numpy as np

from .array_types import FloatArray, IntArray
from .mesh import Mesh
from .surface_points import SurfacePoints

TOUCHING = 1e-12


def crossing_segments(mesh: Mesh, polyline: SurfacePoints, closed: bool) -> IntArray:
    """Pairs of segments, not consecutive, that have a point in common, shape (p, 2)."""
    n = len(polyline)
    n_segments = n if closed else n - 1
    segment = np.arange(n_segments)
    following = (segment + 1) % n
    faces = polyline.faces[:n_segments]
    start = polyline.barycentric[:n_segments, :2]
    theirs = mesh.faces[polyline.faces[following]]
    same = theirs[:, :, None] == mesh.faces[faces][:, None, :2]
    end = (polyline.barycentric[following][:, :, None] * same).sum(axis=1)

    order = np.argsort(faces, kind="stable")
    count = np.unique(faces, return_counts=True)[1]
    first, second = _pairs_in_groups(count)
    first, second = order[first], order[second]
    apart = np.abs(first - second)
    neighbours = (apart == 1) | (closed & (apart == n_segments - 1))
    first, second = first[~neighbours], second[~neighbours]
    a, b, c, d = start[first], end[first], start[second], end[second]
    meets = (_turn(a, b, c) * _turn(a, b, d) <= TOUCHING**2) & (
        _turn(c, d, a) * _turn(c, d, b) <= TOUCHING**2
    )
    # Collinear segments pass both tests wherever they lie on their common line.
    overlap = (np.minimum(a, b) <= np.maximum(c, d)) & (np.minimum(c, d) <= np.maximum(a, b))
    meets &= overlap.all(axis=1)
    return np.stack([first[meets], second[meets]], axis=1)


def _pairs_in_groups(count: IntArray) -> tuple[IntArray, IntArray]:
    """All pairs of places within consecutive groups of the sizes given."""
    first, second = [np.zeros(0, np.int64)], [np.zeros(0, np.int64)]
    begin = np.concatenate([[0], np.cumsum(count)[:-1]])
    for size in np.unique(count[count > 1]).tolist():
        i, j = np.triu_indices(size, 1)
        at = begin[count == size][:, None]
        first.append((at + i).ravel())
        second.append((at + j).ravel())
    return np.concatenate(first), np.concatenate(second)


def _turn(a: FloatArray, b: FloatArray, c: FloatArray) -> FloatArray:
    """Twice the signed area of the triangles abc."""
    one, other = b - a, c - a
    return one[:, 0] * other[:, 1] - one[:, 1] * other[:, 0]
