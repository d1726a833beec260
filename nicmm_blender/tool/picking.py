# SPDX-License-Identifier: GPL-3.0-or-later
"""Finds what is under the mouse: part of the active curve, another curve, or the surface."""

from __future__ import annotations

import contextlib
from dataclasses import dataclass
from enum import Enum, auto
from typing import TYPE_CHECKING

import bpy
import numpy as np
from bpy.app.handlers import persistent

from mathutils import Vector

from ..operators import polls
from ..outputs import edited_curve
from ..outputs.edited_curve import Opened
from ..scene import curve_record, mirror_images, surface_cache
from ..scene.lookup import by_uid, is_in
from ..scene.messages import InputError
from ..scene.surface import Surface
from . import element_snap, mirror_snap
from .view import OFFSET, View, view_of

if TYPE_CHECKING:
    from ...nicmm_core import SurfaceCurve, SurfacePoints

POINT_REACH, CURVE_REACH = 12.0, 8.0
"""Maximum distances of the mouse from a point and from a curve, in pixels at a scale of 1."""

CURVE = "CURVE"
"""Name of another designed curve among the elements that points snap to."""

SOLID = {"SOLID", "TEXTURED"}
"""Display types in which an object can hide the surface, unlike wires and bounds."""


class Kind(Enum):
    """Kinds of things that a click can meet."""

    POINT = auto()
    VIA = auto()
    LINE = auto()
    JUNCTION = auto()
    CURVE = auto()
    SURFACE = auto()


@dataclass(frozen=True)
class Hit:
    """What is under the mouse.

    Attributes
    ----------
    kind : Kind
        What the click meets.
    name : str
        Name of the curve object; empty for a new curve.
    index : int
        Index of the control point or of the via point; on the line, index of the control point
        before which a new one is inserted; on the surface, and on a curve that the active one
        avoids, number of control points; 0 for another curve.
    position : tuple
        Position in the local space of the mesh object.
    mesh_uid : int
        The session_uid of the mesh object.
    is_image : bool
        Whether the place is on the mirror image of the point or curve.
    element : str
        The element that the place has snapped to; empty for none.
    """

    kind: Kind
    name: str
    index: int
    position: tuple[float, float, float]
    mesh_uid: int
    is_image: bool = False
    element: str = ""


@dataclass(frozen=True)
class Line:
    """A designed curve on the mesh that is not the active one."""

    name: str
    positions: np.ndarray
    radius: float


class _VisibleCurves:
    """The curves that the viewport shows, read again only after changes."""

    def __init__(self) -> None:
        self.reset()

    def reset(self) -> None:
        """Drop everything that was read."""
        self.key: tuple[object, ...] = ()
        self.opened: Opened | None = None
        self.lines: dict[int, list[Line]] = {}
        self.uses_key: tuple[int, ...] = ()
        self.uses: set[bool] = set()


_visible_curves = _VisibleCurves()


def mesh_and_curve(
    context: bpy.types.Context,
) -> tuple[bpy.types.Object | None, bpy.types.Object | None]:
    """The mesh object that a click draws on, and the active curve; each may be None."""
    curve = edited_curve.active(context)
    if curve is None:
        mesh_object = context.active_object
        if mesh_object is None or mesh_object.type != "MESH":
            return None, None
    else:
        mesh_object = curve_record.mesh_of(curve)
    if mesh_object is None or not _is_shown(context, mesh_object):
        return None, curve
    return mesh_object, curve


def is_ready(
    context: bpy.types.Context, mesh_object: bpy.types.Object, curve: bpy.types.Object | None
) -> bool:
    """Whether what is under the mouse is known without a long computation.

    If a surface has not been read, it is read soon; but not during a render, because reading makes
    temporary objects.
    """
    if bpy.app.is_job_running("RENDER"):
        return False
    needed = _modifier_uses(context, mesh_object, curve)
    found = {uses: surface_cache.cached_or_soon(mesh_object, uses) for uses in needed}
    surface = found[_uses_modifiers(context, curve)]
    if surface is None or None in found.values():
        return False
    few = len(surface.faces) <= 2 * surface_cache.FEW_FACES
    return few or surface_cache.is_prepared(surface)


def surface_for(
    context: bpy.types.Context, mesh_object: bpy.types.Object, curve: bpy.types.Object | None
) -> Surface:
    """The surface that a click draws on."""
    return surface_cache.get(mesh_object, _uses_modifiers(context, curve))


