# SPDX-License-Identifier: GPL-3.0-or-later
"""Where users find the operators: menus and a panel in the sidebar."""

import bpy

from . import curve_record, mesh_data, settings
from .edit_operator import NICMM_OT_edit_curve
from .operators import NICMM_OT_convert_curve, NICMM_OT_design_curve

ICON = "CURVE_BEZCIRCLE"
EDIT_ICON = "CURVE_PATH"
CONVERT_ICON = "MOD_EDGESPLIT"


class NICMM_PT_design_curve(bpy.types.Panel):
    """Settings and button, in the sidebar of the 3D viewport"""

    bl_label = "NICMM Curves"
    bl_space_type = "VIEW_3D"
    bl_region_type = "UI"
    bl_category = "NICMM"

    def draw(self, context):
        properties = context.scene.nicmm_curves
        settings.draw(self.layout, properties, mesh_data.mesh_object(context))
        operator = self.layout.operator(NICMM_OT_design_curve.bl_idname, icon=ICON)
        for name in settings.PROPERTY_NAMES:
            setattr(operator, name, getattr(properties, name))
        self.layout.operator(NICMM_OT_edit_curve.bl_idname, icon=EDIT_ICON)
        if curve_record.has_record(context.active_object):
            self.layout.separator()
            convert = self.layout.operator(NICMM_OT_convert_curve.bl_idname, icon=CONVERT_ICON)
            for name in settings.OutputProperties.__annotations__:
                setattr(convert, name, getattr(properties, name))


def draw_in_menu(menu, _context) -> None:
    menu.layout.separator()
    menu.layout.operator(NICMM_OT_design_curve.bl_idname, icon=ICON)
    menu.layout.operator(NICMM_OT_edit_curve.bl_idname, icon=EDIT_ICON)


def draw_in_context_menu(menu, context) -> None:
    """The context menu of Edit Mode is one menu for vertices, edges and faces."""
    if context.tool_settings.mesh_select_mode[0]:
        draw_in_menu(menu, context)


def draw_conversions(menu, context) -> None:
    """One entry for each output, where a designed curve is active."""
    if not curve_record.has_record(context.active_object):
        return
    menu.layout.separator()
    menu.layout.operator_menu_enum(
        NICMM_OT_convert_curve.bl_idname, "output", text="Convert Designed Curve", icon=CONVERT_ICON
    )
    menu.layout.operator(NICMM_OT_edit_curve.bl_idname, icon=EDIT_ICON)


MENUS = (
    ("VIEW3D_MT_edit_mesh_vertices", draw_in_menu),
    ("VIEW3D_MT_edit_mesh_context_menu", draw_in_context_menu),
    ("VIEW3D_MT_curve_add", draw_in_menu),
    ("VIEW3D_MT_object_convert", draw_conversions),
    ("VIEW3D_MT_object_context_menu", draw_conversions),
)


def register() -> None:
    bpy.utils.register_class(NICMM_PT_design_curve)
    for menu, draw in MENUS:
        getattr(bpy.types, menu).append(draw)


def unregister() -> None:
    for menu, draw in MENUS:
        getattr(bpy.types, menu).remove(draw)
    bpy.utils.unregister_class(NICMM_PT_design_curve)
