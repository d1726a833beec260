# SPDX-License-Identifier: GPL-3.0-or-later
"""Changes the control points and settings of a designed curve: opens, designs and writes it.

An opened curve holds no references to Blender objects, since undo replaces them.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING

import bpy
import numpy as np

from ..scene import (
    avoided_curves,
    curve_record,
    design_request,
    junctions,
    mirror_images,
    mirror_plane,
    point_lists,
    surface_cache,
)
from ..scene.control_points import ControlPoints
from ..scene.curve_record import CurveSettings, Drawn
from ..scene.design_request import DesignRequest
from ..scene.junctions import OtherCurve
from ..scene.lookup import by_uid
from ..scene.messages import NO_MESH_OR_CURVE, InputError, counted, sentence
from ..scene.mirror_images import Images
from ..scene.mirror_plane import Mirror
from ..scene.surface import Surface, active_modifiers_text
from ..scene.via_points import ViaPoints, leg_before, no_via_points, number_of_legs
from . import curve_object, parallel_curves, writing
from .writing import ObjectSettings

if TYPE_CHECKING:
    from ...nicmm_core import Design, SurfaceCurve, SurfacePoints
    from ...nicmm_core.geometry.plane_section import PlaneSection
    from ...nicmm_core.progress import Progress
    from ..scene.design_request import Answer

MAPS = ("obstacle_group", "alignment_group")

SAME_COURSE = ("smoothness", "normal_bending")
"""Settings with whose change a curve keeps its course."""

DELETED = "The curve was deleted while it was being designed. Undo to bring it back"
MESH_DELETED = "The mesh was deleted while a curve was being drawn on it. Undo to bring it back"


@dataclass(frozen=True)
class Opened:
    """A designed curve on the current surface, or a new curve.

    Attributes
    ----------
    curve_uid, mesh_uid : int
        The session_uid of the curve object, 0 for a new curve, and of the mesh object.
    surface : Surface
        The current surface.
    settings : CurveSettings
        Settings of the curve.
    points : ControlPoints
        Control points on the surface.
    via : ViaPoints
        Via points on the surface.
    curve : SurfaceCurve of the core, or None
        The recorded curve; None if the curve is new or has to be designed again.
    remark : str
        Text that is appended to reports; may be empty.
    mirror : Mirror or None
        The mirror of the curve.
    image : SurfaceCurve of the core, or None
        The mirror image of the curve if the object has both.
    others : tuple of OtherCurve
        The curves that it avoids.
    """

    curve_uid: int
    mesh_uid: int
    surface: Surface
    settings: CurveSettings
    points: ControlPoints
    via: ViaPoints
    curve: SurfaceCurve | None
    remark: str
    mirror: Mirror | None = None
    image: SurfaceCurve | None = None
    others: tuple[OtherCurve, ...] = ()

    @property
    def curves(self) -> list[SurfaceCurve]:
        """The curves of the object: none, the curve, or the curve and its mirror image."""
        return [each for each in (self.curve, self.image) if each is not None]

    @cached_property
    def images(self) -> Images:
        """The mirror images of the control points; none without a mirror."""
        return mirror_images.images_of(self.surface, self.mirror, self.points)

    def image_positions(self) -> np.ndarray:
        """Positions of the images in the object's local space, (m, 3)."""
        return self.surface.points(self.images.places.faces, self.images.places.barycentric)

    @property
    def section(self) -> PlaneSection | None:
        """Where the plane of a curve joined to its image cuts the surface; None for others."""
        if self.mirror is None or not self.mirror.joined:
            return None
        return surface_cache.section_with(self.surface, self.mirror.plane)

    @property
    def path(self) -> tuple[int, bool]:
        """Number of points and closedness of a curve with the same legs; see `path_of`."""
        closed = self.settings.closed
        return mirror_images.path_of(self.surface, self.mirror, self.points.places, closed)

    @property
    def mesh_object(self) -> bpy.types.Object:
        """The mesh object; an error if it has been deleted."""
        found = by_uid(self.mesh_uid)
        if found is None:
            raise InputError(MESH_DELETED)
        return found

    @property
    def curve_object(self) -> bpy.types.Object | None:
        """The curve object; None for a new curve."""
        return by_uid(self.curve_uid) if self.curve_uid else None

    @cached_property
    def junctions(self) -> np.ndarray:
        """Whether each control point lies on a curve that is avoided, (k,)."""
        if not self.others or not len(self.points):
            return np.zeros(len(self.points), dtype=bool)
        mesh = surface_cache.core_mesh(self.surface)
        return junctions.are_junctions(mesh, self.points.places, self.others)

    def positions(self) -> np.ndarray:
        """Positions of the control points in the object's local space, (k, 3)."""
        return positions_of(self.surface, self.points)

    def via_positions(self) -> np.ndarray:
        """Positions of the via points in the object's local space, (m, 3)."""
        return self.surface.points(self.via.points.faces, self.via.points.barycentric)

    def lines(self) -> list[np.ndarray]:
        """Points of each curve in the object's local space, (n, 3); see `polyline_of`."""
        return [polyline_of(self.surface, curve) for curve in self.curves]


