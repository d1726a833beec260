# SPDX-License-Identifier: GPL-3.0-or-later
"""What operators that design curves share: short work at once, long work with the window alive.

Scripts, the redo panel and background Blender run `execute`, which does not return before the
curves are there. From the window `invoke` waits as long as most curves take; what takes longer goes
on by turns, a timer giving them, until it is done or Esc is pressed.
"""

import sys
import time
from contextlib import contextmanager

import bpy

from .. import preferences
from ..scene import design_request, mesh_data
from . import turns
from .partial_curve import PartialCurve
from .viewports import NAVIGATION

TURN = 0.03
"""Seconds; about the time between two pictures of the window."""

LONGEST_TURN = 0.25
"""Seconds. Where the window takes longer to draw, turns are as long, so that work goes on."""

PASSED_ON = NAVIGATION | {
    "MOUSEMOVE",
    "INBETWEEN_MOUSEMOVE",
    "WHEELINMOUSE",
    "WHEELOUTMOUSE",
    "WINDOW_DEACTIVATE",
}
"""Events that change nothing of what the operator works on."""


# Operators that wait for their turns.
_running: list = []


class LongSolves:
    """For operators; they have `requests(context)` and `finish(context, requests, answers)`.

    An answer is a design of the core, or the error that there is instead.
    """

    def execute(self, context):
        return reporting(self, lambda: self._all_at_once(context))

    def invoke(self, context, _event):
        if bpy.app.background:
            return self.execute(context)
        return reporting(self, lambda: self._begin(context))

    def modal(self, context, event):
        if event.type == "ESC" and event.value == "PRESS":
            self.cancel(context)
            self.report({"INFO"}, "Cancelled; nothing has changed")
            return {"CANCELLED"}
        if event.type == "TIMER":
            drawing = time.perf_counter() - self._turn_ended
            done = self._work.turn(min(max(TURN, drawing), LONGEST_TURN))
            self._turn_ended = time.perf_counter()
            if done:
                self._tidy(context)
                return reporting(self, lambda: self._end(context))
            self._show(context)
            return {"PASS_THROUGH"}
        return {"PASS_THROUGH" if event.type in PASSED_ON else "RUNNING_MODAL"}

    def cancel(self, context):
        """Also called by Blender, when it opens another file or ends."""
        self._work.cancel()
        self._tidy(context)

    def _all_at_once(self, context):
        requests = self.requests(context)
        with _pointer_progress(context) as progress:
            answers = answer_all(requests, progress)
        return self.finish(context, requests, answers)

    def _begin(self, context):
        self._requests = requests = self.requests(context)
        self._work = turns.Work(lambda progress: answer_all(requests, progress))
        if self._work.turn(preferences.patience()):
            return self._end(context)
        self._partial, self._shown = PartialCurve(), None
        self._turn_ended = time.perf_counter()
        window_manager = context.window_manager
        self._timer = window_manager.event_timer_add(TURN, window=context.window)
        window_manager.modal_handler_add(self)
        _running.append(self)
        self._show(context)
        return {"RUNNING_MODAL"}

    def _end(self, context):
        answers = self._work.result()
        for request in self._requests:
            request.check_unchanged()
        return self.finish(context, self._requests, answers)

    def _show(self, context):
        if self._work.polyline is not self._shown:
            self._shown = self._work.polyline
            request = self._requests[_place(self._work.fraction, len(self._requests))]
            self._partial.show(request.in_world(self._shown), request.asked.closed)
        percent = round(100 * self._work.fraction)
        context.workspace.status_text_set(f"{self.bl_label}: {percent} %   |   Esc: Cancel")

    def _tidy(self, context):
        _running.remove(self)
        context.window_manager.event_timer_remove(self._timer)
        context.workspace.status_text_set(None)
        self._partial.remove()


def stop_all() -> None:
    """Cancel what is running; before the extension is disabled."""
    for operator in list(_running):
        operator.cancel(bpy.context)


def answer_all(requests: list, progress) -> list:
    """Answer requests one after another; touches no Blender data."""
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
        except (mesh_data.InputError, nicmm.NicmmError) as error:
            answers.append(error)
        else:
            if answers[-1].status == nicmm.Status.CANCELLED:
                break
    return answers


def _place(fraction: float, count: int) -> int:
    """The request that is being answered when a fraction of all is done."""
    return min(int(fraction * count), count - 1)


def reporting(operator, work):
    """Do an operator's work; what it cannot do becomes a report that says what would mend it."""
    from ... import nicmm_core as nicmm

    try:
        nicmm.Designer  # noqa: B018 - loads the core with its libraries
    except ImportError as error:
        return _cancelled(
            operator,
            f"A library that NICMM Curves needs cannot be loaded ({error}). "
            "Install the zip that was made for this platform and this Blender",
        )
    try:
        return work()
    except nicmm.MissingPackageError as error:
        return _cancelled(
            operator,
            f"{error}. Blender's Python is {sys.executable}; a zip of NICMM Curves that was "
            "built with --with-torch brings PyTorch along",
        )
    except (mesh_data.InputError, nicmm.NicmmError) as error:
        return _cancelled(operator, str(error))


def _cancelled(operator, message: str):
    operator.report({"ERROR"}, message)
    return {"CANCELLED"}


@contextmanager
def _pointer_progress(context):
    """Show progress at the mouse pointer; gives the callable that the core reports to."""
    window_manager = context.window_manager
    window_manager.progress_begin(0.0, 1.0)
    try:
        yield lambda fraction, _polyline: window_manager.progress_update(fraction)
    finally:
        window_manager.progress_end()
