# SPDX-License-Identifier: GPL-3.0-or-later
"""A request for a curve as plain arrays: read from Blender's data, then answered by the core.

The main thread reads the data. `answer` does not access Blender's data, so it can run in time
slices (`operators.time_slices`).
"""

from __future__ import annotations

import contextlib
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import bpy
import numpy as np

from ...nicmm_core.options import FEWEST_CLOSED, FEWEST_OPEN
from . import avoided_curves, curve_record, junctions, mirror_images, mirror_plane, surface_cache
from .control_points import ControlPoints
from .curve_record import CurveSettings
from .junctions import Junction, OtherCurve
from .lookup import by_uid
from .messages import InputError, user_message
from .mirror_plane import Mirror
from .surface import Surface, group_weights, read
from .via_points import ViaPoints

if TYPE_CHECKING:
    from ...nicmm_core import Design, Designer, SurfaceCurve, SurfacePoints
    from ...nicmm_core.progress import Progress

    Answer = Design | Exception
    """What a request leads to."""


@dataclass(frozen=True)
class DesignRequest:
    """Everything that a curve depends on.

    `points`, `options` and `start` are arguments for the core; `options` has the via points, too,
    and the mirror of a curve that is joined to its mirror image. With a `leg`, only other courses
    of this leg of the start are sought. `moved` counts the control points that were moved to the
    nearest point of the surface because their triangles no longer exist.

    `others` are the curves to avoid; the options have their curves, too. `junctions` are control
    points that follow them. `curve_uid` is the session_uid of the curve object, 0 for a new one.
    """

    mesh_name: str
    mesh_uid: int
    surface: Surface
    points: np.ndarray | SurfacePoints
    order: str
    settings: CurveSettings
    options: dict[str, Any]
    via: ViaPoints | None = None
    start: Design | SurfaceCurve | None = None
    leg: int | None = None
    moved: int = 0
    mirror: Mirror | None = None
    curve_uid: int = 0
    others: tuple[OtherCurve, ...] = ()
    junctions: tuple[Junction, ...] = ()

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


