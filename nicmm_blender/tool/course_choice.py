# SPDX-License-Identifier: GPL-3.0-or-later
"""The operator that shows the courses of the active curve and lets the user choose one of them."""

from __future__ import annotations

import bpy
import numpy as np

from ..operators import course_search
from ..operators.course_search import LEG, Course, CourseSearch
from ..operators.error_reports import called, with_error_reports
from ..outputs.edited_curve import Opened
from ..scene.messages import InputError
from ..scene.viewports import NAVIGATION
from ..settings import CURVE
from . import course_overlay, picking
from .picking import Kind

NEXT = {"WHEELDOWNMOUSE", "DOWN_ARROW", "RIGHT_ARROW"}
PREVIOUS = {"WHEELUPMOUSE", "UP_ARROW", "LEFT_ARROW"}
ENTER = {"RET", "NUMPAD_ENTER"}

HINT = (
    "Wheel, Arrow Keys, Shift Enter: Change   |   Click on a Course: Choose   |   "
    "Enter, Left Mouse: Confirm   |   Esc, Right Mouse: Cancel"
)


class CourseChoice(CourseSearch):
    """A mixin for operators that show the courses found and end with a call for the chosen one."""

    under_mouse: bool
    """Property of the operators: whether the courses are those of the leg under the mouse."""

    _is_choosing = False

    def execute(self, _context: bpy.types.Context) -> set[str]:
        def refuse() -> set[str]:
            raise InputError("Courses are chosen in the 3D viewport. Scripts call next_course")

        return with_error_reports(self, refuse)

    def invoke(self, context: bpy.types.Context, event: bpy.types.Event) -> set[str]:
        if not picking.is_view(context):
            return {"PASS_THROUGH"}
        return with_error_reports(self, lambda: self._invoke(context, event))

    def _invoke(self, context: bpy.types.Context, event: bpy.types.Event) -> set[str]:
        if self.under_mouse:
            hit = picking.under_mouse(context, picking.pixel_of(event))
            if hit is None or hit.kind is not Kind.LINE:
                raise InputError("Move the mouse over a leg of the active curve")
            self.leg = hit.index - 1
        return self.answer(context, self.requests(context))

    def use_courses(
        self, context: bpy.types.Context, opened: Opened, courses: list[Course]
    ) -> set[str]:
        """Show the courses; the current one is chosen at first."""
        current = course_search.index_of_current(opened, courses)
        if course_search.is_only_course(current, courses):
            self.report({"INFO"}, course_search.no_other_course(opened))
            return {"CANCELLED"}
        self._current, self._chosen, self._courses = current, current or 0, courses
        self._lines = course_overlay.lines_of(opened, courses)
        self._show(context)
        if not self.is_sliced:
            context.window_manager.modal_handler_add(self)
        self._is_choosing = True
        return {"RUNNING_MODAL"}

    def modal(self, context: bpy.types.Context, event: bpy.types.Event) -> set[str]:
        if not self._is_choosing:
            return super().modal(context, event)
        try:
            result = with_error_reports(self, lambda: self._modal(context, event))
        except Exception:
            self._end_choice(context)
            raise
        if result & {"FINISHED", "CANCELLED"}:
            self._end_choice(context)
        return result

    def cancel(self, context: bpy.types.Context) -> None:
        """End the choice; called by Blender when it ends the operator."""
        if self._is_choosing:
            self._end_choice(context)
        else:
            super().cancel(context)

    def _modal(self, context: bpy.types.Context, event: bpy.types.Event) -> set[str]:
        kind = event.type
        if kind in NAVIGATION and (kind not in NEXT | PREVIOUS or _has_modifier(event)):
            return {"PASS_THROUGH"}
        if event.value not in {"PRESS", "DOUBLE_CLICK"}:
            return {"RUNNING_MODAL"}
        if kind in {"ESC", "RIGHTMOUSE"}:
            return {"CANCELLED"}
        if kind in NEXT or (kind in ENTER and event.shift):
            self._choose(context, self._chosen + 1)
        elif kind in PREVIOUS:
            self._choose(context, self._chosen - 1)
        elif kind in ENTER:
            return self._confirm()
        elif kind == "LEFTMOUSE":
            return self._click(context, picking.pixel_of(event))
        return {"RUNNING_MODAL"}

    def _click(self, context: bpy.types.Context, pixel: np.ndarray) -> set[str]:
        """Choose the course under the mouse, or confirm if that is the chosen one or none."""
        region = context.region
        if not (0 <= pixel[0] < region.width and 0 <= pixel[1] < region.height):
            return {"RUNNING_MODAL"}
        opened = self._opened
        view = picking.view_on(context, opened.mesh_object, opened.surface)
        reach = picking.CURVE_REACH * context.preferences.system.ui_scale
        under = [
            number
            for number, line in enumerate(self._lines)
            if view.nearest_on_line(pixel, line, reach) is not None
        ]
        if not under or self._chosen in under:
            return self._confirm()
        self._choose(context, under[0])
        return {"RUNNING_MODAL"}

    def _choose(self, context: bpy.types.Context, number: int) -> None:
        self._chosen = number % len(self._courses)
        self._show(context)

    def _show(self, context: bpy.types.Context) -> None:
        course_overlay.show(self._opened, self._courses, self._lines, self._chosen)
        number, energy = self._chosen + 1, course_overlay.energy_text(self._courses[self._chosen])
        context.workspace.status_text_set(
            f"{self.bl_label}: {number} of {len(self._courses)}, {energy} the energy of the "
            f"fairest   |   {HINT}"
        )

    def _confirm(self) -> set[str]:
        """Write the chosen course, in one undo step; nothing changes if it is the current one."""
        curve = self._opened.curve_object
        if curve is None or self._chosen == self._current:
            return {"CANCELLED"}
        return called(
            self,
            bpy.ops.nicmm.next_course,
            "EXEC_DEFAULT",
            curve=curve.name,
            leg=self.leg,
            course=self._chosen + 1,
        )

    def _end_choice(self, context: bpy.types.Context) -> None:
        course_overlay.hide()
        context.workspace.status_text_set(None)
        vars(self).clear()


def _has_modifier(event: bpy.types.Event) -> bool:
    return event.shift or event.ctrl or event.alt


class NICMM_OT_choose_course(CourseChoice, bpy.types.Operator):
    """Show the courses that the curve, or one of its legs, can take, and choose one of them"""

    bl_idname = "nicmm.choose_course"
    bl_label = "Choose Course"
    bl_options = {"INTERNAL"}

    curve: CURVE
    leg: LEG
    under_mouse: bpy.props.BoolProperty(
        name="Leg under Mouse",
        description="Show the courses of the leg under the mouse, while the other legs keep theirs",
        default=False,
        options={"SKIP_SAVE"},
    )


def register() -> None:
    bpy.utils.register_class(NICMM_OT_choose_course)


def unregister() -> None:
    bpy.utils.unregister_class(NICMM_OT_choose_course)
