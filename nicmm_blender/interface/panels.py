# SPDX-License-Identifier: GPL-3.0-or-later
"""The panels in the sidebar of the 3D viewport."""

import math
from typing import Any

import bpy

from .. import settings
from ..operators import curve_settings, live_update, maps, measures
from ..operators.convert_curve import NICMM_OT_convert_curve
from ..operators.design_curve import NICMM_OT_design_curve
from ..operators.message_labels import draw_message
from ..outputs import edited_curve, parallel_curves
from ..scene import curve_record, mesh_data
from . import curve_list, icons, map_rows, menus

MOST_LEGS = 12
"""Number of legs whose lengths are listed."""


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


class NICMM_PT_measures(SidebarPanel, bpy.types.Panel):
    """Lengths, area, curvature and slope of the active curve"""

    bl_label = "Measures"
    bl_parent_id = "NICMM_PT_design_curve"
    bl_options = {"DEFAULT_CLOSED"}

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        curve = edited_curve.active(context)
        return curve is not None and not curve_record.is_unfinished(curve)

    def draw(self, context: bpy.types.Context) -> None:
        layout = self.layout
        measured = measures.of(edited_curve.active(context))
        if measured is None:
            layout.label(text="Measuring", icon="TIME")
        elif measured.problem:
            draw_message(layout, measured.problem)
        else:
            for values in measured.values:
                self._draw_values(layout, context.scene, values)
        layout.use_property_split = True
        layout.use_property_decorate = False
        layout.prop(context.window_manager, "nicmm_show_comb")
        row = layout.row()
        row.active = context.window_manager.nicmm_show_comb
        row.prop(context.window_manager, "nicmm_comb_scale")

    def _draw_values(
        self, layout: bpy.types.UILayout, scene: bpy.types.Scene, values: dict[str, Any]
    ) -> None:
        column = layout.column(align=True)
        rows = [("Length", measures.text_of(scene, values["length"]))]
        if values["area"] is not None:
            rows.append(("Enclosed Area", measures.text_of(scene, values["area"], 2)))
        rows.append(("Least Radius", measures.text_of(scene, values["least_radius"])))
        rows.append(("Greatest Slope", f"{math.degrees(values['greatest_slope']):.1f}°"))
        if values["distance_to_obstacle"] is not None:
            away = measures.text_of(scene, values["distance_to_obstacle"])
            rows.append(("Distance to Obstacle", away))
        legs = values["leg_lengths"]
        rows += [
            (f"Leg {number + 1}", measures.text_of(scene, length))
            for number, length in enumerate(legs[:MOST_LEGS])
        ]
        for label, text in rows:
            split = column.split(factor=0.5)
            split.label(text=label)
            split.label(text=text)
        if len(legs) > MOST_LEGS:
            column.label(text=f"… and {len(legs) - MOST_LEGS} more legs")


PANELS = (NICMM_PT_design_curve, NICMM_PT_measures, NICMM_PT_maps, NICMM_PT_curves)


def register() -> None:
    for panel in PANELS:
        bpy.utils.register_class(panel)


def unregister() -> None:
    for panel in reversed(PANELS):
        bpy.utils.unregister_class(panel)
