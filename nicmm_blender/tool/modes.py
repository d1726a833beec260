# SPDX-License-Identifier: GPL-3.0-or-later
"""The modes that the tool works in, and the choice of the active curve in each of them.

The tool does not work in mesh Edit Mode, where Blender's undo does not restore other objects, so a
click could not be undone. There, control points are selected vertices.
"""

from __future__ import annotations

import bpy

from ..outputs import curve_object
from ..scene import curve_record
from ..scene.lookup import is_in

TOOLS = {
    "OBJECT": "nicmm.surface_curve",
    "SCULPT": "nicmm.surface_curve_sculpt",
    "PAINT_WEIGHT": "nicmm.surface_curve_weights",
}
"""The identifier of the tool in each mode of the context."""

WRONG_MODE = (
    "The Surface Curve tool works in Object Mode, Sculpt Mode and Weight Paint. In Edit Mode, "
    "select vertices and run Design Curve on Surface"
)


def is_tool_active(context: bpy.types.Context) -> bool:
    """Whether the tool is active in the current mode."""
    if context.mode not in TOOLS or context.workspace is None:
        return False
    tool = context.workspace.tools.from_space_view3d_mode(context.mode, create=False)
    return tool is not None and tool.idname == TOOLS[context.mode]


def make_active(context: bpy.types.Context, curve: bpy.types.Object | None) -> None:
    """Make a designed curve the active one, which is drawn; None ends drawing.

    In Object Mode it becomes the active object. In other modes the mesh stays active, and the
    selection determines which of its curves is drawn.
    """
    mesh_object = context.active_object if curve is None else curve_record.mesh_of(curve)
    if curve_record.has_record(mesh_object):
        mesh_object = curve_record.mesh_of(mesh_object)
    if context.mode == "OBJECT":
        shown = curve or mesh_object
        if shown is not None and is_in(context.view_layer, shown):
            curve_object.select_only(context, shown)
        return
    for other in curve_record.designed_on(mesh_object):
        if is_in(context.view_layer, other):
            other.select_set(other == curve)
