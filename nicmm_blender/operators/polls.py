# SPDX-License-Identifier: GPL-3.0-or-later
"""Checks whether an operator can run, with the messages that disabled buttons show."""

from __future__ import annotations

import bpy

from ..scene import messages

OBJECT = ({"OBJECT"}, "Switch to Object Mode")
OBJECT_OR_EDIT = ({"OBJECT", "EDIT_MESH"}, "Switch to Object Mode or Edit Mode")
OBJECT_EDIT_OR_WEIGHTS = (
    {"OBJECT", "EDIT_MESH", "PAINT_WEIGHT"},
    "Switch to Object Mode, Edit Mode or Weight Paint",
)
TOOL = (
    {"OBJECT", "SCULPT", "PAINT_WEIGHT"},
    "Switch to Object Mode, Sculpt Mode or Weight Paint",
)
TOOL_OR_EDIT = (
    {"OBJECT", "EDIT_MESH", "SCULPT", "PAINT_WEIGHT"},
    "Switch to Object Mode, Edit Mode, Sculpt Mode or Weight Paint",
)
"""The modes in which an operator works, and the message shown in other modes."""

NO_MESH = "Make a mesh object active"
NO_CURVE = "Make a designed curve active"
NO_MESH_OR_CURVE = messages.NO_MESH_OR_CURVE
"""Messages for an active object of the wrong type."""


def usable(
    operator: type[bpy.types.Operator],
    context: bpy.types.Context,
    has_object: bool,
    missing: str,
    modes: tuple[set[str], str],
) -> bool:
    """Whether an operator can run; if not, set its message.

    Parameters
    ----------
    operator : type
        Class of the operator.
    context : bpy.types.Context
    has_object : bool
        Whether the active object is suitable.
    missing : str
        Message if it is not.
    modes : tuple
        Modes in which the operator works, and the message for other modes.
    """
    names, switch = modes
    if not has_object:
        operator.poll_message_set(missing)
        return False
    if context.mode not in names:
        operator.poll_message_set(switch)
        return False
    return True
