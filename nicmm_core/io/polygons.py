"""Polygon meshes, which all readers return, and their triangulation."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..geometry.array_types import FloatArray, IntArray

MOST_STARTS = 64
"""Maximum number of corners of a polygon that are tried as the common corner of its triangles."""


class FormatError(ValueError):
    """A file does not conform to its format; the message says what was found and where."""


@dataclass(frozen=True)
class Polygons:
    """A mesh as stored in a file.

    Attributes
    ----------
    vertices : (V, 3) float array
        Positions, not checked; they may be NaN or infinite.
    corners : (c,) int array
        Vertex indices of all faces, one face after the other; not checked.
    sizes : (F,) int array
        Number of corners of each face; they sum to c.
    """

    vertices: FloatArray
    corners: IntArray
    sizes: IntArray

    def triangles(self) -> IntArray:
        """Triangulate each face as a fan from one of its corners.

        Repeated consecutive corners are dropped. Faces with fewer than three corners, and triangles
        that have a vertex twice, are left out: they have no area and do not connect other faces.
        The common corner of the triangles is the first one, unless that inverts a triangle, as in a
        non-convex quad; then it is the corner with the least inversion.

        Returns
        -------
        (T, 3) int array
            Triangles, in the order of the faces.

        Raises
        ------
        FormatError
            If a corner is not a vertex index.
        """
        outside = (self.corners < 0) | (self.corners >= len(self.vertices))
        if outside.any():
            first = int(outside.argmax())
            face = int(np.searchsorted(np.cumsum(self.sizes), first, side="right"))
            raise FormatError(
                f"face {face} refers to vertex {self.corners[first]} (counted from 0), but the "
                f"file has only {len(self.vertices)} vertices"
            )
        corners, sizes = self._without_repetition()
        start = np.cumsum(sizes) - sizes
        parts, places = [np.zeros((0, 3), np.int64)], [np.zeros(0, np.int64)]
        for size in np.unique(sizes[sizes >= 3]).tolist():
            chosen = np.flatnonzero(sizes == size)
            polygons = corners[start[chosen][:, None] + np.arange(size)]
            if size > 3:
                polygons = _from_best_corner(self.vertices, polygons)
            fan = np.stack(
                [
                    np.repeat(polygons[:, :1], size - 2, axis=1),
                    polygons[:, 1:-1],
                    polygons[:, 2:],
                ],
                axis=2,
            )
            parts.append(fan.reshape(-1, 3))
            places.append(np.repeat(chosen, size - 2))
        triangles = np.concatenate(parts)[np.argsort(np.concatenate(places), kind="stable")]
        repeated = (triangles == np.roll(triangles, 1, axis=1)).any(axis=1)
        return triangles[~repeated]

    def _without_repetition(self) -> tuple[IntArray, IntArray]:
        """Corners and sizes, without corners that repeat the corner before them in a face."""
        face = np.repeat(np.arange(len(self.sizes)), self.sizes)
        before = np.roll(self.corners, 1)
        first = (np.cumsum(self.sizes) - self.sizes)[self.sizes > 0]
        before[first] = self.corners[first + self.sizes[self.sizes > 0] - 1]
        kept = self.corners != before
        return self.corners[kept], np.bincount(face[kept], minlength=len(self.sizes))


def _from_best_corner(vertices: FloatArray, polygons: IntArray) -> IntArray:
    """Polygons of one size, rotated so that a fan from the first corner has the least inversion."""
    position = vertices[polygons]
    size = polygons.shape[1]
    # A triangle of the fan is inverted if its vector area points against that of the polygon.
    onward = np.roll(position, -1, axis=1)
    with np.errstate(all="ignore"):  # positions that are not finite are refused later
        whole = np.cross(position, onward).sum(axis=1)
        worst, best = np.full(len(polygons), -np.inf), np.zeros(len(polygons), np.int64)
        for turn in range(min(size, MOST_STARTS)):
            turned = np.roll(position, -turn, axis=1)
            side = turned[:, 1:] - turned[:, :1]
            areas = (np.cross(side[:, :-1], side[:, 1:]) * whole[:, None]).sum(axis=2)
            least = areas.min(axis=1)
            better = (least > worst) & (worst < 0.0)
            worst[better], best[better] = least[better], turn
    return np.take_along_axis(polygons, (best[:, None] + np.arange(size)) % size, axis=1)
