# SPDX-License-Identifier: GPL-3.0-or-later
"""Answers requests for curves one after another, so that later curves avoid earlier ones."""

from __future__ import annotations

from typing import TYPE_CHECKING

import bpy

from ..scene import design_request
from ..scene.design_request import DesignRequest, NewCurves
from ..scene.messages import InputError

if TYPE_CHECKING:
    from ...nicmm_core.progress import Progress
    from ..scene.design_request import Answer


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
    """Answer requests one after another, without access to Blender's data.

    Curves of later requests avoid the new curves of earlier ones (`design_request.resolved`).
    """
    from ... import nicmm_core as nicmm

    answers: list[Answer] = []
    designed: NewCurves = {}
    for each in requests:
        request = design_request.with_new_curves(each, designed)
        try:
            design = design_request.answer(request, _part(progress, len(answers), len(requests)))
        except (InputError, nicmm.NicmmError) as error:
            answers.append(error)
        else:
            answers.append(design)
            designed |= design_request.new_curves(request, design)
            if design.status == nicmm.Status.CANCELLED:
                break
    return answers


def _part(progress: Progress, done: int, total: int) -> Progress:
    """The progress function for the next of `total` parts of the work, after `done` parts."""
    return lambda fraction, polyline: progress((done + fraction) / total, polyline)
