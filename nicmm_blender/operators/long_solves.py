# SPDX-License-Identifier: GPL-3.0-or-later
"""The base of operators that design curves.

Scripts, the redo panel and background Blender run `execute`, which returns when the curves are
done. In the window a long computation continues in time slices and shows the unfinished curve.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import bpy

from ..scene import design_request
from ..scene.design_request import DesignRequest
from ..scene.messages import InputError
from .error_reports import with_error_reports
from .partial_curve import PartialCurve
from .sliced_operator import SlicedOperator

if TYPE_CHECKING:
    from ...nicmm_core.progress import Progress
    from ..scene.design_request import Answer


class LongSolves(SlicedOperator[list["Answer"]]):
    """A mixin for operators with `requests(context)` and `finish(context, requests, answers)`.

    Each answer is a `Design` of the core or an exception.
    """

    _partial: PartialCurve | None = None

    def requests(self, context: bpy.types.Context) -> list[DesignRequest]:
        """The requests for the curves to design."""
        raise NotImplementedError

    def finish(
        self, context: bpy.types.Context, requests: list[DesignRequest], answers: list[Answer]
    ) -> set[str]:
        """Use the answers to the requests."""
        raise NotImplementedError

    def execute(self, context: bpy.types.Context) -> set[str]:
        return with_error_reports(self, lambda: self._all_at_once(context))

    def invoke(self, context: bpy.types.Context, _event: bpy.types.Event) -> set[str]:
        if bpy.app.background:
            return self.execute(context)
        return with_error_reports(self, lambda: self.answer(context, self.requests(context)))

    def _all_at_once(self, context: bpy.types.Context) -> set[str]:
        requests = self.requests(context)
        return self.end(context, requests, answer_now(context, requests))

    def answer(self, context: bpy.types.Context, requests: list[DesignRequest]) -> set[str]:
        """Answer requests and finish, immediately if they are quick, otherwise in time slices."""
        self._requests = requests
        return self.work_on(context, lambda progress: answer_all(requests, progress))

    def done(self, context: bpy.types.Context, answers: list[Answer]) -> set[str]:
        if self.is_sliced:
            for request in self._requests:
                request.check_unchanged()
        return self.end(context, self._requests, answers)

    def end(
        self, context: bpy.types.Context, requests: list[DesignRequest], answers: list[Answer]
    ) -> set[str]:
        """Finish, and drop everything that was kept during the work unless the operator goes on.

        Blender keeps the last operators for the redo panel, and so would keep their meshes.
        """
        if context.mode == "EDIT_MESH":
            _include_all_data_in_undo()
        result: set[str] = set()
        try:
            result = self.finish(context, requests, answers)
        finally:
            if "RUNNING_MODAL" not in result:
                vars(self).clear()
        return result

    def progress_text(self) -> str:
        return f"{round(100 * self._work.fraction)}%"

    def show_progress(self, context: bpy.types.Context) -> None:
        super().show_progress(context)
        if self._partial is None:
            self._partial = PartialCurve()
        if len(self._work.polyline):
            request = self._requests[_current_index(self._work.fraction, len(self._requests))]
            line = request.in_world(self._work.polyline)
            self._partial.show(line, request.settings.closed)

    def tidy(self, context: bpy.types.Context) -> None:
        super().tidy(context)
        if self._partial is not None:
            self._partial.remove()


def _include_all_data_in_undo() -> None:
    """Make the next undo step of Edit Mode hold all data, not only the edited meshes.

    Blender does so after a data-block has been created.
    """
    bpy.data.meshes.remove(bpy.data.meshes.new("NICMM"))


def answer_now(context: bpy.types.Context, requests: list[DesignRequest]) -> list[Answer]:
    """Answer requests, and show the progress at the mouse pointer."""
    window_manager = context.window_manager
    window_manager.progress_begin(0.0, 1.0)
    try:
        return answer_all(
            requests, lambda fraction, _polyline: window_manager.progress_update(fraction)
        )
    finally:
        window_manager.progress_end()


def answer_all(requests: list[DesignRequest], progress: Progress) -> list[Answer]:
    """Answer requests one after another, without access to Blender's data."""
    from ... import nicmm_core as nicmm

    answers: list[Answer] = []
    for request in requests:
        try:
            design = design_request.answer(request, _part(progress, len(answers), len(requests)))
        except (InputError, nicmm.NicmmError) as error:
            answers.append(error)
        else:
            answers.append(design)
            if design.status == nicmm.Status.CANCELLED:
                break
    return answers


def _part(progress: Progress, done: int, total: int) -> Progress:
    """The progress function for the next of `total` parts of the work, after `done` parts."""
    return lambda fraction, polyline: progress((done + fraction) / total, polyline)


def _current_index(fraction: float, count: int) -> int:
    """The index of the current request at a fraction of the total work."""
    return min(int(fraction * count), count - 1)
