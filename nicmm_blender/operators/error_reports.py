# SPDX-License-Identifier: GPL-3.0-or-later
"""Turns expected errors into reports of operators."""

from __future__ import annotations

from collections.abc import Callable

import bpy

from ..scene.messages import InputError, user_message


def with_error_reports(operator: bpy.types.Operator, work: Callable[[], set[str]]) -> set[str]:
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
    except nicmm.NicmmError as error:
        return _cancelled(operator, user_message(error))
    except InputError as error:
        return _cancelled(operator, str(error))


def called(
    operator: bpy.types.Operator, call: Callable[..., set[str]], how: str, **arguments: object
) -> set[str]:
    """Call another operator with an undo step, and report its errors as those of this one.

    `how` is "INVOKE_DEFAULT" or "EXEC_DEFAULT".
    """
    try:
        call(how, True, **arguments)
    except RuntimeError as error:  # Blender raises what the operator has reported
        return _cancelled(operator, str(error).removeprefix("Error: ").strip())
    return {"FINISHED"}


def _cancelled(operator: bpy.types.Operator, message: str) -> set[str]:
    operator.report({"ERROR"}, message)
    return {"CANCELLED"}
