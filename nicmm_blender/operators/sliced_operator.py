# SPDX-License-Identifier: GPL-3.0-or-later
"""The base of operators that keep the window responsive during long work.

Such an operator first waits for a short time, which is enough for most work. Longer work then
continues in time slices on timer events until it is done or Esc is pressed.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import TYPE_CHECKING, Any, Generic

import bpy

from .. import preferences
from ..scene.viewports import NAVIGATION
from .error_reports import with_error_reports
from .time_slices import Result, Work

if TYPE_CHECKING:
    from ...nicmm_core.progress import Progress

TIME_SLICE = 0.03
"""Seconds of work for each timer event, about the duration of one frame."""

LONGEST_TIME_SLICE = 0.25
"""Maximum seconds of a time slice. Up to this limit, it takes as long as drawing does."""

PASSED_ON = NAVIGATION | {
    "MOUSEMOVE",
    "INBETWEEN_MOUSEMOVE",
    "WHEELINMOUSE",
    "WHEELOUTMOUSE",
    "WINDOW_DEACTIVATE",
}
"""Events that are passed on to Blender, since they do not change the data of the operator."""


# Operators that are waiting for timer events.
_running: list[SlicedOperator[Any]] = []


class SlicedOperator(Generic[Result]):
    """A mixin for operators with `done(context, result)` and `progress_text()`."""

    bl_label: str
    report: Callable[[set[str], str], object]
    """Both are those of `bpy.types.Operator`."""

    has_handler = False
    """Whether the operator has a modal handler already, so that no second one is added."""

    is_sliced = False
    """Whether the work has taken longer than the first waiting time."""

    def done(self, context: bpy.types.Context, result: Result) -> set[str]:
        """Use the result of the work."""
        raise NotImplementedError

    def progress_text(self) -> str:
        """Text about the progress for the status bar."""
        raise NotImplementedError

    def work_on(
        self, context: bpy.types.Context, function: Callable[[Progress], Result]
    ) -> set[str]:
        """Call `function(progress)`, and `done` with its result; in time slices if it is long."""
        self._work = Work(function)
        if self._work.run_slice(preferences.patience()):
            return self.done(context, self._work.result())
        self.is_sliced = True
        self._slice_ended = time.perf_counter()
        window_manager = context.window_manager
        self._timer = window_manager.event_timer_add(TIME_SLICE, window=context.window)
        if not self.has_handler:
            window_manager.modal_handler_add(self)
        _running.append(self)
        self.show_progress(context)
        return {"RUNNING_MODAL"}

    def modal(self, context: bpy.types.Context, event: bpy.types.Event) -> set[str]:
        if event.type == "ESC" and event.value == "PRESS":
            self.cancel(context)
            self.report({"INFO"}, "Cancelled without changes")
            return {"CANCELLED"}
        if event.type == "TIMER":
            drawing = time.perf_counter() - self._slice_ended
            done = self._work.run_slice(min(max(TIME_SLICE, drawing), LONGEST_TIME_SLICE))
            self._slice_ended = time.perf_counter()
            if done:
                self.tidy(context)
                return with_error_reports(self, lambda: self.done(context, self._work.result()))
            self.show_progress(context)
            return {"PASS_THROUGH"}
        return {"PASS_THROUGH" if event.type in PASSED_ON else "RUNNING_MODAL"}

    def cancel(self, context: bpy.types.Context) -> None:
        """Cancel the work; also called by Blender when it opens another file or quits."""
        self._work.cancel()
        self.tidy(context)
        vars(self).clear()

    def show_progress(self, context: bpy.types.Context) -> None:
        """Show the progress in the status bar."""
        text = f"{self.bl_label}: {self.progress_text()}   |   Esc: Cancel"
        context.workspace.status_text_set(text)

    def tidy(self, context: bpy.types.Context) -> None:
        """End the time slices and restore the window."""
        _running.remove(self)
        context.window_manager.event_timer_remove(self._timer)
        context.workspace.status_text_set(None)


def stop_all() -> None:
    """Cancel all running operators, before the extension is disabled."""
    for operator in list(_running):
        operator.cancel(bpy.context)
