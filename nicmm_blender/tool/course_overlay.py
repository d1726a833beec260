# SPDX-License-Identifier: GPL-3.0-or-later
"""Draws the courses among which the user chooses, each with its energy, over the 3D viewports.

The chosen course is drawn like a curve that is being changed (`overlay.show_dragged`), here once
more above the others, which are thin lines.
"""

from __future__ import annotations

from dataclasses import dataclass

import blf
import bpy
import numpy as np

from ..operators.course_search import Course
from ..outputs import edited_curve
from ..outputs.edited_curve import Opened
from ..scene.lookup import by_uid
from ..scene.viewports import redraw
from . import overlay, picking
from .view import View

THIN = 1.5
"""Width in pixels, at a resolution scale of 1, of the courses that are not chosen."""

TEXT_SIZE, TEXT_OFFSET = 13.0, (10.0, 6.0)
"""Size of the labels and their offset from their lines, in pixels at a scale of 1."""


@dataclass(frozen=True)
class _Shown:
    """Courses of a curve and the index of the chosen one."""

    opened: Opened
    courses: list[Course]
    lines: list[np.ndarray]
    chosen: int


class _State:
    """What is drawn."""

    def __init__(self) -> None:
        self.handlers: list[object] = []
        self.shown: _Shown | None = None
        self.places: np.ndarray = np.zeros((0, 2))
        self.places_of: tuple[object, ...] = ()


_state = _State()


def show(opened: Opened, courses: list[Course], lines: list[np.ndarray], chosen: int) -> None:
    """Draw courses, whose lines are in the local space of the mesh."""
    _state.shown = _Shown(opened, courses, lines, chosen)
    overlay.show_dragged(opened, courses[chosen].curves)
    redraw()


def is_shown() -> bool:
    """Whether courses are drawn."""
    return _state.shown is not None


def hide() -> None:
    """Draw the active curve again instead of courses."""
    _state.shown, _state.places_of = None, ()
    overlay.show_active()
    redraw()


def lines_of(opened: Opened, courses: list[Course]) -> list[np.ndarray]:
    """The points of courses in the local space of the mesh."""
    return [edited_curve.polyline_of(opened.surface, course.curves[0]) for course in courses]


def energy_text(course: Course) -> str:
    """The energy of a course relative to that of the fairest one, such as "1.35×"."""
    return f"{course.energy:.2f}×"


def _draw_lines() -> None:
    shown = _state.shown
    if shown is None or (mesh_object := by_uid(shown.opened.mesh_uid)) is None:
        return
    context = bpy.context
    nearer = overlay.towards_the_eye(
        context.region_data, mesh_object, shown.opened.surface, overlay.radius_of(shown.opened)
    )
    colours, batches = overlay.Colours(context), list(map(overlay.batch_of_line, shown.lines))
    for number, batch in enumerate(batches):
        if number != shown.chosen:
            overlay.draw_line(context, nearer, batch, colours.point, THIN)
    overlay.draw_line(context, nearer, batches[shown.chosen], colours.line)


def _draw_labels() -> None:
    shown = _state.shown
    if shown is None or (mesh_object := by_uid(shown.opened.mesh_uid)) is None:
        return
    context = bpy.context
    colours = overlay.Colours(context)
    view = picking.view_on(context, mesh_object, shown.opened.surface)
    scale, font = context.preferences.system.ui_scale, 0
    blf.size(font, TEXT_SIZE * scale)
    blf.enable(font, blf.SHADOW)
    blf.shadow(font, 5, *overlay.OUTLINE, 1.0)
    for number, (x, y) in enumerate(_label_places(view, shown)):
        if not np.isfinite(x):
            continue
        colour = colours.line if number == shown.chosen else colours.point
        blf.color(font, *colour[:3], 1.0)
        blf.position(font, x + TEXT_OFFSET[0] * scale, y + TEXT_OFFSET[1] * scale, 0.0)
        blf.draw(font, energy_text(shown.courses[number]))
    blf.disable(font, blf.SHADOW)


def _label_places(view: View, shown: _Shown) -> np.ndarray:
    """Pixels of the labels, computed only if the view or the courses have changed."""
    key = view.perspective.tobytes(), view.size.tobytes(), view.xray, id(shown.courses)
    if _state.places_of != key:
        _state.places, _state.places_of = view.label_places(shown.lines), key
    return _state.places


def register() -> None:
    add = bpy.types.SpaceView3D.draw_handler_add
    _state.handlers = [
        add(_draw_lines, (), "WINDOW", "POST_VIEW"),
        add(_draw_labels, (), "WINDOW", "POST_PIXEL"),
    ]


def unregister() -> None:
    for handler in _state.handlers:
        bpy.types.SpaceView3D.draw_handler_remove(handler, "WINDOW")
    _state.handlers.clear()
    _state.shown = None
