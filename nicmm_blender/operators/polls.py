# SPDX-License-Identifier: GPL-3.0-or-later
"""Checks whether an operator can be used, and the messages of disabled buttons."""

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
"""Modes that an operator works in, and the message in other modes."""

NO_MESH = "Make a mesh object active"
NO_CURVE = "Make a designed curve active"
NO_MESH_OR_CURVE = "Make a mesh or a designed curve active"
"""Messages where the active object is of the wrong kind."""


def usable(operator, context, has_object: bool, missing: str, modes: tuple) -> bool:
    """Whether the active object and the mode are right for an operator."""
    names, switch = modes
    if not has_object:
        operator.poll_message_set(missing)
        return False
    if context.mode not in names:
        operator.poll_message_set(switch)
        return False
    return True