def opened_now(context: bpy.types.Context) -> Opened:
    """The active curve, or the mesh for a new curve, as `Opened`; read again after changes only."""
    return _read(context)[0]


def other_lines(context: bpy.types.Context) -> list[Line]:
    """The other designed curves on the mesh that the viewport shows."""
    # Blender does not report that an object was hidden.
    return [
        line for line in _read(context)[1] if _is_shown(context, bpy.data.objects.get(line.name))
    ]


def pixel_of(event: bpy.types.Event) -> np.ndarray:
    """Position of the mouse in the region of an event, in pixels, (2,)."""
    return np.array([event.mouse_region_x, event.mouse_region_y], dtype=np.float64)


def view_on(context: bpy.types.Context, mesh_object: bpy.types.Object, surface: Surface) -> View:
    """The view of the context's region on a mesh."""
    mesh = surface_cache.core_mesh(surface)
    region = context.region
    return view_of(region, region.data, mesh_object, surface, mesh, is_xray(context.space_data))


def is_xray(space: bpy.types.SpaceView3D) -> bool:
    """Whether the viewport shows what is behind the surface."""
    shading = space.shading
    if shading.type == "WIREFRAME":
        return shading.show_xray_wireframe
    return shading.type == "SOLID" and shading.show_xray


def under_mouse(
    context: bpy.types.Context, pixel: np.ndarray, inverted: bool = False
) -> Hit | None:
    """What a click at a pixel meets; None if nothing, or if another mesh is in front.

    `inverted` tells whether Ctrl inverts snapping.
    """
    mesh_object, curve = mesh_and_curve(context)
    if mesh_object is None:
        return None
    opened, name = opened_now(context), "" if curve is None else curve.name
    view = view_on(context, mesh_object, opened.surface)
    hit = _hit(context, view, pixel, opened, name, curve, inverted)
    if hit is None or _is_behind_another(context, mesh_object, view, pixel, hit.position):
        return None
    return hit


def under_mouse_now(context: bpy.types.Context, pixel: np.ndarray) -> Hit | None:
    """What is under the mouse at a pixel; also None if that would need a long computation."""
    from ...nicmm_core import NicmmError

    if not is_view(context):
        return None
    try:
        mesh_object, curve = mesh_and_curve(context)
        if mesh_object is None or not is_ready(context, mesh_object, curve):
            return None
        return under_mouse(context, pixel)
    except (InputError, NicmmError, ImportError):
        return None  # a click reports the error


def _hit(
    context: bpy.types.Context,
    view: View,
    pixel: np.ndarray,
    opened: Opened,
    name: str,
    curve: bpy.types.Object | None,
    inverted: bool,
) -> Hit | None:
    scale = context.preferences.system.ui_scale
    positions = opened.positions()
    number = view.nearest_point(pixel, positions, POINT_REACH * scale)
    if number is not None:
        return Hit(Kind.POINT, name, number, tuple(positions[number]), opened.mesh_uid)
    images = opened.image_positions()
    number = view.nearest_point(pixel, images, POINT_REACH * scale)
    if number is not None:
        owner, position = int(opened.images.owners[number]), tuple(images[number])
        return Hit(Kind.POINT, name, owner, position, opened.mesh_uid, is_image=True)
    via = opened.via_positions()
    number = view.nearest_point(pixel, via, POINT_REACH * scale)
    if number is not None:
        return Hit(Kind.VIA, name, number, tuple(via[number]), opened.mesh_uid)
    reach = CURVE_REACH * scale
    radius = 0.0 if curve is None else radius_of(curve, opened.surface)
    for each, positions_along in zip(opened.curves, opened.lines(), strict=True):
        on_line = view.nearest_on_line(pixel, positions_along, reach, radius)
        if on_line is not None:
            return _on_line(opened, each, view, name, scale, *on_line)
    if curve is not None and (place := junction_at(context, view, pixel, opened)) is not None:
        position = tuple(opened.surface.points(place.faces, place.barycentric)[0])
        return Hit(Kind.JUNCTION, name, len(positions), position, opened.mesh_uid)
    for line in other_lines(context):
        on_line = view.nearest_on_line(pixel, line.positions, reach, line.radius)
        if on_line is not None:
            segment, share = on_line
            start, end = line.positions[segment : segment + 2]
            if element_snap.is_on(context, inverted):
                position = tuple((1.0 - share) * start + share * end)
                return Hit(
                    Kind.SURFACE, name, len(positions), position, opened.mesh_uid, element=CURVE
                )
            return Hit(Kind.CURVE, line.name, 0, tuple(start), opened.mesh_uid)
    place = view.surface_point_at(pixel)
    if place is None:
        return None
    if mirror_snap.may_end_on_plane(opened):
        place = mirror_snap.snapped(view, opened, place, scale)
    snap = element_snap.snapped(context, view, pixel, place, inverted)
    place = snap.place
    position = tuple(opened.surface.points(place.faces, place.barycentric)[0])
    return Hit(Kind.SURFACE, name, len(positions), position, opened.mesh_uid, element=snap.element)


