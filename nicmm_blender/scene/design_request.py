# SPDX-License-Identifier: GPL-3.0-or-later
"""A request for a curve as plain arrays: read from Blender's data, then answered by the core.

The main thread reads the data. `answer` does not access Blender's data, so it can run in time
slices (`operators.time_slices`).
"""

from __future__ import annotations

import contextlib
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import bpy
import numpy as np

from ...nicmm_core.options import FEWEST_CLOSED, FEWEST_OPEN
from . import curve_record, surface_cache
from .control_points import ControlPoints
from .curve_record import CurveSettings
from .lookup import by_uid
from .messages import InputError, user_message
from .surface import Surface, group_weights, read

if TYPE_CHECKING:
    from ...nicmm_core import Design, SurfaceCurve, SurfacePoints
    from ...nicmm_core.progress import Progress

    Answer = Design | Exception
    """What a request leads to."""


@dataclass(frozen=True)
class DesignRequest:
    """Everything that a curve depends on.

    `points`, `options` and `start` are arguments for the core. `moved` counts the control points
    that were moved to the nearest point of the surface because their triangles no longer exist.
    """

    mesh_name: str
    mesh_uid: int
    surface: Surface
    points: np.ndarray | SurfacePoints
    order: str
    settings: CurveSettings
    options: dict[str, Any]
    start: Design | SurfaceCurve | None = None
    moved: int = 0

    def mesh_object(self) -> bpy.types.Object | None:
        """The mesh object, or None if it has been removed."""
        return by_uid(self.mesh_uid)

    def check_unchanged(self) -> None:
        """Raise an error if the mesh has changed since it was read."""
        found = self.mesh_object()
        if found and surface_cache.cached(found, self.surface.with_modifiers) is self.surface:
            return
        now = found and read(found, self.surface.with_modifiers, traced=False)
        if not now or not (
            np.array_equal(now.core_positions, self.surface.core_positions)
            and np.array_equal(now.faces, self.surface.faces)
        ):
            raise InputError(
                f'"{self.mesh_name}" changed while the curve was being computed. Draw the curve '
                "again"
            )

    def in_world(self, core_positions: np.ndarray) -> np.ndarray:
        """World positions of points (n, 3) that are given in the space of the core."""
        local = core_positions @ np.linalg.inv(self.surface.local_to_core).T
        local_to_world = self.surface.local_to_world
        return local @ local_to_world[:3, :3].T + local_to_world[:3, 3]


def for_points(
    mesh_object: bpy.types.Object,
    surface: Surface,
    points: np.ndarray | SurfacePoints,
    order: str,
    settings: CurveSettings,
) -> DesignRequest:
    """A request for a curve through points on a surface.

    Parameters
    ----------
    mesh_object : bpy.types.Object
        The mesh object.
    surface : Surface
        Its surface.
    points : int array or SurfacePoints
        Control points as the core takes them.
    order : {"given", "shortest"}
        Order of the control points, by the core's name.
    settings : CurveSettings
        Settings of the curve.
    """
    options = curve_record.arguments_of(
        settings,
        lambda name: group_weights(mesh_object, name, surface.with_modifiers) if name else None,
    )
    options["clearance"] /= surface.unit
    return DesignRequest(
        mesh_name=mesh_object.name,
        mesh_uid=mesh_object.session_uid,
        surface=surface,
        points=points,
        order=order,
        settings=settings,
        options=options,
    )


def for_drawing(
    mesh_object: bpy.types.Object, surface: Surface, points: ControlPoints, settings: CurveSettings
) -> DesignRequest:
    """A request for a curve that is drawn point by point; with two points it is always open."""
    request = for_points(mesh_object, surface, points.places, "given", settings)
    closed = settings.closed and len(points) >= FEWEST_CLOSED
    # Other methods have no corners.
    corners = corner_indices(points.corners) if settings.method == "ELASTIC" else None
    return replace(request, options={**request.options, "closed": closed, "corners": corners})


def corner_indices(corners: np.ndarray) -> list[int] | None:
    """The argument `corners` of the core for control points that are corners or not, (k,)."""
    return np.flatnonzero(corners).tolist() or None


def corners_of(request: DesignRequest, design: Design) -> np.ndarray:
    """Whether each control point of a designed curve is a corner, in the order visited, (k,)."""
    if design.resumable is None:  # of a method without corners
        passed = [curve.control_index >= 0 for curve in design.curves]
        return np.zeros(np.concatenate(passed).sum(), dtype=bool)
    return np.isin(design.resumable.visited, request.options["corners"] or [])


def for_curve(
    curve_object: bpy.types.Object,
    mesh_object: bpy.types.Object,
    surface: Surface,
    settings: CurveSettings,
) -> DesignRequest:
    """A request to design a curve again on the current surface, along the same course."""
    points, moved = curve_record.current_control_points(curve_object, mesh_object, surface)
    if len(points) < FEWEST_OPEN:
        raise InputError(curve_record.no_curve_message(curve_object))
    request = for_drawing(mesh_object, surface, points, settings)
    start = None
    if settings.method == "ELASTIC" and curve_record.lies_on(curve_object, surface):
        curves = curve_record.read_curves(curve_object, surface)
        if len(curves) == 1:
            start = surface_cache.design_of(surface, curves[0]) or curves[0]
    return replace(request, start=start, moved=moved)


def answer(request: DesignRequest, progress: Progress) -> Design:
    """Design the curve with the core, without access to Blender's data."""
    from ... import nicmm_core as nicmm

    settings = request.settings
    with surface_cache.designer_of(request.surface) as designer:
        arguments = {"order": request.order, "progress": progress, **request.options}
        try:
            design = None
            if request.start is not None:
                # If the curve cannot keep its course, the core searches for a new one below.
                with contextlib.suppress(nicmm.CurveError):
                    design = designer.design(request.points, start=request.start, **arguments)
            if design is None:
                design = designer.design(request.points, **arguments)
            surface_cache.store_design(request.surface, design)
            return design
        except nicmm.NicmmError as error:
            vertices = request.points if isinstance(request.points, np.ndarray) else None
            at = vertices if vertices is not None and vertices.ndim == 1 else None
            raise InputError(user_message(error, settings.obstacle_group, at)) from error
