# SPDX-License-Identifier: GPL-3.0-or-later
"""Whether an operator can be used, and what Blender says where it cannot."""

OBJECT = ({"OBJECT"}, "Switch to Object Mode")
OBJECT_OR_EDIT = ({"OBJECT", "EDIT_MESH"}, "Switch to Object Mode or Edit Mode")
OBJECT_EDIT_OR_WEIGHTS = (
    {"OBJECT", "EDIT_MESH", "PAINT_WEIGHT"},
    "Switch to Object Mode, Edit Mode or Weight Paint",
)
"""Modes that an operator works in, and what to do in others."""

NO_MESH = "Make a mesh object active"
NO_CURVE = "Make a curve active that was designed on a mesh"
NO_MESH_OR_CURVE = "Make a mesh or a designed curve active"
"""What to do where the object that an operator needs is not the active one."""


def usable(operator, context, has_object: bool, missing: str, modes: tuple) -> bool:
    """Whether the object that an operator needs is active, and the mode is right."""
    names, switch = modes
    if not has_object:
        operator.poll_message_set(missing)
        return False
    if context.mode not in names:
        operator.poll_message_set(switch)
        return False
    return True
