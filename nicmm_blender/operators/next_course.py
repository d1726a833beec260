# SPDX-License-Identifier: GPL-3.0-or-later
"""The operator that designs a curve along another course through the same control points.

Dragging and updating keep the course of a curve, even if another one has become fairer. This
operator searches for courses again, and the user chooses one of them.
"""

from dataclasses import replace
from typing import TYPE_CHECKING

import bpy
from bpy.app.handlers import persistent
from bpy.props import IntProperty

from ..outputs import edited_curve
from ..outputs.edited_curve import Opened
from ..scene import curve_record, surface_cache
from ..scene.design_request import DesignRequest
from ..scene.messages import InputError
from ..settings import CURVE
from . import polls
from .long_solves import LongSolves

if TYPE_CHECKING:
    from ...nicmm_core import SurfaceCurve
    from ..scene.design_request import Answer

ALTERNATIVES = 4
"""Greatest number of courses besides the fairest one."""

Key = tuple[str, bytes, bytes, bytes]

_found: "dict[Key, list[SurfaceCurve]]" = {}
"""The courses of the last search by what they depend on, so that a next call takes no time."""


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
    def poll(cls, context: bpy.types.Context) -> bool:
        has_curve = edited_curve.active(context) is not None
        return polls.usable(cls, context, has_curve, polls.NO_CURVE, polls.TOOL)

    def requests(self, context: bpy.types.Context) -> list[DesignRequest]:
        if self.options.is_repeat_last:
            self.course = 0  # it holds the number that was selected last
        edited = edited_curve.chosen(context, self.curve)
        if edited is None:
            raise InputError(polls.NO_CURVE)
        if not curve_record.has_curve(edited):
            raise InputError(curve_record.no_curve_message(edited))
        self._opened = edited_curve.open_curve(context, edited)
        self._key = _key(self._opened)
        if self._key in _found:
            return []
        (request,) = edited_curve.request(self._opened, self._opened.points)
        options = {**request.options, "alternatives": ALTERNATIVES}
        return [replace(request, start=None, options=options)]

    def finish(
        self, context: bpy.types.Context, _requests: list[DesignRequest], answers: "list[Answer]"
    ) -> set[str]:
        opened = self._opened
        if answers:
            fairest = edited_curve.design_of(answers[0])
            _found.clear()
            designs = [fairest, *fairest.alternatives]
            _found[self._key] = [design.curves[0] for design in designs]
        if opened.curve_object is None:
            raise InputError(edited_curve.DELETED)
        courses, name = _found[self._key], opened.curve_object.name
        current = _current(opened, courses)
        if len(courses) == 1 and current == 0:
            self.report({"INFO"}, f'No other course of "{name}" was found')
            return {"CANCELLED"}
        following = 1 if current is None else 1 + (current + 1) % len(courses)
        self.course = min(self.course, len(courses)) or following
        edited_curve.rewrite(opened, opened.points, [courses[self.course - 1]])
        self.report({"INFO"}, f'"{name}": course {self.course} of {len(courses)}{opened.remark}')
        return {"FINISHED"}


def _key(opened: Opened) -> Key:
    """Everything that the courses of a curve depend on."""
    places, corners = opened.points.places, opened.points.corners
    on = curve_record.digest(opened.mesh_object, opened.surface, opened.settings)
    return on, places.faces.tobytes(), places.barycentric.tobytes(), corners.tobytes()


def _current(opened: Opened, courses: "list[SurfaceCurve]") -> int | None:
    """The index of the course that a curve takes; None if it takes none of them."""
    from ...nicmm_core.courses.comparison import current_course

    if opened.curve is None:
        return None
    return current_course(surface_cache.core_mesh(opened.surface), opened.curve, courses)


@persistent
def forget(*_arguments: object) -> None:
    """Drop the courses found before another file is opened."""
    _found.clear()


def register() -> None:
    bpy.utils.register_class(NICMM_OT_next_course)
    bpy.app.handlers.load_pre.append(forget)


def unregister() -> None:
    forget()
    bpy.app.handlers.load_pre.remove(forget)
    bpy.utils.unregister_class(NICMM_OT_next_course)
