# SPDX-License-Identifier: GPL-3.0-or-later
"""Where users find the operators: menus and a panel in the sidebar."""

import bpy

from . import curve_list, curve_record, live_update, maps, settings
from .edit_operator import NICMM_OT_edit_curve
from .operators import NICMM_OT_convert_curve, NICMM_OT_design_curve

ICON = "CURVE_BEZCIRCLE"
EDIT_ICON = "CURVE_PATH"
CONVERT_ICON = "MOD_EDGESPLIT"


class SidebarPanel:
    """The tab of the sidebar that all panels are in."""

    bl_space_type = "VIEW_3D"
    bl_region_type = "UI"
    bl_category = "NICMM"


class NICMM_PT_design_curve(SidebarPanel, bpy.types.Panel):
    """Settings and button for a new curve"""

    bl_label = "NICMM Curves"

    def draw(self, context):
        properties = context.scene.nicmm_curves
        layout = self.layout
        settings.draw_course(layout, properties)
        settings.draw_output(layout, properties)
        operator = layout.operator(NICMM_OT_design_curve.bl_idname, icon=ICON)
        for name in settings.PROPERTY_NAMES:
            setattr(operator, name, getattr(properties, name))
        layout.operator(NICMM_OT_edit_curve.bl_idname, icon=EDIT_ICON)
        if curve_record.has_record(context.active_object):
            convert = layout.operator(NICMM_OT_convert_curve.bl_idname, icon=CONVERT_ICON)
            for name in settings.OutputProperties.__annotations__:
                setattr(convert, name, getattr(properties, name))


class NICMM_PT_maps(SidebarPanel, bpy.types.Panel):
    """Vertex groups that keep curves away or attract them"""

    bl_label = "Maps"
    bl_parent_id = "NICMM_PT_design_curve"

    @classmethod
    def poll(cls, context):
        return curve_record.mesh_of_context(context) is not None

    def draw(self, context):
        properties = context.scene.nicmm_curves
        layout = self.layout
        layout.use_property_split = True
        layout.use_property_decorate = False
        mesh_object = curve_record.mesh_of_context(context)
        maps.draw_row(layout, properties, "OBSTACLES", context, mesh_object)
        settings.draw_clearance(layout, properties)
        maps.draw_row(layout, properties, "ALIGNMENT", context, mesh_object)


class NICMM_PT_curves(SidebarPanel, bpy.types.Panel):
    """The curves that were designed on this mesh"""

    bl_label = "Curves on This Mesh"
    bl_parent_id = "NICMM_PT_design_curve"

    @classmethod
    def poll(cls, context):
        return curve_record.mesh_of_context(context) is not None

    def draw(self, context):
        curve_list.draw(self.layout, context)
        for message in live_update.messages(curve_record.mesh_of_context(context)):
            self.layout.label(text=message, icon="ERROR")


def draw_in_menu(menu, _context) -> None:
    _begin(menu)
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
    _begin(menu)
    menu.layout.operator_menu_enum(
        NICMM_OT_convert_curve.bl_idname, "output", text="Convert Designed Curve", icon=CONVERT_ICON
    )
    menu.layout.operator(NICMM_OT_edit_curve.bl_idname, icon=EDIT_ICON)


def _begin(menu) -> None:
    menu.layout.separator()
    # Some of Blender's menus call operators as scripts do; ours ask what suits the window.
    menu.layout.operator_context = "INVOKE_REGION_WIN"


MENUS = (
    ("VIEW3D_MT_edit_mesh_vertices", draw_in_menu),
    ("VIEW3D_MT_edit_mesh_context_menu", draw_in_context_menu),
    ("VIEW3D_MT_curve_add", draw_in_menu),
    ("VIEW3D_MT_object_convert", draw_conversions),
    ("VIEW3D_MT_object_context_menu", draw_conversions),
)


PANELS = (NICMM_PT_design_curve, NICMM_PT_maps, NICMM_PT_curves)


def register() -> None:
    for panel in PANELS:
        bpy.utils.register_class(panel)
    for menu, draw in MENUS:
        getattr(bpy.types, menu).append(draw)


def unregister() -> None:
    for menu, draw in MENUS:
        getattr(bpy.types, menu).remove(draw)
    for panel in reversed(PANELS):
        bpy.utils.unregister_class(panel)