def positions_of(surface: Surface, points: ControlPoints) -> np.ndarray:
    """Positions of control points in the object's local space, (k, 3)."""
    return surface.points(points.places.faces, points.places.barycentric)


def polyline_of(surface: Surface, curve: SurfaceCurve) -> np.ndarray:
    """Points of a curve in the object's local space, (n, 3); a closed curve repeats the first."""
    line = surface.points(curve.faces, curve.barycentric)
    return np.concatenate([line, line[:1]]) if curve.closed else line


def chosen(context: bpy.types.Context, name: str) -> bpy.types.Object | None:
    """The designed curve with a name; for an empty name the active curve, or None without one."""
    if not name:
        return active(context)
    found = bpy.data.objects.get(name)
    if not curve_record.has_record(found):
        raise InputError(
            f'There is no designed curve "{name}". Give the name of a designed curve, or leave it '
            "empty for a new curve"
        )
    return found


def active(context: bpy.types.Context) -> bpy.types.Object | None:
    """The designed curve that is being drawn, or None.

    It is the active object, unless that is hidden. In Sculpt Mode and Weight Paint, where the mesh
    has to be active, it is the selected curve on that mesh, if exactly one is selected.
    """
    found = context.active_object
    if curve_record.has_record(found):
        return found if found.visible_get() else None
    if found is None or found.type != "MESH" or found.mode not in {"SCULPT", "WEIGHT_PAINT"}:
        return None
    curves = [
        each
        for each in context.selected_objects
        if curve_record.has_record(each) and curve_record.mesh_of(each) == found
    ]
    return curves[0] if len(curves) == 1 else None


def open_curve(
    context: bpy.types.Context,
    edited: bpy.types.Object | None,
    settings: CurveSettings | None = None,
    keeps_course: bool = False,
) -> Opened:
    """Read a curve and its surface, or the active mesh for a new curve.

    Parameters
    ----------
    context : bpy.types.Context
    edited : bpy.types.Object or None
        The curve object; None for a new curve.
    settings : CurveSettings, optional
        Settings to use instead of those of the curve, or of the sidebar for a new curve.
    keeps_course : bool, default False
        Whether the curve keeps its course if only settings of `SAME_COURSE` differ. With any other
        change of settings it is designed from scratch, because another course may be the best one.
    """
    mesh_object, before = _mesh_and_settings(context, edited)
    settings = before if settings is None else settings
    remarks: list[str] = []
    if edited is not None:
        settings = _without_missing_maps(mesh_object, settings, remarks)
    opened = _opened_on(mesh_object, settings, edited, remarks)
    if edited is not None:
        kept = _settings_that_keep_the_curve(before, settings, keeps_course)
        opened = _with_recorded_points(opened, edited, kept == before, remarks)
    return replace(opened, remark="".join(f"; {each}" for each in remarks))


