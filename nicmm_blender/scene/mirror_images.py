# SPDX-License-Identifier: GPL-3.0-or-later
"""Mirror images of control points, and how the points and legs of a symmetric curve correspond.

A record stores only the control points of one side; their images follow from the mirror.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from ...nicmm_core.options import FEWEST_CLOSED, FEWEST_OPEN
from . import surface_cache
from .mirror_plane import Mirror
from .surface import Surface

if TYPE_CHECKING:
    from ...nicmm_core import SurfaceCurve, SurfacePoints
    from .control_points import ControlPoints


@dataclass(frozen=True)
class Images:
    """Mirror images of control points that are not on the plane.

    Attributes
    ----------
    owners : (m,) int array
        The index of the control point of each image.
    places : SurfacePoints of the core
    """

    owners: np.ndarray
    places: SurfacePoints


def sides_of(surface: Surface, mirror: Mirror, places: SurfacePoints) -> np.ndarray:
    """On which side of the plane points are, (k,): 1, -1, or 0 on the plane."""
    from ...nicmm_core.geometry.mirror import ON_PLANE

    mesh = surface_cache.core_mesh(surface)
    heights = mirror.plane.heights(places.positions(mesh))
    return np.where(np.abs(heights) <= ON_PLANE * mesh.diagonal, 0, np.sign(heights)).astype(int)


def reflected(surface: Surface, mirror: Mirror, places: SurfacePoints) -> SurfacePoints:
    """The places of the surface nearest to the mirror images of points."""
    from ...nicmm_core.geometry.surface_points import nearest_points

    mesh = surface_cache.core_mesh(surface)
    return nearest_points(mesh, mirror.plane.reflected(places.positions(mesh)))[0]


def images_of(surface: Surface, mirror: Mirror | None, points: ControlPoints) -> Images:
    """The images of control points."""
    places = points.places
    if mirror is None or not len(points):
        return Images(np.zeros(0, dtype=np.int64), places[np.zeros(0, dtype=np.int64)])
    owners = np.flatnonzero(sides_of(surface, mirror, places))
    return Images(owners, reflected(surface, mirror, places[owners]))


def on_given_side(
    surface: Surface, mirror: Mirror, place: SurfacePoints, others: SurfacePoints
) -> SurfacePoints:
    """A point on the side of the other control points, or its mirror image if it is opposite."""
    (side,), of_others = sides_of(surface, mirror, place), sides_of(surface, mirror, others)
    if side and (of_others == -side).any():
        return reflected(surface, mirror, place)
    return place


@dataclass(frozen=True)
class Half:
    """What the core makes of the control points of a curve that is joined to its mirror image.

    Attributes
    ----------
    count : int
        Number of the control points.
    total : int
        Number of them and their images.
    first_on_plane, last_on_plane : bool
        Whether the first and the last point are on the plane. Neither is if there are no points.
    """

    count: int
    total: int
    first_on_plane: bool
    last_on_plane: bool

    def is_enough(self, closed: bool) -> bool:
        """Whether the points determine a curve; two on the plane become a closed one with more."""
        return self.total >= FEWEST_OPEN and not (
            closed and self.count > 1 and self.total < FEWEST_CLOSED
        )

    def path(self) -> tuple[int, bool]:
        """Number of points and closedness of an open curve with the same legs.

        The plane counts as another point if the last leg leads to it.
        """
        return self.count + (not self.last_on_plane and self.count > 0), False

    def leg_of(self, leg: int) -> int:
        """The leg of the given points of which a leg of the whole curve is part or mirror image.

        -1 for the leg that leads from the first point of a closed curve to its image.
        """
        owners = np.arange(self.count)
        back = owners[self.first_on_plane : self.count - self.last_on_plane][::-1]
        whole = np.concatenate([owners, back])
        ends = whole[leg], whole[(leg + 1) % len(whole)]
        if ends[0] != ends[1]:
            return int(min(ends))
        return self.count - 1 if leg == self.count - 1 else -1


def half_of(surface: Surface, mirror: Mirror, places: SurfacePoints) -> Half:
    """The half of a curve through points that is joined to its mirror image."""
    sides = sides_of(surface, mirror, places)
    on_plane = [bool(len(sides)) and not sides[end] for end in (0, -1)]
    return Half(len(sides), len(sides) + int(np.count_nonzero(sides)), *on_plane)


def path_of(
    surface: Surface, mirror: Mirror | None, places: SurfacePoints, closed: bool
) -> tuple[int, bool]:
    """Number of points and closedness of a curve that has as many legs, without a mirror."""
    if mirror is None or not mirror.joined:
        return len(places), closed
    return half_of(surface, mirror, places).path()


def corners_along(
    curves: list[SurfaceCurve], corners: np.ndarray, mirror: Mirror | None
) -> np.ndarray:
    """Which of all control points of curves are corners, images included.

    Parameters
    ----------
    curves : list of SurfaceCurve
    corners : (k,) bool array
        Whether each control point of the given side is a corner.
    mirror : Mirror or None
    """
    if mirror is None or not curves:
        return corners
    if not mirror.joined:
        return np.tile(corners, len(curves))
    (curve,) = curves
    count, total = len(corners), len(curve.control_index)
    positions = curve.points[curve.control_index[:count]]
    away = np.abs(mirror.plane.heights(positions))
    # At most the two ends of the half are on the plane, and have no images.
    ends = [0, count - 1] if curve.closed else [count - 1]
    ends = sorted(set(ends), key=lambda end: away[end])[: 2 * count - total]
    return np.concatenate([corners, np.delete(corners, ends)[::-1]])


def controls_of(curves: list[SurfaceCurve], count: int) -> SurfacePoints:
    """The first control points of the first curve, which are those of the given side."""
    from ...nicmm_core import SurfacePoints

    index = curves[0].control_index[:count]
    return SurfacePoints(curves[0].faces[index], curves[0].barycentric[index])