def junction_at(
    context: bpy.types.Context, view: View, pixel: np.ndarray, opened: Opened
) -> SurfacePoints | None:
    """The point of a curve that the given one avoids near a pixel, or None.

    Control points of that curve are preferred to other points of it.
    """
    from ...nicmm_core.geometry.curve import points_of
    from ...nicmm_core.geometry.curve_places import nearest_point

    reach = CURVE_REACH * context.preferences.system.ui_scale
    for other in opened.others:
        shown = by_uid(other.uid)
        if shown is None or not _is_shown(context, shown):
            continue
        radius = radius_of(shown, opened.surface)
        for curve in other.curves:
            line = edited_curve.polyline_of(opened.surface, curve)
            controls = curve.control_index[curve.control_index >= 0]
            number = view.nearest_point(pixel, line[controls], reach)
            if number is not None:
                return points_of(curve)[controls[[number]]]
            on_line = view.nearest_on_line(pixel, line, reach, radius)
            if on_line is not None:
                segment, share = on_line
                position = (1.0 - share) * line[segment] + share * line[segment + 1]
                return nearest_point(view.mesh, curve, opened.surface.local_to_core @ position)[0]
    return None


def _on_line(
    opened: Opened,
    curve: SurfaceCurve,
    view: View,
    name: str,
    scale: float,
    segment: int,
    share: float,
) -> Hit:
    from ...nicmm_core.geometry.curve import leg_of_segment, point_on_segment

    place = point_on_segment(view.mesh, curve, segment, share)
    leg = leg_of_segment(curve, segment)
    if opened.mirror is not None and opened.mirror.joined:
        half = mirror_images.half_of(opened.surface, opened.mirror, opened.points.places)
        leg = half.leg_of(leg)
        if mirror_snap.may_be_inserted_on_plane(opened, leg + 1):
            place = mirror_snap.snapped(view, opened, place, scale)
    position = opened.surface.points(place.faces, place.barycentric)[0]
    is_image = curve is opened.image
    return Hit(Kind.LINE, name, leg + 1, tuple(position), opened.mesh_uid, is_image)


def _read(context: bpy.types.Context) -> tuple[Opened, list[Line]]:
    """The active curve, or the mesh for a new curve, and the other curves."""
    mesh_object, curve = mesh_and_curve(context)
    if mesh_object is None:
        raise InputError(polls.NO_MESH_OR_CURVE)
    uid = 0 if curve is None else curve.session_uid
    panel = curve_record.settings_from(context.scene.nicmm_curves)
    key = surface_cache.changes(), mesh_object.session_uid, uid, panel, mesh_object.mode
    opened, lines = _visible_curves.opened, _visible_curves.lines
    if opened is None or key != _visible_curves.key:
        _visible_curves.opened = opened = edited_curve.open_curve(context, curve)
        _visible_curves.key = surface_cache.changes(), *key[1:]
        lines.clear()
    # Another viewport may be in local view and show other curves.
    view = 0 if context.space_data is None else context.space_data.as_pointer()
    if view not in lines:
        lines[view] = _other_lines(context, mesh_object, curve, opened.surface)
    return opened, lines[view]


def _other_lines(
    context: bpy.types.Context,
    mesh_object: bpy.types.Object,
    active: bpy.types.Object | None,
    surface: Surface,
) -> list[Line]:
    from ...nicmm_core import NicmmError

    lines = []
    for curve in curve_record.curves_on(context, mesh_object):
        if curve == active or not _is_shown(context, curve):
            continue
        try:
            settings = curve_record.settings_of(curve)
            is_same = settings.use_modifiers == surface.with_modifiers
            on = surface if is_same else surface_cache.cached(mesh_object, settings.use_modifiers)
            if on is None:  # read later, see `is_ready`
                continue
            found = curve_record.lines_of(curve, on)
        except (InputError, NicmmError):
            continue  # the error is reported where the curve is used
        lines += [Line(curve.name, line, radius_of(curve, surface)) for line in found]
    return lines