def _opened_on(
    mesh_object: bpy.types.Object,
    settings: CurveSettings,
    edited: bpy.types.Object | None,
    remarks: list[str],
) -> Opened:
    """A mesh opened for a curve, or for a new one, without control points; it may add a remark."""
    surface = surface_cache.get(mesh_object, settings.use_modifiers)
    if not len(surface.faces):
        raise InputError(f'"{mesh_object.name}" has no faces to draw on. Choose another mesh')
    beyond = active_modifiers_text(mesh_object)
    if beyond and not settings.use_modifiers:
        remarks.append(f"on the mesh without its {beyond}")
    via, elastic = no_via_points(), replace(settings, method="ELASTIC")
    return Opened(
        curve_uid=0 if edited is None else edited.session_uid,
        mesh_uid=mesh_object.session_uid,
        surface=surface,
        settings=settings,
        points=ControlPoints(via.points, np.zeros(0, dtype=bool)),
        via=via,
        curve=None,
        remark="",
        mirror=mirror_plane.mirror_of(mesh_object, surface, settings),
        others=avoided_curves.above(edited, mesh_object, surface, elastic),
    )


def open_new(context: bpy.types.Context) -> Opened:
    """Open the active mesh, or that of the active curve, for a new curve."""
    return _opened_on(*_mesh_and_new_settings(context), None, [])


def _mesh_and_settings(
    context: bpy.types.Context, edited: bpy.types.Object | None
) -> tuple[bpy.types.Object, CurveSettings]:
    """The mesh object of a curve and its settings; those of the sidebar for a new curve."""
    if edited is not None:
        mesh_object = curve_record.mesh_in_view_layer(context, edited)
        writing.check_replaceable(edited)
        return mesh_object, curve_record.settings_of(edited)
    return _mesh_and_new_settings(context)


def _mesh_and_new_settings(
    context: bpy.types.Context,
) -> tuple[bpy.types.Object, CurveSettings]:
    """The active mesh, or that of the active curve, and the settings of a new curve on it."""
    mesh_object = curve_record.mesh_of_context(context)
    if mesh_object is None:
        raise InputError(NO_MESH_OR_CURVE)
    panel = curve_record.settings_from(context.scene.nicmm_curves)
    return mesh_object, replace(panel, method="ELASTIC")


def _without_missing_maps(
    mesh_object: bpy.types.Object, settings: CurveSettings, remarks: list[str]
) -> CurveSettings:
    """Settings without maps that no longer exist, each of which adds a remark."""
    for name in MAPS:
        group = getattr(settings, name)
        if group and group not in mesh_object.vertex_groups:
            settings = settings.with_value(name, "")
            remarks.append(f'without the vertex group "{group}", which no longer exists')
    return settings


def _settings_that_keep_the_curve(
    before: CurveSettings, settings: CurveSettings, keeps_course: bool
) -> CurveSettings:
    """Settings with the former values of those whose change keeps the curve."""
    kept = replace(settings, method=before.method)
    for name in SAME_COURSE if keeps_course else ():
        kept = kept.with_value(name, getattr(before, name))
    return kept


def _with_recorded_points(
    opened: Opened, edited: bpy.types.Object, keeps_curve: bool, remarks: list[str]
) -> Opened:
    """An opened curve with its control points and via points, and its curve if this is kept.

    Control points that were moved to the nearest positions add a remark.
    """
    mesh_object, surface = opened.mesh_object, opened.surface
    via = curve_record.current_via_points(edited, mesh_object, surface)
    points, moved = curve_record.current_control_points(edited, mesh_object, surface)
    curve, image = None, None
    if moved:
        points_moved = f"{counted(moved, 'point')} moved to the nearest positions"
        remarks.append(f"the mesh has changed: {points_moved}")
    elif keeps_curve:
        curve, image = _curves_of(edited, surface)
    if opened.others:
        points = _with_junctions(edited, surface, points, opened.others)
    return replace(opened, points=points, via=via, curve=curve, image=image)


def is_current(curve_object: bpy.types.Object, opened: Opened) -> bool:
    """Whether an opened curve was designed on its surface as it is, with its present settings."""
    now = curve_record.digest(opened.mesh_object, opened.surface, opened.settings, opened.others)
    return curve_record.is_current(curve_object, now)


def _with_junctions(
    edited: bpy.types.Object,
    surface: Surface,
    points: ControlPoints,
    others: tuple[OtherCurve, ...],
) -> ControlPoints:
    """Control points, with the junctions where they are now on the curves that are avoided."""
    mesh, follows = surface_cache.core_mesh(surface), curve_record.junctions_of(edited)
    return replace(points, places=junctions.followed(mesh, points.places, follows, others))


