# SPDX-License-Identifier: GPL-3.0-or-later
"""Panel rows for choosing, creating and painting a map, with their menus."""

import bpy

from ..operators import maps


def draw_row(
    layout: bpy.types.UILayout,
    properties: bpy.types.PropertyGroup,
    role: str,
    context: bpy.types.Context,
    mesh_object: bpy.types.Object,
) -> None:
    """Draw the vertex group field of a map, with buttons that create and paint the group."""
    field = maps.FIELDS[role]
    row = layout.row(align=True)
    row.prop_search(properties, field, mesh_object, "vertex_groups")
    name = getattr(properties, field)
    if name:
        painting = maps.is_painting(context, mesh_object, name)
        paint = row.operator(
            maps.NICMM_OT_paint_map.bl_idname, text="", icon="BRUSH_DATA", depress=painting
        )
        paint.role = role
    row.menu(MENUS[role].__name__, text="", icon="ADD")


def _draw_menu(menu: bpy.types.Menu, role: str) -> None:
    for identifier, name, _description, icon, _number in maps.SOURCES:
        entry = menu.layout.operator(maps.NICMM_OT_new_map.bl_idname, text=name, icon=icon)
        entry.role, entry.source = role, identifier


class NICMM_MT_new_obstacles(bpy.types.Menu):
    bl_label = "New Obstacles"

    def draw(self, _context: bpy.types.Context) -> None:
        _draw_menu(self, "OBSTACLES")


class NICMM_MT_new_alignment(bpy.types.Menu):
    bl_label = "New Alignment"

    def draw(self, _context: bpy.types.Context) -> None:
        _draw_menu(self, "ALIGNMENT")


MENUS = {"OBSTACLES": NICMM_MT_new_obstacles, "ALIGNMENT": NICMM_MT_new_alignment}


def register() -> None:
    for menu in MENUS.values():
        bpy.utils.register_class(menu)


def unregister() -> None:
    for menu in reversed(MENUS.values()):
        bpy.utils.unregister_class(menu)
