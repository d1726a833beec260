"""The section of a mesh with a plane, as segments in its faces."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .array_types import FloatArray, IntArray
from .mesh import Mesh
from .mirror import ON_PLANE, Plane
from .surface_points import SurfacePoints, snapped
from .tolerances import TINY


@dataclass(frozen=True)
class PlaneSection:
    """Where a plane cuts a mesh.

    Attributes
    ----------
    faces : (m,) int array
        The face of each segment.
    barycentric : (m, 2, 3) float array
        Coordinates of its ends in this face.
    positions : (m, 2, 3) float array
        Positions of its ends.
    """

    faces: IntArray
    barycentric: FloatArray
    positions: FloatArray

    def nearest(self, position: FloatArray) -> SurfacePoints | None:
        """The point of the section nearest to a position, (3,); None if the section is empty."""
        if not len(self.faces):
            return None
        start = self.positions[:, 0]
        step = self.positions[:, 1] - start
        squared = np.maximum((step * step).sum(axis=1), TINY)
        along = np.clip(((position - start) * step).sum(axis=1) / squared, 0.0, 1.0)
        away = np.linalg.norm(start + along[:, None] * step - position, axis=1)
        best = int(away.argmin())
        one, other = self.barycentric[best]
        weights = (1.0 - along[best]) * one + along[best] * other
        return snapped(SurfacePoints(self.faces[best : best + 1], weights[None]))


def plane_section(mesh: Mesh, plane: Plane) -> PlaneSection:
    """Cut a mesh with a plane. Faces that lie in the plane are left out, but not their edges."""
    heights = plane.heights(mesh.vertices)
    heights[np.abs(heights) <= 0.5 * ON_PLANE * mesh.diagonal] = 0.0
    side = np.sign(heights).astype(np.int64)[mesh.faces]
    on = (side == 0).sum(axis=1)
    crosses = (side.min(axis=1) < 0) & (side.max(axis=1) > 0)
    faces = np.flatnonzero(crosses | (on == 2))
    of_face = heights[mesh.faces[faces]]
    # Six candidates for two ends: the three corners, and a point of each of the three edges.
    following = np.roll(of_face, -1, axis=1)
    cut = of_face * following < 0.0
    share = np.where(cut, of_face / np.where(cut, of_face - following, 1.0), 0.0)
    unit = np.eye(3)
    on_edges = (1.0 - share)[:, :, None] * unit + share[:, :, None] * np.roll(unit, -1, axis=0)
    candidates = np.concatenate([np.broadcast_to(unit, (len(faces), 3, 3)), on_edges], axis=1)
    is_end = np.concatenate([of_face == 0.0, cut], axis=1)
    ends = np.argsort(~is_end, axis=1, kind="stable")[:, :2]
    barycentric = np.take_along_axis(candidates, ends[:, :, None], axis=1)
    positions = barycentric @ mesh.vertices[mesh.faces[faces]]
    return PlaneSection(faces, barycentric, positions)
