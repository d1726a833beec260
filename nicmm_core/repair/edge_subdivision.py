"""Subdivides sides of faces into segments, so that each can be joined to a different face."""

from __future__ import annotations

import numpy as np

from ..geometry.array_types import FloatArray, IntArray
from ..geometry.mesh import side_corners
from .face_parts import FaceParts


def subdivided(
    faces: IntArray, edge: IntArray, segments: IntArray, n_vertices: int
) -> tuple[FaceParts, IntArray]:
    """Subdivide edges into segments of equal length, in the same way in all faces of an edge.

    A face with such a side is divided into triangles that join each segment to its centroid.

    Parameters
    ----------
    faces : (f, 3) int array
        Corner indices of each triangle.
    edge : (3 f,) int array
        Index of the edge of each side, -1 for sides that are not subdivided.
    segments : (e,) int array
        Number of segments of each edge, at least 2. They are counted from the end of lower index.
    n_vertices : int
        Number of vertices before the subdivision.

    Returns
    -------
    FaceParts
        The triangles, undivided faces first. New vertices are numbered after the given ones, first
        the points on edges, then the centroids. Each segment is opposite corner 2 of its triangle.
    (3 f,) int array
        Triangle at the first segment of each side, -1 for sides of undivided faces. The triangles
        at the other segments of the side follow it.
    """
    ends = side_corners(faces)
    cut = (edge >= 0).reshape(-1, 3).any(axis=1)
    whole, side = np.flatnonzero(~cut), np.flatnonzero(np.repeat(cut, 3))
    count = np.append(segments, 1)[edge]  # the last entry is that of the sides without an edge
    before = np.append(n_vertices + np.cumsum(segments - 1) - segments, 0)[edge]
    row = np.repeat(side, count[side])
    first = np.cumsum(count[side]) - count[side]
    step = np.arange(len(row)) - np.repeat(first, count[side])

    def point(number: IntArray) -> tuple[IntArray, FloatArray]:
        """Vertex and barycentric coordinates of the point after some segments of each side."""
        vertex = np.where(number == 0, faces.ravel()[ends[row, 0]], before[row] + number)
        vertex = np.where(number == count[row], faces.ravel()[ends[row, 1]], vertex)
        share = (number / count[row])[:, None]
        low, high = np.eye(3)[ends[row].T % 3]
        return vertex, (1.0 - share) * low + share * high

    # Side j runs from corner j + 1 to corner j + 2 in the orientation of the face.
    along = ends[row, 0] % 3 == (row + 1) % 3
    (one, one_weights), (other, other_weights) = point(step + ~along), point(step + along)
    middle = n_vertices + (segments - 1).sum() + np.cumsum(cut)[row // 3] - 1
    weights = np.stack([one_weights, other_weights, np.full((len(row), 3), 1.0 / 3.0)], axis=1)
    parts = FaceParts(
        np.concatenate([faces[whole], np.stack([one, other, middle], axis=1)]),
        np.concatenate([whole, row // 3]),
        np.concatenate([np.broadcast_to(np.eye(3), (len(whole), 3, 3)), weights]),
    )
    first_child = np.full(faces.size, -1)
    first_child[side] = len(whole) + first
    return parts, first_child