def for_points(
    mesh_object: bpy.types.Object,
    surface: Surface,
    points: np.ndarray | SurfacePoints,
    order: str,
    settings: CurveSettings,
    curve_object: bpy.types.Object | None = None,
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
    curve_object : bpy.types.Object, optional
        The curve object; by default the curve is new.
    """
    if settings.method != "ELASTIC":  # other methods have no mirror
        settings = replace(settings, mirror_axis=mirror_plane.NONE)
    mirror = mirror_plane.mirror_of(mesh_object, surface, settings)
    options = curve_record.arguments_of(
        settings,
        lambda name: group_weights(mesh_object, name, surface.with_modifiers) if name else None,
    )
    options["clearance"] /= surface.unit
    if mirror is not None and mirror.joined:
        if settings.avoids:
            raise InputError(
                "A curve that is joined to its mirror image cannot avoid other curves. Turn Avoid "
                "Other Curves off, set Mirror As to Pair, or set Mirror to None"
            )
        options["mirror"] = mirror.argument()
    request = DesignRequest(
        mesh_name=mesh_object.name,
        mesh_uid=mesh_object.session_uid,
        surface=surface,
        points=points,
        order=order,
        settings=settings,
        options=options,
        mirror=mirror,
        curve_uid=0 if curve_object is None else curve_object.session_uid,
    )
    return with_others(request, avoided_curves.above(curve_object, mesh_object, surface, settings))


def with_others(request: DesignRequest, others: tuple[OtherCurve, ...]) -> DesignRequest:
    """A request that avoids other curves, with its junctions on them."""
    from ...nicmm_core.geometry.surface_points import locate_points

    curves = [curve for other in others for curve in other.curves]
    options = {**request.options, "avoid": curves or None}
    if not others and options["obstacles"] is None:
        options["clearance"] = 0.0
    if not curves:
        return replace(request, options=options, others=others)
    mesh = surface_cache.core_mesh(request.surface)
    given = locate_points(mesh, request.points, "control_points")
    points = junctions.followed(mesh, given, request.junctions, others)
    points = junctions.snapped(mesh, points, others)
    if points is given:  # messages name vertices that were given
        return replace(request, options=options, others=others)
    return replace(request, points=points, options=options, others=others)


NewCurves = dict[int, "tuple[SurfaceCurve, ...]"]
"""Curves that were designed anew, by the session_uid of their objects."""


def resolved(requests: Sequence[DesignRequest], answers: Sequence[Answer]) -> list[DesignRequest]:
    """Requests that were answered one after another, with the curves that each of them avoided."""
    designed: NewCurves = {}
    found = []
    for request, answer in zip(requests, answers, strict=False):  # the rest was cancelled
        found.append(with_new_curves(request, designed))
        designed |= new_curves(request, answer)
    return found + list(requests[len(found) :])


def new_curves(request: DesignRequest, answer: Answer) -> NewCurves:
    """The curves in the answer to a request for an existing object; possibly empty."""
    if not request.curve_uid or isinstance(answer, Exception) or not answer.curves:
        return {}
    return {request.curve_uid: tuple(answer.curves)}


def with_new_curves(request: DesignRequest, designed: NewCurves) -> DesignRequest:
    """A request that avoids new curves instead of the former ones of their objects."""
    if not any(other.uid in designed for other in request.others):
        return request
    others = (
        OtherCurve(other.uid, other.name, designed[other.uid]) if other.uid in designed else other
        for other in request.others
    )
    return with_others(request, tuple(others))


def for_drawing(
    mesh_object: bpy.types.Object,
    surface: Surface,
    points: ControlPoints,
    via: ViaPoints,
    settings: CurveSettings,
    curve_object: bpy.types.Object | None = None,
) -> DesignRequest:
    """A request for a curve that is drawn point by point; with two points it is always open."""
    request = for_points(mesh_object, surface, points.places, "given", settings, curve_object)
    total, mirror = len(points), request.mirror
    if mirror is not None and mirror.joined:
        total = mirror_images.half_of(surface, mirror, points.places).total
    closed = settings.closed and total >= FEWEST_CLOSED
    # Other methods have no corners.
    corners = corner_indices(points.corners) if settings.method == "ELASTIC" else None
    options = {**request.options, "closed": closed, "corners": corners}
    path = mirror_images.path_of(surface, mirror, points.places, closed)
    return with_via_points(replace(request, options=options), via.fitting(*path))


def is_enough(
    surface: Surface, mirror: Mirror | None, points: ControlPoints, settings: CurveSettings
) -> bool:
    """Whether a curve that is drawn point by point has enough points."""
    if mirror is None or not mirror.joined:
        return len(points) >= FEWEST_OPEN
    return mirror_images.half_of(surface, mirror, points.places).is_enough(settings.closed)


def with_via_points(request: DesignRequest, via: ViaPoints) -> DesignRequest:
    """A request with via points; they need the order "given"."""
    if not len(via):
        return request
    return replace(request, via=via, options={**request.options, "via_points": via.by_leg()})


def corner_indices(corners: np.ndarray) -> list[int] | None:
    """The argument `corners` of the core for control points that are corners or not, (k,)."""
    return np.flatnonzero(corners).tolist() or None


def corners_of(request: DesignRequest, design: Design) -> np.ndarray:
    """Whether each control point of a designed curve is a corner, in the order visited, (k,).

    Without the mirror images of control points.
    """
    if design.resumable is None:  # of a method without corners
        passed = [curve.control_index >= 0 for curve in design.curves]
        return np.zeros(np.concatenate(passed).sum(), dtype=bool)
    visited = design.resumable.visited
    if request.mirror is not None:
        visited = visited[: len(request.points)]
    return np.isin(visited, request.options["corners"] or [])


def for_curve(
    curve_object: bpy.types.Object,
    mesh_object: bpy.types.Object,
    surface: Surface,
    settings: CurveSettings,
) -> DesignRequest:
    """A request to design a curve again on the current surface, along the same course."""
    points, moved = curve_record.current_control_points(curve_object, mesh_object, surface)
    mirror = mirror_plane.mirror_of(mesh_object, surface, settings)
    if not is_enough(surface, mirror, points, settings):
        raise InputError(curve_record.no_curve_message(curve_object))
    via = curve_record.current_via_points(curve_object, mesh_object, surface)
    request = for_drawing(mesh_object, surface, points, via, settings, curve_object)
    if request.others:
        follows = tuple(curve_record.junctions_of(curve_object))
        request = with_others(replace(request, junctions=follows), request.others)
    start = None
    if settings.method == "ELASTIC" and curve_record.lies_on(curve_object, surface):
        curves = curve_record.read_curves(curve_object, surface)
        if len(curves) == 1 or is_pair(curve_record.settings_of(curve_object)):
            start = surface_cache.design_of(surface, curves[0]) or curves[0]
    return replace(request, start=start, moved=moved)


def is_pair(settings: CurveSettings) -> bool:
    """Whether the second curve of an object is the mirror image of the first."""
    has_mirror = settings.mirror_axis != mirror_plane.NONE and settings.method == "ELASTIC"
    return has_mirror and settings.mirror_as == mirror_plane.PAIR


def answer(request: DesignRequest, progress: Progress) -> Design:
    """Design the curve with the core, without access to Blender's data."""
    from ... import nicmm_core as nicmm

    for other in request.others:
        if other.problem:
            raise InputError(other.problem)
    with surface_cache.designer_of(request.surface) as designer:
        arguments = {"order": request.order, "progress": progress, **request.options}
        try:
            design = None
            if request.leg is not None:
                return with_image(designer, request, _leg_courses(designer, request, progress))
            if request.start is not None:
                # If the curve cannot keep its course, the core searches for a new one below.
                with contextlib.suppress(nicmm.CurveError):
                    design = designer.design(request.points, start=request.start, **arguments)
            if design is None:
                design = designer.design(request.points, **arguments)
            surface_cache.store_design(request.surface, design)
            return with_image(designer, request, design)
        except nicmm.NicmmError as error:
            raise InputError(message_of(error, request)) from error


def message_of(error: Exception, request: DesignRequest) -> str:
    """The message for the user about an error of the core."""
    vertices = request.points if isinstance(request.points, np.ndarray) else None
    at = vertices if vertices is not None and vertices.ndim == 1 else None
    avoided = [other.name for other in request.others for _ in other.curves]
    return user_message(error, request.settings.obstacle_group, at, avoided)


def with_image(designer: Designer, request: DesignRequest, design: Design) -> Design:
    """A design with the mirror image as a second curve, if the request asks for a pair.

    The image has to avoid the same curves. Alternatives whose mirror images do not, or do not
    exist, are left out.
    """
    from ... import nicmm_core as nicmm

    mirror = request.mirror
    if mirror is None or mirror.joined or len(design.curves) != 1:
        return design
    image = designer.mirrored(design, mirror.argument())
    if request.options["avoid"]:
        designer.check_avoids(image, request.options["avoid"], request.options["clearance"])
    alternatives = []
    for each in design.alternatives:
        with contextlib.suppress(nicmm.CurveError, nicmm.UnreachableError):
            alternatives.append(with_image(designer, request, each))
    return replace(design, curves=[*design.curves, *image.curves], alternatives=alternatives)


def without_image(design: Design) -> Design:
    """The design of the first curve of a pair, from which another design can start."""
    return replace(design, curves=design.curves[:1])


def _leg_courses(designer: Designer, request: DesignRequest, progress: Progress) -> Design:
    """The courses that one leg of a curve can take; the curve is the start of the request."""
    from ... import nicmm_core as nicmm
    from ...nicmm_core.leg_courses import leg_courses

    assert isinstance(request.points, nicmm.SurfacePoints)
    assert isinstance(request.start, nicmm.SurfaceCurve)
    assert request.leg is not None
    return leg_courses(
        designer, request.points, request.start, request.leg, progress=progress, **request.options
    )
