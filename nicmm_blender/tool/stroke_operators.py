# SPDX-License-Identifier: GPL-3.0-or-later
"""Freehand strokes: drawn with the tool, or as operators for scripts, and curves along features."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import bpy
import numpy as np

from ..operators.error_reports import called, with_error_reports
from ..operators.partial_curve import PartialCurve
from ..operators.sliced_operator import SlicedOperator
from ..outputs import edited_curve
from ..outputs.edited_curve import Opened
from ..scene import surface_cache
from ..scene.control_points import ControlPoints
from ..scene.messages import InputError, check_finite
from ..scene.surface import group_weights
from ..scene.via_points import no_via_points
from ..settings import CURVE
from . import picking
from .changes_points import ChangesPoints
from .edit_operator import NICMM_PG_control_point
from .picking import Kind
from .point_operators import POSITION

if TYPE_CHECKING:
    from ...nicmm_core import SurfacePoints
    from ...nicmm_core.progress import Progress

    Search = Callable[[Progress | None], tuple[SurfacePoints, bool]]

NEAR = 30.0
"""Distance from the mouse within which a feature is looked for, in pixels at a scale of 1."""

STEP = 4.0
"""Greatest distance in pixels between places of a stroke."""

CLOSING = 16.0
"""Distance in pixels, at a scale of 1, between the ends of a stroke that is closed."""

LONG = 4.0
"""Least length of a stroke that is closed, in such distances."""

FEWEST = 2
"""Least number of places of a stroke."""

HINT = "Release: Create Curve   |   Esc, Right Mouse: Cancel"


class _FollowsLine(ChangesPoints):
    """A mixin for operators that find control points along a line, and then design the curve."""

    _search: Any = None
    """The search for control points, until it has ended."""

    def search(self, opened: Opened) -> Search:
        """The search for control points along the line, which tells whether this is closed."""
        raise NotImplementedError

    def with_found(self, opened: Opened, found: SurfacePoints, closed: bool) -> Opened:
        """The curve through control points that have been found."""
        return edited_curve.new_through(opened, found, closed)

    def edited(self, opened: Opened) -> Opened:
        return self.with_found(opened, *self.search(opened)(None))

    def invoke(self, context: bpy.types.Context, event: bpy.types.Event) -> set[str]:
        if bpy.app.background:
            return self.execute(context)
        return with_error_reports(self, lambda: self._begin(context))

    def _begin(self, context: bpy.types.Context) -> set[str]:
        self._opened = self.open_curve(context)
        self._search = self.search(self._opened)
        return self.work_on(context, self._search)

    def done(self, context: bpy.types.Context, result: Any) -> set[str]:
        """Design the curve when its control points have been found."""
        if self._search is None:
            return super().done(context, result)
        self._search = None
        self._edited = self.with_found(self._opened, *result)
        self.has_handler = self.is_sliced
        return self.answer(context, edited_curve.request(self._edited, self._edited.points))

    def show_progress(self, context: bpy.types.Context) -> None:
        if self._search is None:
            super().show_progress(context)
            return
        SlicedOperator.show_progress(self, context)
        if self._partial is None:
            self._partial = PartialCurve()
        if len(self._work.polyline):
            line = self._opened.surface.in_world(self._work.polyline)
            self._partial.show(line, closed=False)


class NICMM_OT_stroke_curve(_FollowsLine, bpy.types.Operator):
    """Create a curve with few control points that follows a stroke, or redraw a stretch of one"""

    bl_idname = "nicmm.stroke_curve"
    bl_label = "Curve from Stroke"
    bl_options = {"REGISTER", "UNDO"}

    curve: CURVE
    points: bpy.props.CollectionProperty(
        name="Points",
        description="Points of the stroke, in the local space of the mesh object",
        type=NICMM_PG_control_point,
        options={"SKIP_SAVE", "HIDDEN"},
    )
    tolerance: bpy.props.FloatProperty(
        name="Tolerance",
        description="Greatest distance between the stroke and the curve",
        default=0.05,
        min=0.0,
        soft_max=1.0,
        subtype="DISTANCE",
        options={"SKIP_SAVE"},
    )
    closed: bpy.props.BoolProperty(
        name="Closed",
        description="Join the end of the stroke to its beginning. A stroke that redraws a stretch "
        "of a curve is open",
        default=False,
        options={"SKIP_SAVE"},
    )
    redraw: bpy.props.BoolProperty(
        name="Redraw Stretch",
        description="Replace the stretch of the curve between the ends of the stroke",
        default=False,
        options={"SKIP_SAVE"},
    )

    def open_curve(self, context: bpy.types.Context) -> Opened:
        chosen = edited_curve.chosen(context, self.curve) if self.redraw else None
        if chosen is None and self.redraw:
            raise InputError("Make a designed curve active to redraw a stretch of it")
        return _opened_for(context, chosen)

    def search(self, opened: Opened) -> Search:
        check_finite("tolerance", self.tolerance)
        stroke = np.array([point.position[:] for point in self.points], dtype=float).reshape(-1, 3)
        if len(stroke) < FEWEST:
            raise InputError("The stroke has fewer than two points. Draw a longer one")
        self._stroke = stroke = stroke @ opened.surface.local_to_core.T
        tolerance, closed = self.tolerance, self.closed and not self.redraw
        return lambda progress: (
            edited_curve.points_along(opened, stroke, tolerance, closed, progress),
            closed,
        )

    def with_found(self, opened: Opened, found: SurfacePoints, closed: bool) -> Opened:
        if self.redraw:
            return _with_stretch(opened, found, self._stroke)
        return super().with_found(opened, found, closed)


class NICMM_OT_feature_curve(_FollowsLine, bpy.types.Operator):
    """Create the closed curve along the ridge, valley, sharp edge or boundary next to a point.

    If the feature has an end, the curve is open.
    """

    bl_idname = "nicmm.feature_curve"
    bl_label = "Curve along Feature"
    bl_description = (
        "Create the closed curve along the ridge, valley, sharp edge or boundary next to a point, "
        "or an open one if the feature has an end"
    )
    bl_options = {"REGISTER", "UNDO"}

    from_mouse = True  # so a position near the surface is good enough

    position: POSITION
    use_map: bpy.props.BoolProperty(
        name="Rim of Map",
        description="Follow the rim of the alignment map of the sidebar, if there is one",
        default=False,
        options={"SKIP_SAVE"},
    )
    reach: bpy.props.FloatProperty(
        name="Reach",
        description="Distance from the point within which the feature is looked for, at least a "
        "few edges of the mesh",
        default=0.0,
        min=0.0,
        soft_max=1.0,
        subtype="DISTANCE",
        options={"SKIP_SAVE"},
    )

    def invoke(self, context: bpy.types.Context, event: bpy.types.Event) -> set[str]:
        """Look for the feature near the mouse, if the caller has not given a distance."""
        return with_error_reports(self, lambda: self._invoke(context, event))

    def _invoke(self, context: bpy.types.Context, event: bpy.types.Event) -> set[str]:
        if not self.properties.is_property_set("reach") and picking.is_view(context):
            opened = edited_curve.open_new(context)
            view = picking.view_on(context, opened.mesh_object, opened.surface)
            pixels = NEAR * context.preferences.system.ui_scale
            place = np.array(self.properties.position[:], dtype=np.float64)
            self.reach = pixels * view.pixel_size(place) * opened.surface.scale
        return super().invoke(context, event)

    def open_curve(self, context: bpy.types.Context) -> Opened:
        self._map = context.scene.nicmm_curves.alignment_group if self.use_map else ""
        if self.use_map and not self._map:
            raise InputError("There is no alignment map. Choose one in the sidebar")
        return _opened_for(context, None)

    def search(self, opened: Opened) -> Search:
        check_finite("reach", self.reach)
        surface = opened.surface
        place = self._place(opened)
        reach = self.reach / surface.unit if self.reach else None
        weights = None
        if self._map:
            weights = group_weights(opened.mesh_object, self._map, surface.with_modifiers)

        def found(progress: Progress | None) -> tuple[SurfacePoints, bool]:
            with surface_cache.designer_of(surface) as designer:
                return designer.feature_loop(place, None, weights, reach, progress)

        return found


def _opened_for(context: bpy.types.Context, curve: bpy.types.Object | None) -> Opened:
    """A curve, or the mesh of the active object for a new curve."""
    if curve is not None:
        return edited_curve.open_curve(context, curve)
    return edited_curve.open_new(context)


def _with_stretch(opened: Opened, places: SurfacePoints, stroke: np.ndarray) -> Opened:
    """A curve with a stretch replaced by the points of a stroke."""
    from ...nicmm_core.geometry.surface_points import joined
    from ...nicmm_core.strokes.stretch import stretch_between

    if opened.curve is None:
        raise InputError("The curve has to be designed first. Run Update Curves")
    if opened.mirror is not None and opened.mirror.joined:
        raise InputError(
            "A stretch of a curve that is joined to its mirror image cannot be redrawn. Draw a new "
            "curve, or set Mirror to None"
        )
    mesh = surface_cache.core_mesh(opened.surface)
    kept = stretch_between(mesh, opened.curve, stroke[0], stroke[-1])
    if kept.reversed:
        places = places[np.arange(len(places))[::-1]]
    before, after = opened.points.places[kept.before], opened.points.places[kept.after]
    corners = opened.points.corners
    points = ControlPoints(
        joined([before, places, after]),
        np.concatenate(
            [corners[kept.before], np.zeros(len(places), dtype=bool), corners[kept.after]]
        ),
    )
    return replace(opened, points=points, via=no_via_points(), curve=None)


class NICMM_OT_draw_stroke(bpy.types.Operator):
    """Draw a stroke on the surface while the mouse button is pressed"""

    bl_idname = "nicmm.draw_stroke"
    bl_label = "Draw Stroke on Surface"
    bl_options = {"INTERNAL"}

    def invoke(self, context: bpy.types.Context, event: bpy.types.Event) -> set[str]:
        return with_error_reports(self, lambda: self._begin(context, event))

    def _begin(self, context: bpy.types.Context, event: bpy.types.Event) -> set[str]:
        self._opened = picking.opened_now(context)
        self._view = picking.view_on(context, self._opened.mesh_object, self._opened.surface)
        self._positions: list[np.ndarray] = []
        self._pixels: list[np.ndarray] = []
        self._from = picking.under_mouse(context, picking.pixel_of(event))
        self._shown = PartialCurve()
        self._add(picking.pixel_of(event))
        context.window_manager.modal_handler_add(self)
        context.workspace.status_text_set(f"{self.bl_label}   |   {HINT}")
        return {"RUNNING_MODAL"}

    def modal(self, context: bpy.types.Context, event: bpy.types.Event) -> set[str]:
        if event.type == "MOUSEMOVE":
            self._add(picking.pixel_of(event))
        elif event.type in {"ESC", "RIGHTMOUSE"} and event.value == "PRESS":
            self._end(context)
            return {"CANCELLED"}
        elif event.type == "LEFTMOUSE" and event.value == "RELEASE":
            self._end(context)
            return with_error_reports(self, lambda: self._finish(context, event))
        return {"RUNNING_MODAL"}  # without navigation, since the pixels belong to this view

    def cancel(self, context: bpy.types.Context) -> None:
        """Called by Blender when it ends the operator, for example when it quits."""
        self._end(context)

    def _add(self, pixel: np.ndarray) -> None:
        """Add the place under the mouse to the stroke, and those on the way to it.

        A fast mouse leaves gaps, in which the stroke would not follow the surface.
        """
        surface = self._opened.surface
        before = self._pixels[-1] if self._pixels else pixel
        number = max(int(np.ceil(np.linalg.norm(pixel - before) / STEP)), 1)
        for share in np.arange(1, number + 1) / number:
            between = before + share * (pixel - before)
            place = self._view.surface_point_at(between)
            if place is not None:
                self._positions.append(surface.points(place.faces, place.barycentric)[0])
                self._pixels.append(between)
        if not self._positions:
            return
        line = np.array(self._positions)
        to_world = surface.local_to_world
        self._shown.show(line @ to_world[:3, :3].T + to_world[:3, 3], closed=False)

    def _end(self, context: bpy.types.Context) -> None:
        self._shown.remove()
        context.workspace.status_text_set(None)

    def _finish(self, context: bpy.types.Context, event: bpy.types.Event) -> set[str]:
        if len(self._positions) < FEWEST:
            return {"CANCELLED"}
        scale = context.preferences.system.ui_scale
        pixels, line = np.array(self._pixels), np.array(self._positions)
        length = np.linalg.norm(np.diff(pixels, axis=0), axis=1).sum()
        gap = np.linalg.norm(pixels[-1] - pixels[0])
        closed = gap <= CLOSING * scale and length >= LONG * CLOSING * scale
        onto = picking.under_mouse(context, picking.pixel_of(event))
        on_curve = {Kind.LINE, Kind.POINT}
        redraw = all(hit is not None and hit.kind in on_curve for hit in (self._from, onto))
        properties = context.scene.nicmm_curves
        pixel = self._view.pixel_size(line[len(line) // 2]) * self._opened.surface.scale
        return called(
            self,
            bpy.ops.nicmm.stroke_curve,
            "INVOKE_DEFAULT",
            points=[{"name": "", "position": tuple(place)} for place in line],
            tolerance=properties.stroke_tolerance * scale * pixel,
            closed=bool(closed),
            redraw=bool(redraw),
        )


CLASSES = (NICMM_OT_stroke_curve, NICMM_OT_feature_curve, NICMM_OT_draw_stroke)


def register() -> None:
    for each in CLASSES:
        bpy.utils.register_class(each)


def unregister() -> None:
    for each in reversed(CLASSES):
        bpy.utils.unregister_class(each)
