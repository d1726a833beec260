# SPDX-License-Identifier: GPL-3.0-or-later
"""Where users find the operator: three menus and a panel in the sidebar."""

import bpy

from . import mesh_data, settings
from .operators import NICMM_OT_design_curve

ICON = "CURVE_BEZCIRCLE"


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


def draw_in_menu(menu, _context) -> None:
    menu.layout.separator()
    menu.layout.operator(NICMM_OT_design_curve.bl_idname, icon=ICON)


def draw_in_context_menu(menu, context) -> None:
    """The context menu of Edit Mode is one menu for vertices, edges and faces."""
    if context.tool_settings.mesh_select_mode[0]:
        draw_in_menu(menu, context)


MENUS = (
    ("VIEW3D_MT_edit_mesh_vertices", draw_in_menu),
    ("VIEW3D_MT_edit_mesh_context_menu", draw_in_context_menu),
    ("VIEW3D_MT_curve_add", draw_in_menu),
)


def register() -> None:
    bpy.utils.register_class(NICMM_PT_design_curve)
    for menu, draw in MENUS:
        getattr(bpy.types, menu).append(draw)


def unregister() -> None:
    for menu, draw in MENUS:
        getattr(bpy.types, menu).remove(draw)
    bpy.utils.unregister_class(NICMM_PT_design_curve)
