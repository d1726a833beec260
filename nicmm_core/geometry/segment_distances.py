"""Exact distances along the surface from segments that lie in faces, up to a limit.

Shortest paths from a segment are straight lines across unfolded faces; they are followed by a
kernel. The cost follows the surface within the limit, not the size of the mesh.
"""

from __future__ import annotations

from collections.abc import Sequence
from copy import copy
from dataclasses import dataclass
from functools import cached_property

import nicmm_kernels
import numpy as np

from ..progress import checkpoint
from . import tolerances
from .array_types import BoolArray, FloatArray, IntArray
from .curve import SurfaceCurve, checked_curve, weights_in_faces, without_small_weights
from .mesh import Mesh
from .surface_points import SurfacePoints

SAME_POINT = 64.0 * float(np.finfo(np.float64).eps)
"""Distance below which points are the same, in bounding-box diagonals."""


@dataclass(frozen=True)
class FaceSegments:
    """Segments, each in one face.

    Attributes
    ----------
    faces : (s,) int array
    start, end : (s, 3) float array
        Barycentric coordinates of the two ends.
    """

    faces: IntArray
    start: FloatArray
    end: FloatArray

    def __len__(self) -> int:
        return len(self.faces)

    def taken(self, which: BoolArray | IntArray) -> FaceSegments:
        """Some of the segments, by indices or a mask."""
        return FaceSegments(self.faces[which], self.start[which], self.end[which])

    def positions(self, mesh: Mesh) -> tuple[FloatArray, FloatArray]:
        """Positions of both ends, (s, 3)."""
        start, end = (SurfacePoints(self.faces, ends) for ends in (self.start, self.end))
        return start.positions(mesh), end.positions(mesh)


def segments_of(mesh: Mesh, curve: SurfaceCurve) -> FaceSegments:
    """The segments of a curve, in order.

    Raises
    ------
    CurveError
        If it does not lie on the mesh.
    """
    curve, faces = checked_curve(mesh, curve, across_gaps=True)
    first = np.arange(len(faces) if curve.closed else len(faces) - 1)
    faces = faces[first]
    start, end = (
        weights_in_faces(mesh, curve.faces[ends], curve.barycentric[ends], faces)
        for ends in (first, (first + 1) % len(curve.faces))
    )
    return FaceSegments(faces, start, end)


def joined_segments(parts: Sequence[FaceSegments]) -> FaceSegments:
    """Concatenate segments."""
    return FaceSegments(
        np.concatenate([np.zeros(0, np.int64), *(part.faces for part in parts)]),
        np.concatenate([np.zeros((0, 3)), *(part.start for part in parts)]),
        np.concatenate([np.zeros((0, 3)), *(part.end for part in parts)]),
    )


class SegmentDistances:
    """Distances from segments on a manifold.

    It takes less work where each segment begins at the end of the one before it.

    Parameters
    ----------
    mesh : Mesh
        A manifold whose faces all have an area.
    segments : FaceSegments
    limit : float
        Distance up to which distances are computed, in mesh units.

    Attributes
    ----------
    paths : nicmm_kernels.SegmentPaths
    total : float
        Total length of the segments.
    """

    def __init__(self, mesh: Mesh, segments: FaceSegments, limit: float) -> None:
        # An end that is almost at a vertex counts as there, where lines in all directions begin.
        ends = (without_small_weights(weights) for weights in (segments.start, segments.end))
        segments = FaceSegments(segments.faces, *ends)
        self.mesh, self.segments, self.limit = mesh, segments, limit
        scale = SAME_POINT * mesh.diagonal
        start, end = segments.positions(mesh)
        previous, following = _neighbours(start, end, scale)
        total = np.cumsum(np.linalg.norm(end - start, axis=1))
        arcs = np.stack([np.append(0.0, total[:-1]), total], axis=1)
        self.total = float(total[-1]) if len(total) else 0.0
        self.paths = nicmm_kernels.SegmentPaths(
            mesh.for_kernels,
            np.ascontiguousarray(segments.faces),
            np.ascontiguousarray(segments.start),
            np.ascontiguousarray(segments.end),
            previous,
            following,
            arcs,
            limit,
            scale,
            checkpoint,
        )
        self._bound_corners()

    @property
    def at_vertices(self) -> FloatArray:
        """Distance of each vertex, (V,); greater ones than the limit may be too great."""
        return self.paths.vertex_distances

    @cached_property
    def faces_reached(self) -> BoolArray:
        """Whether each face may have points within the limit, (F,)."""
        reached = (self.at_vertices < self.limit)[self.mesh.faces].any(axis=1)
        reached[self.segments.faces] = reached[self.paths.sides // 3] = True
        return reached

    def relative_to(self, knots: FloatArray, widths: FloatArray) -> SegmentDistances:
        """The distances relative to a width that varies along the segments.

        Parameters
        ----------
        knots : (k,) float array
            Total lengths of the segments up to some places, ascending.
        widths : (k,) float array
            Widths there, positive, and linear in between.

        Returns
        -------
        SegmentDistances
            Distances divided by the width at the nearest place, and multiplied by the least width.
        """
        found = copy(self)
        found.paths = self.paths.relative_to(knots, widths)
        return found

    def _bound_corners(self) -> None:
        """Give all corners of the faces reached a finite distance, that of a path along edges."""
        corners, distance = self.mesh.faces[self.faces_reached], self.at_vertices
        start, end = corners[:, [0, 1, 2, 1, 2, 0]].ravel(), corners[:, [1, 2, 0, 0, 1, 2]].ravel()
        length = np.linalg.norm(self.mesh.vertices[start] - self.mesh.vertices[end], axis=1)
        while True:
            lowered = distance[start] + length
            closer = lowered < distance[end] * (1.0 - tolerances.ROUNDED)
            if not closer.any():
                break
            np.minimum.at(distance, end[closer], lowered[closer])

    def at(self, points: SurfacePoints) -> FloatArray:
        """Distance of points, (n,); greater ones than the limit may be too great or infinite."""
        return self.nearest(points)[0]

    def nearest(self, points: SurfacePoints) -> tuple[FloatArray, FloatArray, FloatArray]:
        """The nearest places on the segments.

        Parameters
        ----------
        points : SurfacePoints
            n points.

        Returns
        -------
        distances : (n,) float array
        arcs : (n,) float array
            Total length of the segments up to the nearest place.
        sides : (n,) float array
            1 for points to the left of the segments, seen with the normals upwards; -1 for points
            to the right. They have a meaning only if the segments are those of one curve, in order,
            on an oriented mesh.
        """
        checkpoint()
        return self.paths.nearest(
            np.ascontiguousarray(points.faces), np.ascontiguousarray(points.barycentric)
        )


def _neighbours(start: FloatArray, end: FloatArray, scale: float) -> tuple[IntArray, IntArray]:
    """The segment before and after each one in the list, where they meet; else -1."""
    index = np.arange(len(start))
    meet = np.linalg.norm(start - np.roll(end, 1, axis=0), axis=1) <= scale
    previous = np.where(meet, np.roll(index, 1), -1)
    following = np.where(np.roll(meet, -1), np.roll(index, -1), -1)
    return previous, following
