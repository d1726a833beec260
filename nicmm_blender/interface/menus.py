# SPDX-License-Identifier: GPL-3.0-or-later
"""Entries in Blender's own menus."""

import bpy

from ..operators.convert_curve import NICMM_OT_convert_curve
from ..operators.design_curve import NICMM_OT_design_curve
from ..operators.next_course import NICMM_OT_next_course
from ..operators.strokes_to_curves import NICMM_OT_strokes_to_curves, has_strokes
from ..scene import curve_record
from ..tool import modes
from ..tool.edit_operator import NICMM_OT_edit_curve
from . import icons


def draw_in_menu(menu: bpy.types.Menu, context: bpy.types.Context) -> None:
    _begin(menu)
    menu.layout.operator(NICMM_OT_design_curve.bl_idname, icon=icons.DESIGN)
    draw_edit(menu.layout, context)


def draw_edit(layout: bpy.types.UILayout, context: bpy.types.Context) -> None:
    """Draw the menu entry of the tool, labelled by what it does with the active object.

    In Edit Mode the entry is left out, because the tool does not work there.
    """
    if context.mode not in modes.TOOLS:
        return
    is_curve = curve_record.has_record(context.active_object)
    text = "Edit Curve on Surface" if is_curve else "Draw Curve on Surface"
    layout.operator(NICMM_OT_edit_curve.bl_idname, text=text, icon=icons.EDIT)


def draw_next_course(layout: bpy.types.UILayout, context: bpy.types.Context) -> None:
    """Draw the entry for another course of the active curve, in the modes in which it works."""
    if context.mode in modes.TOOLS:
        layout.operator(NICMM_OT_next_course.bl_idname, icon=icons.NEXT_COURSE)


def draw_in_context_menu(menu: bpy.types.Menu, context: bpy.types.Context) -> None:
    """Draw the entries in vertex select mode only; all select modes share one context menu."""
    if context.tool_settings.mesh_select_mode[0]:
        draw_in_menu(menu, context)


def draw_conversions(menu: bpy.types.Menu, context: bpy.types.Context) -> None:
    """Draw a submenu with all outputs if a designed curve is active, or the entry for strokes."""
    if has_strokes(context):
        _begin(menu)
        menu.layout.operator(NICMM_OT_strokes_to_curves.bl_idname, icon=icons.STROKES)
    if not curve_record.has_record(context.active_object):
        return
    _begin(menu)
    menu.layout.operator_menu_enum(
        NICMM_OT_convert_curve.bl_idname,
        "output",
        text="Convert Designed Curve",
        icon=icons.CONVERT,
    )


def draw_for_curve(menu: bpy.types.Menu, context: bpy.types.Context) -> None:
    """Draw all entries for the active designed curve."""
    if not curve_record.has_record(context.active_object):
        return
    draw_conversions(menu, context)
    draw_edit(menu.layout, context)
    draw_next_course(menu.layout, context)


def _begin(menu: bpy.types.Menu) -> None:
    menu.layout.separator()
    # Some of Blender's menus set EXEC_REGION_WIN, which would skip `invoke`.
    menu.layout.operator_context = "INVOKE_REGION_WIN"


MENUS = (
    ("VIEW3D_MT_edit_mesh_vertices", draw_in_menu),
    ("VIEW3D_MT_edit_mesh_context_menu", draw_in_context_menu),
    ("VIEW3D_MT_curve_add", draw_in_menu),
    ("VIEW3D_MT_object_convert", draw_conversions),
    ("VIEW3D_MT_object_context_menu", draw_for_curve),
)


def register() -> None:
    for menu, draw in MENUS:
        getattr(bpy.types, menu).append(draw)


def unregister() -> None:
    for menu, draw in MENUS:
        getattr(bpy.types, menu).remove(draw)