def _uses_modifiers(context: bpy.types.Context, curve: bpy.types.Object | None) -> bool:
    """Whether a curve, or a new one, lies on the surface with modifiers."""
    if curve is None:
        return context.scene.nicmm_curves.use_modifiers
    return curve_record.settings_of(curve).use_modifiers


def _modifier_uses(
    context: bpy.types.Context, mesh_object: bpy.types.Object, curve: bpy.types.Object | None
) -> frozenset[bool]:
    """On which surfaces of a mesh, with modifiers or without, the tool shows curves."""
    key = surface_cache.changes(), mesh_object.session_uid
    if key != _visible_curves.uses_key:
        uses = set()
        for other in curve_record.curves_on(context, mesh_object):
            with contextlib.suppress(InputError):  # such a curve is not drawn
                uses.add(curve_record.settings_of(other).use_modifiers)
        _visible_curves.uses_key, _visible_curves.uses = key, uses
    return frozenset(_visible_curves.uses | {_uses_modifiers(context, curve)})


def radius_of(curve: bpy.types.Object, surface: Surface) -> float:
    """How far a curve object reaches from its line, in the local space of the mesh."""
    from ..outputs import curve_object, tube_radius

    radius = tube_radius.radius_of(curve)
    reach = radius * curve_object.scale_of(curve, surface)
    return (reach + abs(curve_record.drawn_as(curve)["offset"])) / surface.scale


def _is_shown(context: bpy.types.Context, candidate: bpy.types.Object | None) -> bool:
    """Whether an object is visible in this viewport, also in its local view."""
    space = context.space_data
    if candidate is None or not is_in(context.view_layer, candidate):
        return False
    if not candidate.visible_get():
        return False
    if space is None or space.type != "VIEW_3D":
        return True
    # Before Blender 5 only the evaluated object tells whether it is in the local view.
    shown = candidate.evaluated_get(context.evaluated_depsgraph_get())
    return shown.visible_in_viewport_get(space)


def _is_behind_another(
    context: bpy.types.Context,
    mesh_object: bpy.types.Object,
    view: View,
    pixel: np.ndarray,
    position: tuple[float, float, float],
) -> bool:
    """Whether another mesh hides a position on the line of sight through a pixel."""
    if view.xray:
        return False
    near, direction = view.ray(pixel)
    to_world = mesh_object.matrix_world
    origin = to_world @ Vector(near)
    step = to_world.to_3x3() @ Vector(direction)
    limit = float(np.dot(position - near, direction) / np.dot(direction, direction))
    # What nearly coincides with the surface does not hide it.
    limit -= OFFSET * view.surface.diagonal / float(np.linalg.norm(direction))
    graph = context.evaluated_depsgraph_get()
    for other in context.visible_objects:
        if other == mesh_object or other.type != "MESH" or other.display_type not in SOLID:
            continue
        back = other.matrix_world.inverted_safe()
        start, along = back @ origin, back.to_3x3() @ step
        if not _meets_box(other, start, along) or not _is_shown(context, other):
            continue
        met, where, _normal, _face = other.ray_cast(start, along.normalized(), depsgraph=graph)
        if met and (where - start).dot(along) < limit * along.length_squared:
            return True
    return False


def _meets_box(candidate: bpy.types.Object, start: Vector, along: Vector) -> bool:
    """Whether a ray meets the bounding box of an object, in its local space."""
    corners = np.array([corner[:] for corner in candidate.bound_box])
    direction = np.array(along)
    direction = np.where(np.abs(direction) < 1e-12, 1e-12, direction)
    first = (corners.min(axis=0) - start) / direction
    last = (corners.max(axis=0) - start) / direction
    entry = np.minimum(first, last).max()
    leave = np.maximum(first, last).min()
    return bool(leave >= max(entry, 0.0))


@persistent
def forget(*_arguments: object) -> None:
    """Drop all curves that were read, also before another file is opened."""
    _visible_curves.reset()


def is_view(context: bpy.types.Context) -> bool:
    """Whether the context is a 3D viewport with a view."""
    space, region = context.space_data, context.region
    return (
        space is not None
        and space.type == "VIEW_3D"
        and region is not None
        and region.type == "WINDOW"
        and isinstance(region.data, bpy.types.RegionView3D)
    )


def register() -> None:
    bpy.app.handlers.load_pre.append(forget)


def unregister() -> None:
    bpy.app.handlers.load_pre.remove(forget)
    forget()
