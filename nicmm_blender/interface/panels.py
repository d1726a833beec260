# SPDX-License-Identifier: GPL-3.0-or-later
"""The panels in the sidebar of the 3D viewport."""

import bpy

from .. import settings
from ..operators import curve_settings, live_update, maps
from ..operators.convert_curve import NICMM_OT_convert_curve
from ..operators.design_curve import NICMM_OT_design_curve
from ..operators.message_labels import draw_message
from ..outputs import edited_curve, parallel_curves
from ..scene import curve_record, mesh_data
from . import curve_list, icons, map_rows, menus


class SidebarPanel:
    """Base of all panels: places them in one tab of the sidebar."""

    bl_space_type = "VIEW_3D"
    bl_region_type = "UI"
    bl_category = "NICMM"


class NICMM_PT_design_curve(SidebarPanel, bpy.types.Panel):
    """Settings of the active curve, or of a new one"""

    bl_label = "NICMM Curves"

    def draw(self, context: bpy.types.Context) -> None:
        properties = context.scene.nicmm_curves
        layout = self.layout
        curve = edited_curve.active(context)
        if curve is not None:
            layout.label(text=curve.name, icon=icons.EDIT)
            curve_settings.draw(layout, curve)
            menus.draw_next_course(layout, context)
            menus.draw_edit(layout, context)
            if curve == context.active_object:
                self._draw_conversion(layout, properties)
            return
        if parallel_curves.is_parallel(context.active_object):
            self._draw_parallel(layout, context.active_object)
            return
        settings.draw_design(layout, properties, mesh_data.mesh_object(context))
        settings.draw_output(layout, properties)
        operator = layout.operator(NICMM_OT_design_curve.bl_idname, icon=icons.DESIGN)
        for name in settings.PROPERTY_NAMES:
            setattr(operator, name, getattr(properties, name))
        menus.draw_edit(layout, context)
        if context.mode == "EDIT_MESH":
            layout.label(text="The Surface Curve tool does not work in Edit Mode", icon="INFO")

    def _draw_parallel(self, layout: bpy.types.UILayout, parallel: bpy.types.Object) -> None:
        """Draw the settings of parallel curves."""
        group = parallel.nicmm_parallel
        layout.label(text=parallel.name, icon=icons.PARALLEL)
        layout.use_property_split = True
        layout.use_property_decorate = False
        row = layout.row()
        row.enabled = False
        row.prop(group, "source")
        for name in ("distance", "count", "both_sides", "spline", "offset"):
            layout.prop(group, name)
        if group.problem:
            draw_message(layout, group.problem)

    def _draw_conversion(
        self, layout: bpy.types.UILayout, properties: bpy.types.PropertyGroup
    ) -> None:
        layout.separator()
        settings.draw_output(layout, properties, appearance=False)
        convert = layout.operator(NICMM_OT_convert_curve.bl_idname, icon=icons.CONVERT)
        for name in settings.OutputProperties.__annotations__:
            if name not in settings.APPEARANCE:
                setattr(convert, name, getattr(properties, name))


class NICMM_PT_maps(SidebarPanel, bpy.types.Panel):
    """Vertex groups that keep curves away or attract them"""

    bl_label = "Maps"
    bl_parent_id = "NICMM_PT_design_curve"

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return curve_record.mesh_of_context(context) is not None

    def draw(self, context: bpy.types.Context) -> None:
        properties = maps.settings_of(context)
        layout = self.layout
        layout.use_property_split = True
        layout.use_property_decorate = False
        mesh_object = curve_record.mesh_of_context(context)
        map_rows.draw_row(layout, properties, "OBSTACLES", context, mesh_object)
        settings.draw_clearance(layout, properties)
        map_rows.draw_row(layout, properties, "ALIGNMENT", context, mesh_object)


class NICMM_PT_curves(SidebarPanel, bpy.types.Panel):
    """The curves designed on this mesh"""

    bl_label = "Curves on This Mesh"
    bl_parent_id = "NICMM_PT_design_curve"

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return curve_record.mesh_of_context(context) is not None

    def draw(self, context: bpy.types.Context) -> None:
        curve_list.draw(self.layout, context)
        for message in live_update.messages(curve_record.mesh_of_context(context)):
            draw_message(self.layout, message)


PANELS = (NICMM_PT_design_curve, NICMM_PT_maps, NICMM_PT_curves)


def register() -> None:
    for panel in PANELS:
        bpy.utils.register_class(panel)


def unregister() -> None:
    for panel in reversed(PANELS):
        bpy.utils.unregister_class(panel)
