# SPDX-License-Identifier: GPL-3.0-or-later
"""Maps between the pixels of a viewport and points of a mesh.

Positions of the mesh are in the object's local space, pixels in the region.
"""

from dataclasses import dataclass

import numpy as np

OFFSET = 2e-3
"""Offset towards the eye in drawing and in tests of visibility, in mesh diagonals."""

BEHIND = 1e-7
"""Step past a hidden face, relative to the visible depth."""


@dataclass(frozen=True)
class View:
    """A mesh in a viewport's region.

    `perspective` is the (4, 4) matrix from the object's local space to clip space, `size` the
    region's width and height in pixels; `surface` is the `surface.Surface` and `mesh` the
    core's mesh of them.
    """

    perspective: np.ndarray
    size: np.ndarray
    surface: object
    mesh: object

    def project(self, positions: np.ndarray) -> np.ndarray:
        """Pixels of positions, (n, 2); NaN if they are behind the eye."""
        clip = positions @ self.perspective[:, :3].T + self.perspective[:, 3]
        behind = clip[:, 3] <= 0.0
        depth = np.where(behind, np.nan, clip[:, 3])
        return (clip[:, :2] / depth[:, None] + 1.0) * 0.5 * self.size

    def ray(self, pixel) -> tuple[np.ndarray, np.ndarray]:
        """The near end of a pixel's line of sight in the view, and the vector to its far end."""
        inverse = np.linalg.inv(self.perspective)
        flat = 2.0 * np.asarray(pixel, dtype=np.float64) / self.size - 1.0
        ends = np.array([[*flat, -1.0, 1.0], [*flat, 1.0, 1.0]]) @ inverse.T
        near, far = ends[:, :3] / ends[:, 3:]
        return near, far - near

    def place_at(self, pixel) -> tuple[int, np.ndarray] | None:
        """Face and barycentrics of the surface under a pixel; None off the mesh."""
        from ...nicmm_core.geometry.surface_points import first_hits

        origin, direction = (vector[None] @ self.surface.linear.T for vector in self.ray(pixel))
        while True:
            points, along = first_hits(self.mesh, origin, direction)
            face = int(points.faces[0])
            if face < 0 or not self.surface.hidden[face]:
                return None if face < 0 else (face, points.barycentric[0])
            # Behind the hidden face; each step passes it by more than rounding.
            origin = origin + (along[0] + BEHIND) * direction
            direction = direction * max(1.0 - along[0] - BEHIND, 0.0)

    def visible(self, positions: np.ndarray) -> np.ndarray:
        """Which positions are not hidden by the mesh, (n,)."""
        from ...nicmm_core.geometry.surface_points import first_hits

        if not len(positions):
            return np.zeros(0, dtype=bool)
        pixels = self.project(positions)
        seen = np.isfinite(pixels).all(axis=1)
        origins = np.array([self.ray(pixel)[0] for pixel in np.where(seen[:, None], pixels, 0.0)])
        directions = positions - origins
        lengths = np.linalg.norm(directions, axis=1)
        linear = self.surface.linear.T
        _, along = first_hits(self.mesh, origins @ linear, directions @ linear)
        room = OFFSET * self.surface.diagonal / np.maximum(lengths, np.finfo(float).tiny)
        return seen & (along >= 1.0 - room)

    def nearest_point(self, pixel, positions: np.ndarray, reach: float) -> int | None:
        """The visible position nearest to a pixel, if it is within reach."""
        away = np.linalg.norm(self.project(positions) - pixel, axis=1)
        near = np.flatnonzero(away <= reach)  # NaN is not
        near = near[self.visible(positions[near])]
        return int(near[away[near].argmin()]) if len(near) else None

    def nearest_on_line(self, pixel, line: np.ndarray, reach: float) -> tuple[int, float] | None:
        """The segment of a polyline, (n, 3), nearest to a pixel, and the fraction along it.

        None if no visible part is within reach.
        """
        flat = self.project(line)
        start, step = flat[:-1], np.diff(flat, axis=0)
        squared = np.maximum((step * step).sum(axis=1), np.finfo(float).tiny)
        share = np.clip(((pixel - start) * step).sum(axis=1) / squared, 0.0, 1.0)
        away = np.linalg.norm(start + share[:, None] * step - pixel, axis=1)
        near = np.flatnonzero(away <= reach)
        if len(near):
            at = share[near][:, None]
            near = near[self.visible((1.0 - at) * line[near] + at * line[near + 1])]
        if not len(near):
            return None
        best = int(near[away[near].argmin()])
        return best, float(share[best])


def view_of(region, region_3d, mesh_object, surface, mesh) -> View:
    """The view of a viewport's region."""
    perspective = np.array(region_3d.perspective_matrix @ mesh_object.matrix_world)
    return View(perspective, np.array([region.width, region.height], float), surface, mesh)
