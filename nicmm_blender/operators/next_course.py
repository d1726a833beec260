# SPDX-License-Identifier: GPL-3.0-or-later
"""The operator that designs a curve along another course through the same control points.

Dragging and updating keep the course of a curve, even if another one has become fairer. This
operator searches for courses again, and the user chooses one of them.
"""

from dataclasses import replace

import bpy
from bpy.props import IntProperty

from ..outputs import edited_curve
from ..scene import curve_record, designers
from ..scene.messages import InputError
from ..settings import CURVE
from . import polls
from .long_solves import LongSolves

ALTERNATIVES = 4
"""Greatest number of courses besides the fairest one."""

_found: dict = {}
"""The designs of the last search by what they depend on, so that a next call takes no time."""


class NICMM_OT_next_course(LongSolves, bpy.types.Operator):
    """Design the curve along another course through its control points"""

    bl_idname = "nicmm.next_course"
    bl_label = "Next Course"
    bl_options = {"REGISTER", "UNDO"}

    curve: CURVE
    course: IntProperty(
        name="Course",
        description="Number of the course: 1 for the fairest, 2 for the second fairest, and so on. "
        "0 selects the course after the current one",
        min=0,
        max=1 + ALTERNATIVES,
        options={"SKIP_SAVE"},
    )

    @classmethod
    def poll(cls, context):
        has_mesh = curve_record.mesh_of_context(context) is not None
        return polls.usable(cls, context, has_mesh, polls.NO_CURVE, polls.TOOL)

    def requests(self, context) -> list:
        edited = edited_curve.chosen(context, self.curve)
        if edited is None:
            raise InputError(polls.NO_CURVE)
        if not curve_record.has_curve(edited):
            raise InputError(curve_record.no_curve_message(edited))
        self._opened = edited_curve.open_curve(context, edited)
        if _key(self._opened) in _found:
            return []
        (request,) = edited_curve.request(self._opened, self._opened.points)
        options = {**request.options, "alternatives": ALTERNATIVES}
        return [replace(request, start=None, options=options)]

    def finish(self, context, _requests: list, answers: list) -> set:
        opened, name = self._opened, self._opened.curve_object.name
        if answers:
            edited_curve.curves_of(answers)  # raises an answer that is an error
            _found.clear()
            _found[_key(opened)] = [answers[0], *answers[0].alternatives]
        courses = [design.curves[0] for design in _found[_key(opened)]]
        current = _current(opened, courses)
        if len(courses) == 1 and current == 0:
            self.report({"INFO"}, f'No other course of "{name}" was found')
            return {"CANCELLED"}
        following = 1 if current is None else 1 + (current + 1) % len(courses)
        self.course = min(self.course, len(courses)) or following
        edited_curve.write(context, opened, opened.points, [courses[self.course - 1]], None)
        self.report({"INFO"}, f'"{name}": course {self.course} of {len(courses)}{opened.remark}')
        return {"FINISHED"}


def _key(opened) -> tuple:
    """Everything that the courses of a curve depend on."""
    points = opened.points
    on = curve_record.digest(opened.mesh_object, opened.surface, opened.settings)
    return on, points.faces.tobytes(), points.barycentric.tobytes()


def _current(opened, courses: list) -> int | None:
    """The index of the course that a curve takes; None if it takes none of them."""
    from ...nicmm_core.courses.comparison import current_course

    if opened.curve is None:
        return None
    mesh = designers.mesh_for(opened.surface.core_positions, opened.surface.faces)
    return current_course(mesh, opened.curve, courses)


def register() -> None:
    bpy.utils.register_class(NICMM_OT_next_course)


def unregister() -> None:
    _found.clear()
    bpy.utils.unregister_class(NICMM_OT_next_course)
