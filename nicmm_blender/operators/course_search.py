# SPDX-License-Identifier: GPL-3.0-or-later
"""The base of the operators that search for the courses of a curve.

Dragging and updating keep the course of a curve, even if another one has become fairer. These
operators search for courses again, and the user chooses one of them.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import bpy
from bpy.app.handlers import persistent
from bpy.props import IntProperty

from ..outputs import edited_curve
from ..outputs.edited_curve import Opened
from ..scene import curve_record, surface_cache
from ..scene.design_request import DesignRequest
from ..scene.messages import InputError
from . import polls
from .long_solves import LongSolves

if TYPE_CHECKING:
    from ...nicmm_core import SurfaceCurve
    from ..scene.design_request import Answer

ALTERNATIVES = 4
"""Greatest number of courses besides the fairest one."""

WHOLE = -1
"""Number that means the whole curve instead of one of its legs."""

LEG = IntProperty(
    name="Leg",
    description="Index of the control point at which the leg begins whose course changes, or -1 "
    "for the whole curve",
    default=WHOLE,
    min=WHOLE,
    options={"SKIP_SAVE"},
)
"""The property of operators that names a leg."""

Key = tuple[str, int, tuple[bytes, ...]]


@dataclass(frozen=True)
class Course:
    """A curve along one of the courses through the same points.

    Attributes
    ----------
    curves : list of SurfaceCurve of the core
        The curve, and the second curve of a pair.
    energy : float
        Energy relative to that of the fairest course.
    """

    curves: list[SurfaceCurve]
    energy: float


_found: dict[Key, list[Course]] = {}
"""The courses of the last search by what they depend on, so that a next call takes no time."""


class CourseSearch(LongSolves):
    """A mixin for operators with `use_courses(context, opened, courses)`.

    It searches for the courses of a curve, or of one of its legs, the fairest first, unless they
    are known.
    """

    curve: str
    leg: int
    """Properties of the operators: the name of the curve, and the leg, or -1 for the whole curve.
    """

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        has_curve = edited_curve.active(context) is not None
        return polls.usable(cls, context, has_curve, polls.NO_CURVE, polls.TOOL)

    def use_courses(
        self, context: bpy.types.Context, opened: Opened, courses: list[Course]
    ) -> set[str]:
        """Use the courses that were found."""
        raise NotImplementedError

    def requests(self, context: bpy.types.Context) -> list[DesignRequest]:
        edited = edited_curve.chosen(context, self.curve)
        if edited is None:
            raise InputError(polls.NO_CURVE)
        if not curve_record.has_curve(edited):
            raise InputError(curve_record.no_curve_message(edited))
        self._opened = opened = edited_curve.open_curve(context, edited)
        if self.leg != WHOLE:
            self._opened = opened = _without_via_points(opened, self.leg)
        self._key = _key(opened, self.leg)
        if self._key in _found:
            return []
        (request,) = edited_curve.request(opened, opened.points)
        options = {**request.options, "alternatives": ALTERNATIVES}
        if self.leg != WHOLE:
            return [replace(request, leg=self.leg, options=options)]
        return [replace(request, start=None, options=options)]

    def finish(
        self, context: bpy.types.Context, _requests: list[DesignRequest], answers: list[Answer]
    ) -> set[str]:
        if answers:
            fairest = edited_curve.design_of(answers[0])
            designs = [fairest, *fairest.alternatives]
            _found.clear()
            _found[self._key] = [Course(each.curves, each.relative_energy) for each in designs]
        if self._opened.curve_object is None:
            raise InputError(edited_curve.DELETED)
        return self.use_courses(context, self._opened, _found[self._key])


def index_of_current(opened: Opened, courses: list[Course]) -> int | None:
    """The index of the course that a curve takes; None if it takes none of them."""
    from ...nicmm_core.courses.comparison import current_course

    if opened.curve is None:
        return None
    curves = [course.curves[0] for course in courses]
    return current_course(surface_cache.core_mesh(opened.surface), opened.curve, curves)


def is_only_course(current: int | None, courses: list[Course]) -> bool:
    """Whether the curve takes the only course that was found."""
    return len(courses) == 1 and current == 0


def no_other_course(opened: Opened) -> str:
    """The report that a curve takes the only course that was found."""
    return f'No other course of "{name_of(opened)}" was found'


def name_of(opened: Opened) -> str:
    """The name of an edited curve; an error if it has been deleted meanwhile."""
    if opened.curve_object is None:
        raise InputError(edited_curve.DELETED)
    name: str = opened.curve_object.name
    return name


def _without_via_points(opened: Opened, leg: int) -> Opened:
    """A curve without the via points of a leg for which another course is sought."""
    edited_curve.checked_leg(opened, leg)
    if opened.mirror is not None and opened.mirror.joined:
        raise InputError(
            f'A leg of "{name_of(opened)}" has no other courses of its own, since its mirror image '
            "changes with it. Choose among the courses of the whole curve, or add via points"
        )
    if opened.curve is None:
        raise InputError(
            f'The surface has changed since "{name_of(opened)}" was designed. Run Update '
            "Curves first"
        )
    return replace(opened, via=opened.via.without_leg(leg))


def _key(opened: Opened, leg: int) -> Key:
    """Everything that the courses of a curve, or of one of its legs, depend on."""
    points, via = opened.points.places, opened.via
    on = curve_record.digest(opened.mesh_object, opened.surface, opened.settings, opened.others)
    arrays = [points.faces, points.barycentric, opened.points.corners]
    arrays += [via.legs, via.points.faces, via.points.barycentric]
    if leg != WHOLE and opened.curve is not None:  # the other legs keep their courses
        arrays += [opened.curve.faces, opened.curve.barycentric]
    return on, leg, tuple(each.tobytes() for each in arrays)


@persistent
def forget(*_arguments: object) -> None:
    """Drop the courses found before another file is opened."""
    _found.clear()


def register() -> None:
    bpy.app.handlers.load_pre.append(forget)


def unregister() -> None:
    forget()
    bpy.app.handlers.load_pre.remove(forget)
