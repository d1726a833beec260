# SPDX-License-Identifier: GPL-3.0-or-later
"""The base of operators that design curves and keep the window responsive meanwhile.

Scripts, the redo panel and background Blender run `execute`, which returns when the curves are
done. In the window `invoke` first waits for a short time, which is enough for most curves. A longer
computation then continues in time slices on timer events until it is done or Esc is pressed.
"""

import sys
import time
from contextlib import contextmanager

import bpy

from .. import preferences
from ..scene import design_request
from ..scene.messages import InputError, user_message
from . import time_slices
from .partial_curve import PartialCurve
from .viewports import NAVIGATION

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
_running: list = []


class LongSolves:
    """A mixin for operators with `requests(context)` and `finish(context, requests, answers)`.

    Each answer is a `Design` of the core or an exception.
    """

    has_handler = False
    """Whether the operator has a modal handler already, so that no second one is added."""

    def execute(self, context):
        return with_error_reports(self, lambda: self._all_at_once(context))

    def invoke(self, context, _event):
        if bpy.app.background:
            return self.execute(context)
        return with_error_reports(self, lambda: self._begin(context))

    def modal(self, context, event):
        if event.type == "ESC" and event.value == "PRESS":
            self.cancel(context)
            self.report({"INFO"}, "Cancelled without changes")
            return {"CANCELLED"}
        if event.type == "TIMER":
            drawing = time.perf_counter() - self._slice_ended
            done = self._work.run_slice(min(max(TIME_SLICE, drawing), LONGEST_TIME_SLICE))
            self._slice_ended = time.perf_counter()
            if done:
                self._tidy(context)
                return with_error_reports(self, lambda: self._end(context))
            self._show(context)
            return {"PASS_THROUGH"}
        return {"PASS_THROUGH" if event.type in PASSED_ON else "RUNNING_MODAL"}

    def cancel(self, context):
        """Cancel the work; also called by Blender when it opens another file or quits."""
        self._work.cancel()
        self._tidy(context)
        vars(self).clear()

    def end(self, context, requests: list, answers: list) -> set:
        """Finish, and drop everything that was kept during the work.

        Blender keeps the last operators for the redo panel, and so would keep their meshes.
        """
        if context.mode == "EDIT_MESH":
            _include_all_data_in_undo()
        try:
            return self.finish(context, requests, answers)
        finally:
            vars(self).clear()

    def _all_at_once(self, context):
        requests = self.requests(context)
        with pointer_progress(context) as progress:
            answers = answer_all(requests, progress)
        return self.end(context, requests, answers)

    def _begin(self, context):
        return self.answer(context, self.requests(context))

    def answer(self, context, requests: list):
        """Answer requests and finish, immediately if they are quick, otherwise in time slices."""
        self._requests = requests
        self._work = time_slices.Work(lambda progress: answer_all(requests, progress))
        if self._work.run_slice(preferences.patience()):
            return self.end(context, requests, self._work.result())
        self._partial, self._shown = PartialCurve(), None
        self._slice_ended = time.perf_counter()
        window_manager = context.window_manager
        self._timer = window_manager.event_timer_add(TIME_SLICE, window=context.window)
        if not self.has_handler:
            window_manager.modal_handler_add(self)
        note_running(self)
        self._show(context)
        return {"RUNNING_MODAL"}

    def _end(self, context):
        answers = self._work.result()
        for request in self._requests:
            request.check_unchanged()
        return self.end(context, self._requests, answers)

    def _show(self, context):
        if self._work.polyline is not self._shown:
            self._shown = self._work.polyline
            request = self._requests[_current_index(self._work.fraction, len(self._requests))]
            self._partial.show(request.in_world(self._shown), request.settings.closed)
        percent = round(100 * self._work.fraction)
        context.workspace.status_text_set(f"{self.bl_label}: {percent}%   |   Esc: Cancel")

    def _tidy(self, context):
        note_ended(self)
        context.window_manager.event_timer_remove(self._timer)
        context.workspace.status_text_set(None)
        self._partial.remove()


def _include_all_data_in_undo() -> None:
    """Make the next undo step of Edit Mode hold all data, not only the edited meshes.

    Blender does so after a data-block has been created.
    """
    bpy.data.meshes.remove(bpy.data.meshes.new("NICMM"))


def note_running(operator) -> None:
    """Record that an operator is waiting for timer events."""
    _running.append(operator)


def note_ended(operator) -> None:
    """Record that an operator no longer waits."""
    _running.remove(operator)


def stop_all() -> None:
    """Cancel all running operators, before the extension is disabled."""
    for operator in list(_running):
        operator.cancel(bpy.context)


def answer_all(requests: list, progress) -> list:
    """Answer requests one after another, without access to Blender's data."""
    from ... import nicmm_core as nicmm

    answers: list = []
    for request in requests:
        done = len(answers)
        try:
            answers.append(
                design_request.answer(
                    request,
                    lambda fraction, polyline, done=done: progress(
                        (done + fraction) / len(requests), polyline
                    ),
                )
            )
        except (InputError, nicmm.NicmmError) as error:
            answers.append(error)
        else:
            if answers[-1].status == nicmm.Status.CANCELLED:
                break
    return answers


def _current_index(fraction: float, count: int) -> int:
    """The index of the current request at a fraction of the total work."""
    return min(int(fraction * count), count - 1)


def with_error_reports(operator, work):
    """Run the work of an operator and turn expected errors into reports."""
    from ... import nicmm_core as nicmm

    try:
        nicmm.Designer  # noqa: B018 - loads the core with its libraries
    except ImportError as error:
        return _cancelled(
            operator,
            f"A library that NICMM Curves needs cannot be loaded ({error}). "
            "Install the zip made for this platform and this Blender version",
        )
    try:
        return work()
    except nicmm.MissingPackageError:
        return _cancelled(
            operator,
            f"The method NICMM (Paper) needs PyTorch, which Blender's Python ({sys.executable}) "
            "cannot import. Install a zip built with --with-torch, or choose the method NICMM",
        )
    except nicmm.NicmmError as error:
        return _cancelled(operator, user_message(error))
    except InputError as error:
        return _cancelled(operator, str(error))


def _cancelled(operator, message: str):
    operator.report({"ERROR"}, message)
    return {"CANCELLED"}


@contextmanager
def pointer_progress(context):
    """Show progress at the mouse pointer; yield the progress function for the core."""
    window_manager = context.window_manager
    window_manager.progress_begin(0.0, 1.0)
    try:
        yield lambda fraction, _polyline: window_manager.progress_update(fraction)
    finally:
        window_manager.progress_end()
