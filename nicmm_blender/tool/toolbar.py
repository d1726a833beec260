# SPDX-License-Identifier: GPL-3.0-or-later
"""Registers the tool in the toolbar of the 3D viewport, in the modes that it works in."""

import bpy

from ..operators import curve_settings
from ..operators.next_course import NICMM_OT_next_course
from ..outputs import edited_curve
from ..scene import mesh_data
from ..settings import draw_avoid_others, draw_mirror_in_header
from . import course_overlay, modes
from .course_choice import NICMM_OT_choose_course
from .draw_operator import NICMM_OT_draw_on_surface
from .point_operators import NICMM_OT_end_curve, NICMM_OT_toggle_corner

ICON = "ops.curve.pen"
LABEL = "Surface Curve"

KEYMAP = (
    (NICMM_OT_draw_on_surface.bl_idname, {"type": "LEFTMOUSE", "value": "PRESS"}, None),
    (
        NICMM_OT_draw_on_surface.bl_idname,
        {"type": "LEFTMOUSE", "value": "PRESS", "ctrl": True},
        {"properties": [("remove", True)]},
    ),
    (NICMM_OT_toggle_corner.bl_idname, {"type": "J", "value": "PRESS"}, None),
    (
        NICMM_OT_draw_on_surface.bl_idname,
        {"type": "LEFTMOUSE", "value": "PRESS", "shift": True},
        {"properties": [("via", True)]},
    ),
    (NICMM_OT_end_curve.bl_idname, {"type": "LEFTMOUSE", "value": "DOUBLE_CLICK"}, None),
    (NICMM_OT_end_curve.bl_idname, {"type": "RET", "value": "PRESS"}, None),
    (NICMM_OT_end_curve.bl_idname, {"type": "NUMPAD_ENTER", "value": "PRESS"}, None),
    *(
        (NICMM_OT_choose_course.bl_idname, {"type": key, "value": "PRESS", **held}, values)
        for key in ("RET", "NUMPAD_ENTER")
        for held, values in (
            ({"shift": True}, None),
            ({"shift": True, "ctrl": True}, {"properties": [("under_mouse", True)]}),
        )
    ),
)
"""Mouse buttons and keys of the tool.

J has no use in these modes of Blender; the other letters are left to Blender, and Alt to *Emulate 3
Button Mouse*.
"""

HINTS = (
    (("MOUSE_LMB",), "Add or Insert Point"),
    (("MOUSE_LMB_DRAG",), "Move Point"),
    (("EVENT_CTRL", "MOUSE_LMB"), "Remove Point or Invert Snap"),
    (("EVENT_J",), "Toggle Corner"),
    (("EVENT_SHIFT", "MOUSE_LMB_DRAG"), "Via Point on Curve"),
    (("EVENT_RETURN",), "End Curve"),
    (("EVENT_SHIFT", "EVENT_RETURN"), "Choose Course"),
    (("EVENT_CTRL", "EVENT_SHIFT", "EVENT_RETURN"), "Choose Course of Leg"),
)


class _SurfaceCurve:
    bl_space_type = "VIEW_3D"
    bl_label = LABEL
    bl_description = (
        "Draw a curve point by point on the surface of the active mesh.\n"
        "Click on a designed curve to edit it"
    )
    bl_icon = ICON
    bl_widget = None
    bl_keymap = KEYMAP

    @staticmethod
    def draw_settings(
        context: bpy.types.Context, layout: bpy.types.UILayout, _tool: bpy.types.WorkSpaceTool
    ) -> None:
        """Draw the settings of the active curve, or of a new one, in the header."""
        curve = edited_curve.active(context)
        properties = context.scene.nicmm_curves
        layout.prop(properties, "tool_action", expand=True, icon_only=True)
        if properties.tool_action == "FREEHAND":
            layout.prop(properties, "stroke_tolerance")
        if curve is not None:
            curve_settings.draw_in_header(layout, curve)
            layout.operator(NICMM_OT_next_course.bl_idname)
            choosing = layout.row()
            choosing.operator_context = "INVOKE_REGION_WIN"  # the mouse is used in the viewport
            choosing.operator(NICMM_OT_choose_course.bl_idname)
            return
        for name in ("closed", "smoothness", "normal_bending"):
            layout.prop(properties, name)
        draw_avoid_others(layout, properties, "Avoid Others")  # the header is narrow
        draw_mirror_in_header(layout, properties)
        mesh_object = mesh_data.mesh_object(context)
        if mesh_object is not None:
            for name in ("obstacle_group", "alignment_group"):
                layout.prop_search(properties, name, mesh_object, "vertex_groups")


class NICMM_WT_object(_SurfaceCurve, bpy.types.WorkSpaceTool):
    bl_context_mode = "OBJECT"
    bl_idname = modes.TOOLS["OBJECT"]


class NICMM_WT_sculpt(_SurfaceCurve, bpy.types.WorkSpaceTool):
    bl_context_mode = "SCULPT"
    bl_idname = modes.TOOLS["SCULPT"]


class NICMM_WT_weights(_SurfaceCurve, bpy.types.WorkSpaceTool):
    bl_context_mode = "PAINT_WEIGHT"
    bl_idname = modes.TOOLS["PAINT_WEIGHT"]


TOOLS = (NICMM_WT_object, NICMM_WT_sculpt, NICMM_WT_weights)


def draw_hints(header: bpy.types.Header, context: bpy.types.Context) -> None:
    """Draw the tool's mouse buttons and keys at the start of the status bar."""
    if not modes.is_tool_active(context) or course_overlay.is_shown():
        return
    row = header.layout.row(align=False)
    for icons, text in HINTS:
        part = row.row(align=True)
        for icon in icons[:-1]:
            part.label(text="", icon=icon)
        part.label(text=text, icon=icons[-1])


def register() -> None:
    for tool in TOOLS:
        bpy.utils.register_tool(tool, separator=True)
    header = bpy.types.STATUSBAR_HT_header
    header.prepend(draw_hints)
    # Blender restores what it has kept here after a status text, so the hints have to be in it.
    if hasattr(header, "_draw_orig"):
        header._draw_orig = header.draw


def unregister() -> None:
    bpy.types.STATUSBAR_HT_header.remove(draw_hints)
    for tool in reversed(TOOLS):
        bpy.utils.unregister_tool(tool)
