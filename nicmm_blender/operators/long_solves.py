# SPDX-License-Identifier: GPL-3.0-or-later
"""The base of operators that design curves.

Scripts, the redo panel and background Blender run `execute`, which returns when the curves are
done. In the window a long computation continues in time slices and shows the unfinished curve.
"""

import bpy

from ..scene import design_request
from ..scene.messages import InputError
from .error_reports import with_error_reports
from .partial_curve import PartialCurve
from .sliced_operator import SlicedOperator


class LongSolves(SlicedOperator):
    """A mixin for operators with `requests(context)` and `finish(context, requests, answers)`.

    Each answer is a `Design` of the core or an exception.
    """

    _partial: PartialCurve | None = None

    def execute(self, context):
        return with_error_reports(self, lambda: self._all_at_once(context))

    def invoke(self, context, _event):
        if bpy.app.background:
            return self.execute(context)
        return with_error_reports(self, lambda: self.answer(context, self.requests(context)))

    def _all_at_once(self, context):
        requests = self.requests(context)
        return self.end(context, requests, answer_now(context, requests))

    def answer(self, context, requests: list):
        """Answer requests and finish, immediately if they are quick, otherwise in time slices."""
        self._requests = requests
        return self.work_on(context, lambda progress: answer_all(requests, progress))

    def done(self, context, answers: list) -> set:
        if self.is_sliced:
            for request in self._requests:
                request.check_unchanged()
        return self.end(context, self._requests, answers)

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

    def progress_text(self) -> str:
        return f"{round(100 * self._work.fraction)}%"

    def show_progress(self, context) -> None:
        super().show_progress(context)
        if self._partial is None:
            self._partial = PartialCurve()
        if len(self._work.polyline):
            request = self._requests[_current_index(self._work.fraction, len(self._requests))]
            line = request.in_world(self._work.polyline)
            self._partial.show(line, request.settings.closed)

    def tidy(self, context) -> None:
        super().tidy(context)
        self._partial.remove()


def _include_all_data_in_undo() -> None:
    """Make the next undo step of Edit Mode hold all data, not only the edited meshes.

    Blender does so after a data-block has been created.
    """
    bpy.data.meshes.remove(bpy.data.meshes.new("NICMM"))


def answer_now(context, requests: list) -> list:
    """Answer requests, and show the progress at the mouse pointer."""
    window_manager = context.window_manager
    window_manager.progress_begin(0.0, 1.0)
    try:
        return answer_all(
            requests, lambda fraction, _polyline: window_manager.progress_update(fraction)
        )
    finally:
        window_manager.progress_end()


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
