"""Subdivides sides of faces into segments, so that each can be joined to a different face."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..geometry.array_types import FloatArray, IntArray


@dataclass(frozen=True)
class SubdividedFaces:
    """Faces, some divided into triangles that join each segment of their sides to the centroid.

    Attributes
    ----------
    faces : (m, 3) int array
        Corner indices of each triangle, undivided faces first. New vertices are numbered after the
        given ones, first the points on edges, then the centroids.
    parent : (m,) int array
        Given face of which each triangle is a part.
    corners : (m, 3, 3) float array
        Barycentric coordinates of the corners of each triangle in its parent.
    first_child : (3 f,) int array
        Triangle at the first segment of each side of the given faces; -1 for sides of undivided
        faces. The triangles at the other segments of the side follow it. The segment is opposite
        corner 2 of its triangle.
    """

    faces: IntArray
    parent: IntArray
    corners: FloatArray
    first_child: IntArray


def subdivided(
    faces: IntArray,
    low: IntArray,
    high: IntArray,
    edge_of_side: IntArray,
    segments: IntArray,
    n_vertices: int,
) -> SubdividedFaces:
    """Subdivide edges into segments of equal length, in the same way in all faces of an edge.

    Parameters
    ----------
    faces : (f, 3) int array
        Corner indices of each triangle.
    low, high : (3 f,) int array
        Corners (3 face + place) at the two ends of each side, in the same order for all sides of an
        edge. Segments are counted from ``low``.
    edge_of_side : (3 f,) int array
        Index of the edge of each side, -1 for sides that are not subdivided.
    segments : (e,) int array
        Number of segments of each edge, at least 2.
    n_vertices : int
        Number of vertices before the subdivision.
    """
    cut = (edge_of_side >= 0).reshape(-1, 3).any(axis=1)
    whole, split = np.flatnonzero(~cut), np.flatnonzero(cut)
    side = (3 * split[:, None] + np.arange(3)).ravel()
    edge = edge_of_side[side]
    count = np.where(edge >= 0, segments[edge], 1)
    first = np.cumsum(count) - count
    row = np.repeat(np.arange(len(side)), count)
    step = np.arange(len(row)) - first[row]
    inner = np.cumsum(segments - 1) - (segments - 1)  # number of new vertices on earlier edges
    n_points = int((segments - 1).sum())

    def end(number: IntArray) -> tuple[IntArray, FloatArray]:
        """Vertex and barycentric coordinates of each point after ``number`` segments of a side."""
        share = number / count[row]
        here, there = low[side[row]], high[side[row]]
        at_edge = n_vertices + inner[edge[row]] + number - 1
        vertex = np.where(number == 0, faces.ravel()[here], at_edge)
        vertex = np.where(number == count[row], faces.ravel()[there], vertex)
        weights = (1.0 - share)[:, None] * np.eye(3)[here % 3]
        return vertex, weights + share[:, None] * np.eye(3)[there % 3]

    middle = n_vertices + n_points + row // 3
    middle_weights = np.full((len(row), 3), 1.0 / 3.0)
    # Side j runs from corner j + 1 to corner j + 2 in the orientation of the face.
    along = (low[side] % 3 == (side % 3 + 1) % 3)[row]
    (one, one_weights), (other, other_weights) = end(step + ~along), end(step + along)
    first_child = np.full(faces.size, -1)
    first_child[side] = len(whole) + first
    corners = np.stack([one_weights, other_weights, middle_weights], axis=1)
    return SubdividedFaces(
        faces=np.concatenate([faces[whole], np.stack([one, other, middle], axis=1)]),
        parent=np.concatenate([whole, split[row // 3]]),
        corners=np.concatenate([np.broadcast_to(np.eye(3), (len(whole), 3, 3)), corners]),
        first_child=first_child,
    )
