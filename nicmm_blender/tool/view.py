# SPDX-License-Identifier: GPL-3.0-or-later
"""Maps between the pixels of a viewport and points of a mesh.

Positions are in the object's local space, and pixels are coordinates in the viewport's region.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import bpy
import numpy as np

from ..scene.surface import Surface

if TYPE_CHECKING:
    from ...nicmm_core import Mesh, SurfacePoints

OFFSET = 2e-3
"""Offset towards the eye for drawing and visibility tests, relative to the mesh diagonal."""

SAMPLES, LABEL_CANDIDATES = 256, 64
"""Points of a line at which its distance from others is measured, and places for its label."""

LABEL_ROOM = 12.0
"""Distance in pixels from other lines at which a label clearly belongs to its line."""

BEHIND = 1e-7
"""Step past a hidden face, relative to the rest of the line of sight."""


@dataclass(frozen=True)
class View:
    """A mesh in a viewport's region.

    Attributes
    ----------
    perspective : (4, 4) float array
        Matrix from the object's local space to clip space.
    size : (2,) float array
        Width and height of the region in pixels.
    surface : Surface
        Surface of the mesh object.
    mesh : nicmm_core.Mesh
        The core's mesh of this surface.
    xray : bool
        Whether the mesh hides nothing.
    """

    perspective: np.ndarray
    size: np.ndarray
    surface: Surface
    mesh: Mesh
    xray: bool = False

    def project(self, positions: np.ndarray) -> np.ndarray:
        """Pixels of positions, (n, 2); NaN if they are behind the eye."""
        clip = positions @ self.perspective[:, :3].T + self.perspective[:, 3]
        behind = clip[:, 3] <= 0.0
        depth = np.where(behind, np.nan, clip[:, 3])
        return (clip[:, :2] / depth[:, None] + 1.0) * 0.5 * self.size

    def rays(self, pixels: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Lines of sight through pixels (n, 2): near ends, and the vectors to their far ends."""
        inverse = np.linalg.inv(self.perspective)
        flat = 2.0 * np.asarray(pixels, dtype=np.float64) / self.size - 1.0
        ends = []
        for depth in (-1.0, 1.0):
            clip = np.concatenate([flat, np.tile([depth, 1.0], (len(flat), 1))], axis=1)
            there = clip @ inverse.T
            ends.append(there[:, :3] / there[:, 3:])
        near, far = ends
        return near, far - near

    def ray(self, pixel: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Line of sight through a pixel: near end, and the vector to its far end."""
        (near,), (direction,) = self.rays(np.asarray(pixel, dtype=np.float64)[None])
        return near, direction

    def pixel_size(self, position: np.ndarray) -> float:
        """Width of a pixel at the depth of a position, (3,), in local space."""
        pixel = self.project(position[None])[0]
        near, direction = self.rays(np.array([pixel, pixel + [1.0, 0.0]]))
        share = np.linalg.norm(position - near[0]) / np.linalg.norm(direction[0])
        places = near + share * direction
        return float(np.linalg.norm(places[1] - places[0]))

    def surface_point_at(self, pixel: np.ndarray) -> SurfacePoints | None:
        """The visible point of the surface under a pixel, as a point of the core, or None."""
        origin, direction = self.ray(pixel)
        points, _ = self._first_hits(origin[None], direction[None])
        return points if points.faces[0] >= 0 else None

    def visible(self, positions: np.ndarray) -> np.ndarray:
        """Which positions are in view and not hidden by the mesh, (n,)."""
        if not len(positions):
            return np.zeros(0, dtype=bool)
        pixels = self.project(positions)
        seen = np.isfinite(pixels).all(axis=1)
        if self.xray:
            return seen
        origins, _ = self.rays(np.where(seen[:, None], pixels, 0.0))
        directions = np.where(seen[:, None], positions, origins) - origins
        lengths = np.linalg.norm(directions, axis=1)
        _, along = self._first_hits(origins, directions)
        room = OFFSET * self.surface.diagonal / np.maximum(lengths, np.finfo(float).tiny)
        return seen & (along >= 1.0 - room)

    def nearest_point(self, pixel: np.ndarray, positions: np.ndarray, reach: float) -> int | None:
        """The index of the visible position nearest to a pixel, or None if none is within reach.

        `reach` is in pixels.
        """
        away = np.linalg.norm(self.project(positions) - pixel, axis=1)
        near = np.flatnonzero(away <= reach)  # False for NaN
        near = near[self.visible(positions[near])]
        return int(near[away[near].argmin()]) if len(near) else None

    def nearest_on_line(
        self, pixel: np.ndarray, line: np.ndarray, reach: float, radius: float = 0.0
    ) -> tuple[int, float] | None:
        """The segment of a polyline (n, 3) nearest to a pixel, and the fraction along the segment.

        None if no visible part is within `reach` pixels. A line with a radius is shown as a tube,
        whose surface may be visible even where the line itself is hidden.
        """
        if len(line) < 2:
            return None
        flat = self.project(line)
        start, step = flat[:-1], np.diff(flat, axis=0)
        squared = np.maximum((step * step).sum(axis=1), np.finfo(float).tiny)
        share = np.clip(((pixel - start) * step).sum(axis=1) / squared, 0.0, 1.0)
        away = np.linalg.norm(start + share[:, None] * step - pixel, axis=1)
        near = np.flatnonzero(away <= np.maximum(reach, self._in_pixels(line[:-1], radius)))
        if len(near):
            at = share[near][:, None]
            centres = (1.0 - at) * line[near] + at * line[near + 1]
            seen = self.visible(centres)
            if radius > 0.0 and not seen.all():
                seen |= self.visible(self._towards(pixel, centres, radius))
            near = near[seen]
        if not len(near):
            return None
        best = int(near[away[near].argmin()])
        return best, float(share[best])

    def label_places(self, lines: list[np.ndarray]) -> np.ndarray:
        """Pixels for a label beside each polyline, (n, 2); NaN if no part of a line is in view.

        They are where a line is farthest from the others and from earlier labels, on a visible part
        unless it runs beside another line there.
        """
        samples = [
            line[np.linspace(0, len(line) - 1, min(len(line), SAMPLES)).astype(int)]
            for line in lines
        ]
        flat = [self.project(each) for each in samples]
        places = np.full((len(lines), 2), np.nan)
        for number, sample in enumerate(samples):
            step = max(len(sample) // LABEL_CANDIDATES, 1)
            pixels = flat[number][::step]
            inside = ((pixels >= 0.0) & (pixels <= self.size)).all(axis=1)
            if not inside.any():
                continue
            others = [other for each, other in enumerate(flat) if each != number]
            there = np.concatenate([*others, places])
            there = there[np.isfinite(there).all(axis=1)]
            away = np.linalg.norm(pixels[:, None] - there, axis=2).min(axis=1, initial=np.inf)
            clear = inside & (away > LABEL_ROOM) & self.visible(sample[::step])
            away[~(clear if clear.any() else inside)] = -1.0
            places[number] = pixels[away.argmax()]
        return places

    def _first_hits(
        self, origins: np.ndarray, directions: np.ndarray
    ) -> tuple[SurfacePoints, np.ndarray]:
        """Where rays in local space, (n, 3), first meet faces that are not hidden.

        The distances along the rays are in lengths of their directions; infinite for a miss.
        """
        from ...nicmm_core.geometry.surface_points import first_hits, joined

        origins, directions = (
            each @ self.surface.local_to_core.T for each in (origins, directions)
        )
        points, along = first_hits(self.mesh, origins, directions)
        hidden = self.surface.hidden
        while len(again := np.flatnonzero((points.faces >= 0) & hidden[points.faces])):
            # Continue behind the hidden face, by a step that exceeds rounding errors.
            passed = along[again] + BEHIND
            begins = origins[again] + passed[:, None] * directions[again]
            further, beyond = first_hits(self.mesh, begins, directions[again])
            along[again] = passed + beyond
            index = np.arange(len(along))
            index[again] = len(along) + np.arange(len(again))
            points = joined([points, further])[index]
        return points, along

    def _in_pixels(self, positions: np.ndarray, radius: float) -> np.ndarray:
        """Size in pixels, (n,), of a length parallel to the screen at each position."""
        depth = positions @ self.perspective[3, :3] + self.perspective[3, 3]
        across = 0.5 * self.size[0] * np.linalg.norm(self.perspective[0, :3])
        return radius * across / np.maximum(depth, np.finfo(float).tiny)

    def _towards(self, pixel: np.ndarray, centres: np.ndarray, radius: float) -> np.ndarray:
        """Points where the line of sight through a pixel enters spheres about the centres.

        For a sphere that the line of sight misses, the point of its outline nearest to that line.
        """
        origin, direction = self.ray(pixel)
        direction = direction / np.linalg.norm(direction)
        along = (centres - origin) @ direction
        across = origin + along[:, None] * direction - centres
        away = np.linalg.norm(across, axis=1)
        across *= np.minimum(1.0, radius / np.maximum(away, np.finfo(float).tiny))[:, None]
        depth = np.sqrt(np.maximum(radius**2 - np.minimum(away, radius) ** 2, 0.0))
        return centres + across - depth[:, None] * direction


def view_of(
    region: bpy.types.Region,
    region_3d: bpy.types.RegionView3D,
    mesh_object: bpy.types.Object,
    surface: Surface,
    mesh: Mesh,
    xray: bool = False,
) -> View:
    """The view of a viewport's region."""
    perspective = np.array(region_3d.perspective_matrix @ mesh_object.matrix_world)
    size = np.array([region.width, region.height], float)
    return View(perspective, size, surface, mesh, xray)
