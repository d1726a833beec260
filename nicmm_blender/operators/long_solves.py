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
from ..scene.lookup import by_uid
from . import followers
from .answers import answer_all, answer_now
from .error_reports import with_error_reports
from .partial_curve import PartialCurve
from .sliced_operator import SlicedOperator

if TYPE_CHECKING:
    from ..scene.design_request import Answer


class LongSolves(SlicedOperator[list["Answer"]]):
    """A mixin for operators with `requests(context)` and `finish(context, requests, answers)`.

    Each answer is a `Design` of the core or an exception. When the operator has finished, the
    curves that avoid those it has changed follow, in the same undo step.
    """

    changed_curves: tuple[int, ...] = ()
    """The session_uids of the curve objects that `finish` has changed."""

    waits = False
    """Whether the operator returns only when everything is done."""

    _following: followers.Following | None = None
    """What is being designed again after the operator has finished."""

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
        self.waits = True
        requests = self.requests(context)
        return self.end(context, requests, answer_now(context, requests))

    def answer(self, context: bpy.types.Context, requests: list[DesignRequest]) -> set[str]:
        """Answer requests and finish, immediately if they are quick, otherwise in time slices."""
        self._requests = requests
        return self.work_on(context, lambda progress: answer_all(requests, progress))

    def done(self, context: bpy.types.Context, answers: list[Answer]) -> set[str]:
        if self._following is not None:
            return self._end_following(context, answers)
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
            result = self.finish(context, design_request.resolved(requests, answers), answers)
            if "FINISHED" in result and self.changed_curves:
                result = self._follow(context)
        finally:
            if "RUNNING_MODAL" not in result:
                vars(self).clear()
        return result

    def modal(self, context: bpy.types.Context, event: bpy.types.Event) -> set[str]:
        """Esc leaves the curves as they are that have not followed yet."""
        if self._following is None or event.type != "ESC" or event.value != "PRESS":
            return super().modal(context, event)
        self._work.cancel()
        self.tidy(context)
        return with_error_reports(self, lambda: self.done(context, self._work.result()))

    def _follow(self, context: bpy.types.Context) -> set[str]:
        """Design the curves again that avoid changed ones."""
        found = (by_uid(uid) for uid in self.changed_curves)
        self._following = followers.following([each for each in found if each is not None])
        requests = self._requests = self._following.requests
        if self.waits or not requests:
            answers = answer_now(context, requests) if requests else []
            return self._end_following(context, answers)
        self.has_handler = self.has_handler or self.is_sliced
        return self.work_on(context, lambda progress: answer_all(requests, progress))

    def _end_following(self, context: bpy.types.Context, answers: list[Answer]) -> set[str]:
        """Write the curves that follow, and report those that cannot."""
        assert self._following is not None
        try:
            remarks = followers.write(self._following.requests, answers)
            if remarks := self._following.remarks + remarks:
                self.report({"WARNING"}, "; ".join(remarks))
        finally:
            vars(self).clear()
        return {"FINISHED"}

    def progress_text(self) -> str:
        return f"{round(100 * self._work.fraction)}%"

    def show_progress(self, context: bpy.types.Context) -> None:
        super().show_progress(context)
        if self._partial is None:
            self._partial = PartialCurve()
        if len(self._work.polyline):
            request = self._requests[_current_index(self._work.fraction, len(self._requests))]
            line = request.surface.in_world(self._work.polyline)
            self._partial.show(line, request.settings.closed)

    def tidy(self, context: bpy.types.Context) -> None:
        super().tidy(context)
        if self._partial is not None:
            self._partial.remove()
            self._partial = None


def _include_all_data_in_undo() -> None:
    """Make the next undo step of Edit Mode hold all data, not only the edited meshes.

    Blender does so after a data-block has been created.
    """
    bpy.data.meshes.remove(bpy.data.meshes.new("NICMM"))


def _current_index(fraction: float, count: int) -> int:
    """The index of the current request at a fraction of the total work."""
    return min(int(fraction * count), count - 1)
