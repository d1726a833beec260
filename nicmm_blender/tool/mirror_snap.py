# SPDX-License-Identifier: GPL-3.0-or-later
"""Snaps points to the plane of a mirror, where a curve joined to its mirror image crosses it."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ..outputs.edited_curve import Opened
from ..scene import surface_cache
from .view import View

if TYPE_CHECKING:
    from ...nicmm_core import SurfacePoints

REACH = 8.0
"""Distance from the plane up to which a point snaps to it, in pixels at a scale of 1."""


def ends(opened: Opened, count: int) -> set[int]:
    """The indices of those of `count` control points that may be on the plane."""
    if opened.mirror is None or not opened.mirror.joined or not count:
        return set()
    return {0, count - 1} if opened.settings.closed else {count - 1}


def may_be_inserted_on_plane(opened: Opened, number: int) -> bool:
    """Whether a point that is inserted at an index may be on the plane."""
    return number in ends(opened, len(opened.points) + 1)


def may_end_on_plane(opened: Opened) -> bool:
    """Whether a new last point may be on the plane; an open curve needs one before it."""
    return bool(ends(opened, len(opened.points) + opened.settings.closed))


def snapped(view: View, opened: Opened, place: SurfacePoints, scale: float) -> SurfacePoints:
    """A point on the surface, moved to the plane if it appears near to it in the viewport."""
    section = opened.section
    if section is None:
        return place
    (position,) = place.positions(surface_cache.core_mesh(opened.surface))
    nearest = section.nearest(position)
    if nearest is None:
        return place
    both = [opened.surface.points(each.faces, each.barycentric)[0] for each in (place, nearest)]
    one, other = view.project(np.array(both))
    return nearest if np.linalg.norm(one - other) <= REACH * scale else place
