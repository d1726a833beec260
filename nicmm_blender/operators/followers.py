# SPDX-License-Identifier: GPL-3.0-or-later
"""Designs the curves again that avoid a curve which has changed, so that they follow it.

Operators do this at their end, in the same undo step. A curve that cannot follow keeps its shape,
and a remark says why. Its digest then differs from the present one, so *Live* and *Update Curves*
try again.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import bpy

from ..outputs import writing
from ..scene import avoided_curves, curve_record, design_request, surface_cache
from ..scene.design_request import DesignRequest
from ..scene.lookup import by_uid
from ..scene.messages import InputError, user_message
from .answers import answer_now

if TYPE_CHECKING:
    from ..scene.design_request import Answer


@dataclass(frozen=True)
class Following:
    """Requests for curves that follow, and why other curves cannot follow.

    Attributes
    ----------
    requests : list of DesignRequest
        In the order of the curves.
    remarks : list of str
    """

    requests: list[DesignRequest]
    remarks: list[str]


def following(changed: Collection[bpy.types.Object]) -> Following:
    """What has to be designed again after curves of one mesh, or their order, have changed.

    These are the curves that avoid others and of which something that they depend on has changed.
    """
    from ... import nicmm_core as nicmm

    requests: list[DesignRequest] = []
    remarks: list[str] = []
    for each in avoided_curves.from_first_of(changed):
        try:
            request = _request(each, {request.curve_uid for request in requests})
        except (InputError, nicmm.NicmmError) as error:
            remarks.append(_remark(each, error))
            continue
        if request is not None:
            requests.append(request)
    return Following(requests, remarks)


def _request(curve_object: bpy.types.Object, redesigned: set[int]) -> DesignRequest | None:
    """The request for a curve that follows; None if nothing that it depends on changes."""
    mesh_object = curve_record.mesh_in_any_scene(curve_object)
    settings = curve_record.settings_of(curve_object)
    surface = surface_cache.get(mesh_object, settings.use_modifiers)
    others = avoided_curves.above(curve_object, mesh_object, surface, settings)
    now = curve_record.digest(mesh_object, surface, settings, others)
    avoids_new = any(other.uid in redesigned for other in others)
    if curve_record.is_current(curve_object, now) and not avoids_new:
        return None
    writing.check_replaceable(curve_object)
    return design_request.for_curve(curve_object, mesh_object, surface, settings)


def write(requests: Sequence[DesignRequest], answers: Sequence[Answer]) -> list[str]:
    """Write the answers into the curve objects; return remarks about those that keep their shape.

    Requests without an answer were cancelled.
    """
    from ... import nicmm_core as nicmm

    remarks = []
    requests = design_request.resolved(requests, answers)
    for number, request in enumerate(requests):
        curve_object = by_uid(request.curve_uid)
        if curve_object is None:
            continue
        try:
            if number >= len(answers) or _is_cancelled(answers[number]):
                raise InputError("It was cancelled. Run Update Curves")
            request.check_unchanged()
            writing.replace(curve_object, request, answers[number])
        except (InputError, nicmm.NicmmError) as error:
            remarks.append(_remark(curve_object, error))
    return remarks


def _is_cancelled(answer: Answer) -> bool:
    from ... import nicmm_core as nicmm

    return isinstance(answer, nicmm.Design) and answer.status is nicmm.Status.CANCELLED


def follow_now(context: bpy.types.Context, changed: Collection[bpy.types.Object]) -> list[str]:
    """Design the curves again that follow changed ones; return remarks about those that cannot."""
    found = following(changed)
    if not found.requests:
        return found.remarks
    return found.remarks + write(found.requests, answer_now(context, found.requests))


def _remark(curve_object: bpy.types.Object, error: Exception) -> str:
    text = str(error) if isinstance(error, InputError) else user_message(error)
    return f'"{curve_object.name}" keeps its shape: {text}'