def request(edited: Opened, points: ControlPoints) -> list[DesignRequest]:
    """The request for the curve through new points, as a list; empty if they are too few."""
    settings = replace(edited.settings, method="ELASTIC")
    if not design_request.is_enough(edited.surface, edited.mirror, points, settings):
        return []
    found = design_request.for_drawing(
        edited.mesh_object, edited.surface, points, edited.via, settings, edited.curve_object
    )
    return [replace(found, start=edited.curve)]


def curves_of(answers: list[Answer]) -> list[SurfaceCurve]:
    """The curves in the answers to `request`; an error if an answer has none."""
    return [curve for answer in answers for curve in design_of(answer).curves]


def design_of(answer: Answer) -> Design:
    """The design in an answer; an error if it has no curves. An error is raised again."""
    if isinstance(answer, Exception):
        raise answer
    if not answer.curves:
        raise InputError(sentence(str(answer.status)))
    return answer


def write(
    context: bpy.types.Context,
    edited: Opened,
    points: ControlPoints,
    curves: list[SurfaceCurve],
    settings: ObjectSettings,
) -> bpy.types.Object:
    """Write curves through points to the curve object, or to a new one; return the object.

    `settings` holds the output settings of a new object.
    """
    if edited.curve_uid:
        return rewrite(edited, points, curves)
    mesh_object = edited.mesh_object
    result = writing.as_object(
        mesh_object, edited.surface, curves, settings, points.corners, edited.mirror
    )
    _record(result, mesh_object, edited, points, curves, writing.drawn_as(settings))
    curve_object.place(context, mesh_object, result)
    return result


def rewrite(edited: Opened, points: ControlPoints, curves: list[SurfaceCurve]) -> bpy.types.Object:
    """Write curves through points to the curve object, and return it."""
    result, mesh_object = edited.curve_object, edited.mesh_object
    if result is None:
        raise InputError(DELETED)
    writing.redraw(result, edited.surface, curves, points.corners, edited.mirror)
    drawn = curve_record.drawn_as(result)
    _record(result, mesh_object, edited, points, curves, drawn)
    parallel_curves.follow(result, edited.surface, curves)
    return result


def _record(
    result: bpy.types.Object,
    mesh_object: bpy.types.Object,
    edited: Opened,
    points: ControlPoints,
    curves: list[SurfaceCurve],
    drawn: Drawn,
) -> None:
    points = snapped(edited, points)
    curve_settings = replace(edited.settings, method="ELASTIC")
    via = edited.via.fitting(*replace(edited, points=points).path)
    curve_record.write_record(
        result,
        mesh_object,
        edited.surface,
        curves,
        curve_settings,
        drawn,
        points.corners,
        points.places,
        via,
        edited.others,
    )


def surface_points_at(edited: Opened, positions: np.ndarray, name: str) -> SurfacePoints:
    """SurfacePoints of the core at positions (k, 3) on the surface, in the object's local space.

    `name` is the name of the argument in error messages.
    """
    from ...nicmm_core.geometry.surface_points import locate_points

    surface = edited.surface
    mesh = surface_cache.core_mesh(surface)
    return locate_points(mesh, positions @ surface.local_to_core.T, name)


def nearest_surface_points(edited: Opened, positions: np.ndarray) -> SurfacePoints:
    """SurfacePoints of the core nearest to positions (k, 3) in the object's local space."""
    from ...nicmm_core.geometry.surface_points import nearest_points

    surface = edited.surface
    mesh = surface_cache.core_mesh(surface)
    return nearest_points(mesh, positions @ surface.local_to_core.T)[0]


def points_along(
    edited: Opened,
    stroke: np.ndarray,
    tolerance: float,
    closed: bool,
    progress: Progress | None = None,
) -> SurfacePoints:
    """Few points through which a curve with these settings follows a stroke; none if cancelled.

    Parameters
    ----------
    edited : Opened
    stroke : (n, 3) float array
        In the space of the core.
    tolerance : float
        Greatest distance between the stroke and the curve, in the scene.
    closed : bool
    progress : callable, optional
    """
    shape = {name: getattr(edited.settings, name) for name in SAME_COURSE}
    within = tolerance / edited.surface.unit
    with surface_cache.designer_of(edited.surface) as designer:
        return designer.fit_stroke(stroke, within, closed, **shape, progress=progress)


