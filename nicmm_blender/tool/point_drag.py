# SPDX-License-Identifier: GPL-3.0-or-later
"""Drags a control point or a via point with the mouse button pressed, while the curve follows.

The operator is modal only until the button is released. Esc or a right click leaves everything as
it was.
"""

from __future__ import annotations

import time
from dataclasses import replace
from typing import TYPE_CHECKING

import bpy
import numpy as np

from ..operators import time_slices
from ..operators.answers import answer_all
from ..operators.error_reports import with_error_reports
from ..operators.sliced_operator import TIME_SLICE
from ..outputs import edited_curve, writing
from ..outputs.edited_curve import Opened
from ..scene.design_request import DesignRequest
from ..scene.viewports import NAVIGATION, redraw
from . import element_snap, mirror_snap, overlay, picking
from .changes_points import ChangesPoints
from .live_curve import LiveCurve

if TYPE_CHECKING:
    from ...nicmm_core import Design, SurfaceCurve
    from ..scene.design_request import Answer

INTERVAL = 1.0 / 60.0
"""Seconds between two steps of a curve that is converging."""

PAUSE = 0.15
"""Seconds without mouse movement before a dragged curve is designed from scratch."""

HINT = "Release: Confirm   |   Esc, Right Mouse: Cancel"


class PointDrag(ChangesPoints):
    """A mixin for operators that change a point which can be dragged."""

    FROM_MOUSE = bpy.props.BoolProperty(
        name="From Mouse",
        description="Drag the point until the mouse button is released",
        default=False,
        options={"SKIP_SAVE", "HIDDEN"},
    )

    _live: LiveCurve | None = None
    if TYPE_CHECKING:  # Blender evaluates annotations of operators without loading the core
        _scratch: time_slices.Work[list[Answer]] | None
    _scratch = None
    _is_dragging = False

    def may_be_on_plane(self, _opened: Opened) -> bool:
        """Whether the point may be on the plane of a mirror, so that it snaps to it."""
        return False

    def invoke(self, context: bpy.types.Context, event: bpy.types.Event) -> set[str]:
        if not self.from_mouse:
            return super().invoke(context, event)
        return with_error_reports(self, lambda: self._press(context, event))

    def _press(self, context: bpy.types.Context, event: bpy.types.Event) -> set[str]:
        self._opened = self.open_curve(context)
        self._view = picking.view_on(context, self._opened.mesh_object, self._opened.surface)
        pixel = picking.pixel_of(event)
        self._pressed, self._grip = pixel, np.zeros(2)
        given = np.array([self.position[:]], dtype=float)
        self.dragged = place = edited_curve.surface_points_at(self._opened, given, "position")
        positions = self._opened.surface.points(place.faces, place.barycentric)
        on_screen = self._view.project(positions)[0]
        if np.isfinite(on_screen).all():
            self._grip = on_screen - pixel
        edited = self.edited(self._opened)
        self._is_new = _count(edited) > _count(self._opened)
        requests = edited_curve.request(edited, edited.points)
        if requests:  # until there is another curve, the present one is shown
            shown = replace(requests[0], start=self._opened.curve)
            self._live = LiveCurve(shown, not self.searches_course, self._is_new)
            self._live.image = self._opened.image
        self._preview = _Preview(self._opened)
        self._last_move = 0.0
        if self._live is not None and self._is_new:
            self._live.waiting = True  # a search for the new leg takes longer than a frame
        self._show_drag()  # may fail, so it comes before everything that has to be undone then
        self._timer = context.window_manager.event_timer_add(INTERVAL, window=context.window)
        context.window_manager.modal_handler_add(self)
        self.has_handler = True
        context.workspace.status_text_set(f"{self.bl_label}   |   {HINT}")
        self._is_dragging = True
        return {"RUNNING_MODAL"}

    def modal(self, context: bpy.types.Context, event: bpy.types.Event) -> set[str]:
        if not self._is_dragging:
            return super().modal(context, event)
        try:
            result = with_error_reports(self, lambda: self._modal(context, event))
        except Exception:
            self._stop(context)
            raise
        if result == {"CANCELLED"}:
            self._stop(context)
        return result

    def cancel(self, context: bpy.types.Context) -> None:
        """Stop the drag; called by Blender when it ends the operator, for example when it quits."""
        if self._is_dragging:
            self._end_drag(context)
        else:
            super().cancel(context)

    def _stop(self, context: bpy.types.Context) -> None:
        """End the drag unless it has ended already."""
        if self._is_dragging:
            self._end_drag(context)

    def _modal(self, context: bpy.types.Context, event: bpy.types.Event) -> set[str]:
        if event.type == "MOUSEMOVE":
            self._move(context, event)
        elif event.type == "TIMER":
            self._work_on()
        elif event.type == "LEFTMOUSE" and event.value == "RELEASE":
            return self._release(context)
        elif event.type in {"ESC", "RIGHTMOUSE"} and event.value == "PRESS":
            self._end_drag(context)
            return {"CANCELLED"}
        elif event.type in NAVIGATION:
            return {"PASS_THROUGH"}
        return {"RUNNING_MODAL"}

    def _move(self, context: bpy.types.Context, event: bpy.types.Event) -> None:
        pixel = picking.pixel_of(event)
        if (pixel == self._pressed).all():
            return
        self._pressed = np.full(2, np.nan)  # from now on every move counts, even back to the start
        self._last_move = time.monotonic()
        self._view = picking.view_on(context, self._opened.mesh_object, self._opened.surface)
        place = None
        if self.snaps and not getattr(self, "image", False):  # others are avoided by the curve
            place = picking.junction_at(context, self._view, pixel + self._grip, self._opened)
        if place is None:
            place = self._view.surface_point_at(pixel + self._grip)
            inverted = bool(event.ctrl)
            at = pixel + self._grip
            if place is not None:
                place = element_snap.snapped(context, self._view, at, place, inverted).place
        if place is None:
            return
        if self.may_be_on_plane(self._opened):
            scale = context.preferences.system.ui_scale
            place = mirror_snap.snapped(self._view, self._opened, place, scale)
        self._stop_scratch()
        self.dragged = place
        if self._live is not None:
            self._live.move(self.edited(self._opened).points)
        self._show_drag()

    def _work_on(self) -> None:
        """Continue with the curve; from scratch only while the mouse stays still."""
        live = self._live
        if live is None:
            return
        if live.waiting:
            if time.monotonic() - self._last_move < PAUSE:
                return
            if self._scratch is None:
                edited = self.edited(self._opened)
                requests = edited_curve.request(edited, edited.points)
                self._scratch = time_slices.Work(lambda progress: answer_all(requests, progress))
            if not self._scratch.run_slice(TIME_SLICE):
                return
            (answer,) = self._scratch.result()
            self._scratch = None
            live.set_result(answer)
        elif live.steps_left:
            live.step()
        else:
            return
        self._show_drag()

    def _show_drag(self) -> None:
        edited, live = self.edited(self._opened), self._live
        curves = [] if live is None else live.curves
        problem = "" if live is None else live.problem
        overlay.show_dragged(edited, curves, problem)
        if live is not None and curves and live.request.start is not self._opened.curve:
            self._preview.show(curves)
        redraw()

    def _release(self, context: bpy.types.Context) -> set[str]:
        live, opened = self._live, self._opened
        moved = np.isnan(self._pressed).any()
        if not moved and not self._is_new:
            self._end_drag(context)
            return {"CANCELLED"}
        self._edited = edited = self.edited(opened)
        place = self._place(opened)
        self.position = opened.surface.points(place.faces, place.barycentric)[0]
        requests = edited_curve.request(edited, edited.points)
        design = None
        if live is not None and not live.waiting and not live.problem:
            # Keep the curve that the user sees: go on from it, or take it if it has converged.
            requests = [live.request]
            design = live.design
        self._end_drag(context)
        return with_error_reports(self, lambda: self._commit(context, requests, design))

    def _commit(
        self, context: bpy.types.Context, requests: list[DesignRequest], design: Design | None
    ) -> set[str]:
        if design is not None:
            return self.end(context, requests, [design])
        # The points stay visible during a long computation.
        overlay.show_dragged(self._edited, self._opened.curves)
        result: set[str] = set()
        try:
            result = self.answer(context, requests)
        finally:
            if "RUNNING_MODAL" not in result:
                overlay.show_active()
        return result

    def finish(
        self, context: bpy.types.Context, requests: list[DesignRequest], answers: list[Answer]
    ) -> set[str]:
        result = super().finish(context, requests, answers)
        overlay.show_active()  # other curves may still follow
        return result

    def tidy(self, context: bpy.types.Context) -> None:
        overlay.show_active()
        super().tidy(context)

    def _stop_scratch(self) -> None:
        if self._scratch is not None:
            self._scratch.cancel()
            self._scratch = None

    def _end_drag(self, context: bpy.types.Context) -> None:
        """End the drag: restore the window and the object."""
        self._is_dragging = False
        self._stop_scratch()
        self._preview.restore()
        overlay.show_active()
        context.window_manager.event_timer_remove(self._timer)
        context.workspace.status_text_set(None)
        redraw()


def _count(opened: Opened) -> int:
    """The number of control points and via points."""
    return len(opened.points) + len(opened.via)


class _Preview:
    """Shows the dragged curve in its object, through a copy of its data that is removed later."""

    def __init__(self, opened: Opened) -> None:
        self._opened = opened
        self._original = self._copy = ""

    def show(self, curves: list[SurfaceCurve]) -> None:
        """Draw a curve, or a pair."""
        shown = self._opened.curve_object
        if shown is None:
            return
        if not self._copy:
            copy = shown.data.copy()
            self._original, self._copy = shown.data.name, copy.name
            shown.data = copy
        writing.show_unfinished(shown, self._opened.surface, curves)

    def restore(self) -> None:
        """Give the object its original data back."""
        shown = self._opened.curve_object
        if not self._copy or shown is None:
            return
        all_data = bpy.data.curves if shown.type == "CURVE" else bpy.data.hair_curves
        original, copy = all_data.get(self._original), all_data.get(self._copy)
        if original is not None:
            shown.data = original
        if copy is not None and copy != shown.data:
            all_data.remove(copy)
        self._copy = ""
