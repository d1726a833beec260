# SPDX-License-Identifier: GPL-3.0-or-later
"""The operator that designs a curve along another course through the same control points."""

import bpy
from bpy.props import IntProperty

from ..outputs import edited_curve
from ..outputs.edited_curve import Opened
from ..scene.design_request import DesignRequest
from ..settings import CURVE
from . import course_search
from .course_search import ALTERNATIVES, LEG, Course, CourseSearch


class NICMM_OT_next_course(CourseSearch, bpy.types.Operator):
    """Design the curve, or one of its legs, along another course"""

    bl_idname = "nicmm.next_course"
    bl_label = "Next Course"
    bl_options = {"REGISTER", "UNDO"}

    curve: CURVE
    leg: LEG
    course: IntProperty(
        name="Course",
        description="Number of the course: 1 for the fairest, 2 for the second fairest, and so on. "
        "0 selects the course after the current one",
        min=0,
        max=1 + ALTERNATIVES,
        options={"SKIP_SAVE"},
    )

    def requests(self, context: bpy.types.Context) -> list[DesignRequest]:
        if self.options.is_repeat_last:
            self.course = 0  # it holds the number that was selected last
        return super().requests(context)

    def use_courses(
        self, _context: bpy.types.Context, opened: Opened, courses: list[Course]
    ) -> set[str]:
        """Write the course with the chosen number, or the one after the current course."""
        current = course_search.index_of_current(opened, courses)
        if course_search.is_only_course(current, courses):
            self.report({"INFO"}, course_search.no_other_course(opened))
            return {"CANCELLED"}
        following = 1 if current is None else 1 + (current + 1) % len(courses)
        self.course = min(self.course, len(courses)) or following
        name = course_search.name_of(opened)
        edited_curve.rewrite(opened, opened.points, courses[self.course - 1].curves)
        self.changed_curves = (opened.curve_uid,)
        self.report({"INFO"}, f'"{name}": course {self.course} of {len(courses)}{opened.remark}')
        return {"FINISHED"}


def register() -> None:
    bpy.utils.register_class(NICMM_OT_next_course)


def unregister() -> None:
    bpy.utils.unregister_class(NICMM_OT_next_course)