def new_through(opened: Opened, places: SurfacePoints, closed: bool) -> Opened:
    """A new curve through points without corners, on the mesh that was opened for it."""
    points = ControlPoints(places, np.zeros(len(places), dtype=bool))
    settings = opened.settings.with_value("closed", closed)
    return replace(opened, settings=settings, points=points, via=no_via_points(), curve=None)


def with_point(
    points: ControlPoints, number: int, place: SurfacePoints, replaced: bool = False
) -> ControlPoints:
    """Points with the single point `place` inserted at an index, or replacing the point there.

    A replaced point stays a corner; an inserted point is smooth.
    """
    corners = points.corners
    if not replaced:
        corners = np.insert(corners, number, False)
    return ControlPoints(point_lists.with_point(points.places, number, place, replaced), corners)


def without_point(points: ControlPoints, number: int) -> ControlPoints:
    """Points without the one at an index."""
    places = point_lists.without_point(points.places, number)
    return ControlPoints(places, np.delete(points.corners, number))


def with_toggled_corner(points: ControlPoints, number: int) -> ControlPoints:
    """Points of which the one at an index has become a corner, or has become smooth again."""
    corners = points.corners.copy()
    corners[number] = not corners[number]
    return replace(points, corners=corners)


def via_after_insertion(edited: Opened, number: int, place: SurfacePoints) -> ViaPoints:
    """The via points after the control point `place` has been inserted at an index."""
    count, closed = edited.path
    leg = leg_before(number, count, closed)
    via = edited.via
    divided, is_behind = via.legs == leg, np.zeros(len(via), dtype=bool)
    if divided.any():
        along = _along_leg(edited, leg, via.points[divided])
        is_behind[divided] = along >= _along_leg(edited, leg, place)
    return via.after_insertion(number, count, closed, is_behind)


def snapped(edited: Opened, points: ControlPoints) -> ControlPoints:
    """Points, of which those that nearly lie on an avoided curve are put exactly onto it."""
    if not edited.others or not len(points):
        return points
    mesh = surface_cache.core_mesh(edited.surface)
    return replace(points, places=junctions.snapped(mesh, points.places, edited.others))


def checked_leg(edited: Opened, leg: int) -> int:
    """The index of a leg; an error if the curve has no such leg."""
    count = number_of_legs(*edited.path)
    if not 0 <= leg < count:
        raise InputError(f"There is no leg {leg}; the curve has {count}, counted from 0")
    return leg


def index_of_new_via(edited: Opened, leg: int, place: SurfacePoints) -> int:
    """The index among the via points of one that is added to a leg, by its position there."""
    via = edited.via
    earlier = _along_leg(edited, leg, via.points[via.legs == leg]) < _along_leg(edited, leg, place)
    return int((via.legs < leg).sum() + earlier.sum())


def _along_leg(edited: Opened, leg: int, points: SurfacePoints) -> np.ndarray:
    """How far along a leg of the curve points are, (k,); 0 without a curve."""
    from ...nicmm_core.geometry.curve import along_leg

    if edited.curve is None:
        return np.zeros(len(points))
    mesh = surface_cache.core_mesh(edited.surface)
    return along_leg(edited.curve, leg, points.positions(mesh))


def _curves_of(
    edited: bpy.types.Object, surface: Surface
) -> tuple[SurfaceCurve | None, SurfaceCurve | None]:
    """The recorded curve of an object and the image in its pair; None for what does not exist.

    The curve is also None if it has to be designed again.
    """
    if not curve_record.lies_on(edited, surface):
        return None, None
    curves = curve_record.read_curves(edited, surface)
    if design_request.is_pair(curve_record.settings_of(edited)):
        return curves[0], curves[1]
    whole = len(curves) == 1 and (curves[0].control_index >= 0).all()
    return curves[0] if whole else None, None
