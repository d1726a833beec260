# SPDX-License-Identifier: GPL-3.0-or-later
"""The tool in the toolbar of the 3D viewport, in Object Mode and in Edit Mode."""

import bpy

from ..scene import mesh_data
from .edit_operator import NICMM_OT_edit_curve

ICON = "ops.curve.pen"

KEYMAP = (
    (
        NICMM_OT_edit_curve.bl_idname,
        {"type": "LEFTMOUSE", "value": "PRESS"},
        {"properties": [("at_mouse", True)]},
    ),
)


class _SurfaceCurve:
    bl_space_type = "VIEW_3D"
    bl_label = "Surface Curve"
    bl_description = (
        "Draw a curve on the surface of the active mesh point by point.\n"
        "Click on a designed curve to edit it"
    )
    bl_icon = ICON
    bl_widget = None
    bl_keymap = KEYMAP

    @staticmethod
    def draw_settings(context, layout, _tool):
        """Draw the settings of a new curve in the header."""
        properties = context.scene.nicmm_curves
        for name in ("closed", "smoothness"):
            layout.prop(properties, name)
        mesh_object = mesh_data.mesh_object(context)
        if mesh_object is not None:
            for name in ("obstacle_group", "alignment_group"):
                layout.prop_search(properties, name, mesh_object, "vertex_groups")


class NICMM_WT_object(_SurfaceCurve, bpy.types.WorkSpaceTool):
    bl_context_mode = "OBJECT"
    bl_idname = "nicmm.surface_curve"


class NICMM_WT_edit_mesh(_SurfaceCurve, bpy.types.WorkSpaceTool):
    bl_context_mode = "EDIT_MESH"
    bl_idname = "nicmm.surface_curve_edit_mesh"


def register() -> None:
    bpy.utils.register_tool(NICMM_WT_object, separator=True)
    bpy.utils.register_tool(NICMM_WT_edit_mesh, separator=True)


def unregister() -> None:
    bpy.utils.unregister_tool(NICMM_WT_edit_mesh)
    bpy.utils.unregister_tool(NICMM_WT_object)
