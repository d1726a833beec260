# SPDX-License-Identifier: GPL-3.0-or-later
"""Snaps points to elements of the shown mesh, by Blender's snap settings.

Snapping is on with Blender's toggle, and Ctrl inverts it, as in Blender. The elements are those
that Blender's popover has chosen; vertices if it has chosen none that a point can snap to.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import bpy
import numpy as np

from ..scene.surface import Surface
from .view import View

if TYPE_CHECKING:
    from ...nicmm_core import SurfacePoints

REACH = 14.0
"""Distance from the mouse up to which a point snaps, in pixels at a scale of 1."""

VERTEX, MIDPOINT, EDGE, CENTRE = "VERTEX", "EDGE_MIDPOINT", "EDGE", "FACE"
"""Blender's names of elements. The centre of a face belongs to *Face*, since points are on faces
anyway."""

ORDER = (VERTEX, MIDPOINT, CENTRE, EDGE)
"""Elements in the order in which they are preferred, since every vertex is on an edge, too."""


@dataclass(frozen=True)
class Snapped:
    """A place on the surface, and the element that it has snapped to; empty for none."""

    place: SurfacePoints
    element: str = ""


def is_on(context: bpy.types.Context, inverted: bool = False) -> bool:
    """Whether points snap; `inverted` tells whether Ctrl is held."""
    return bool(context.tool_settings.use_snap) != inverted


def elements(context: bpy.types.Context) -> tuple[str, ...]:
    """The elements to snap to, the preferred ones first."""
    chosen = context.tool_settings.snap_elements
    return tuple(each for each in ORDER if each in chosen) or (VERTEX,)


def snapped(
    context: bpy.types.Context, view: View, pixel: np.ndarray, place: SurfacePoints, inverted: bool
) -> Snapped:
    """The place to which a place under the mouse snaps, or the place itself."""
    if not is_on(context, inverted):
        return Snapped(place)
    reach = REACH * (context.preferences.system.ui_scale or 1.0)  # 0 without a window
    for element in elements(context):
        found = _nearest(view, pixel, _candidates(view, pixel, place, element), reach)
        if found is not None:
            return Snapped(found, element)
    return Snapped(place)


def _candidates(view: View, pixel: np.ndarray, place: SurfacePoints, element: str) -> SurfacePoints:
    """The places of the polygon under the mouse to which a point can snap."""
    from ...nicmm_core.geometry.snap_targets import snap_targets

    surface: Surface = view.surface
    polygon = surface.polygons[place.faces[0]]
    targets = snap_targets(view.mesh, np.flatnonzero(surface.polygons == polygon))
    if element == VERTEX:
        return targets.vertices
    if element == MIDPOINT:
        return targets.midpoints
    if element == CENTRE:
        return targets.centre
    return targets.on_edges(*(each @ surface.local_to_core.T for each in view.ray(pixel)))


def _nearest(
    view: View, pixel: np.ndarray, places: SurfacePoints, reach: float
) -> SurfacePoints | None:
    """The place nearest to a pixel, if it is within reach."""
    positions = view.surface.points(places.faces, places.barycentric)
    number = view.nearest_point(pixel, positions, reach)
    return None if number is None else places[np.array([number])]
