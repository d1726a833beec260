# SPDX-License-Identifier: GPL-3.0-or-later
"""The list of curves designed on a mesh, in the sidebar."""

import bpy
from bpy.props import IntProperty

from ..operators.move_curve import NICMM_OT_move_curve
from ..operators.update_curves import NICMM_OT_update_curves
from ..outputs import edited_curve
from ..scene import curve_record
from ..tool import modes
from ..tool.edit_operator import NICMM_OT_edit_curve

ICONS = {"CURVE": "OUTLINER_OB_CURVE", "CURVES": "OUTLINER_OB_CURVES"}
EDIT_ICON = "EDITMODE_HLT"
UPDATE_ICON = "FILE_REFRESH"


class NICMM_UL_curves(bpy.types.UIList):
    """List of the curves designed on the mesh, filtered from all objects of the file"""

    def draw_item(
        self,
        context: bpy.types.Context,
        layout: bpy.types.UILayout,
        _data: bpy.types.BlendData,
        item: bpy.types.Object,
        _icon: int,
        _active_data: bpy.types.WindowManager,
        _active_name: str,
    ) -> None:
        row = layout.row(align=True)
        row.prop(item, "name", text="", emboss=False, icon=ICONS.get(item.type, "OBJECT_DATA"))
        buttons = row.row(align=True)
        # The operators take names, and a local object may have the name of a linked one.
        buttons.enabled = item.library is None
        editing = buttons.row(align=True)
        editing.enabled = context.mode in modes.TOOLS
        edit = editing.operator(
            NICMM_OT_edit_curve.bl_idname, text="", icon=EDIT_ICON, emboss=False
        )
        edit.curve = item.name
        update = buttons.operator(
            NICMM_OT_update_curves.bl_idname, text="", icon=UPDATE_ICON, emboss=False
        )
        update.curve = item.name
        row.prop(item, "hide_viewport", text="", emboss=False)

    def filter_items(
        self, context: bpy.types.Context, data: bpy.types.BlendData, name: str
    ) -> tuple[list[int], list[int]]:
        in_order = curve_record.designed_on(curve_record.mesh_of_context(context))
        shown = set(in_order)
        objects = getattr(data, name)
        wanted = self.filter_name.casefold()
        item = self.bitflag_filter_item
        # Blender inverts the flags afterwards if the user inverts the filter.
        other = item if self.use_filter_invert else 0
        flags = [
            (item if wanted in found.name.casefold() else 0) if found in shown else other
            for found in objects
        ]
        if self.use_filter_sort_alpha:  # the objects of a file are sorted by name
            return flags, []
        places = {found: place for place, found in enumerate(in_order)}
        keys = [(index, places.get(found, -1)) for index, found in enumerate(objects)]
        return flags, bpy.types.UI_UL_list.sort_items_helper(keys, lambda key: key[1])


def _active_index(_window_manager: bpy.types.WindowManager) -> int:
    """The index of the active curve among all objects, so that the list follows the viewport."""
    active = edited_curve.active(bpy.context)
    if active is None:
        return -1
    return next(index for index, each in enumerate(bpy.data.objects) if each == active)


def _activate(_window_manager: bpy.types.WindowManager, index: int) -> None:
    """Make a curve active in a mode of the tool; in Edit Mode control points are vertices."""
    context = bpy.context
    if context.mode in modes.TOOLS and index < len(bpy.data.objects):
        chosen = bpy.data.objects[index]
        if curve_record.has_record(chosen) and chosen.visible_get():
            modes.make_active(context, chosen)
            bpy.ops.ed.undo_push(message="Select Curve")  # as a click in the viewport does


def draw(layout: bpy.types.UILayout, context: bpy.types.Context) -> None:
    """Draw the list and its buttons."""
    row = layout.row()
    row.template_list(
        NICMM_UL_curves.__name__, "", bpy.data, "objects", context.window_manager,
        "nicmm_active_curve", rows=3,
    )  # fmt: skip
    arrows = row.column(align=True)
    arrows.enabled = edited_curve.active(context) is not None
    for direction, icon in (("UP", "TRIA_UP"), ("DOWN", "TRIA_DOWN")):
        arrow = arrows.operator(NICMM_OT_move_curve.bl_idname, text="", icon=icon)
        arrow.direction = direction
    row = layout.row(align=True)
    row.operator(NICMM_OT_update_curves.bl_idname, icon=UPDATE_ICON)
    row.prop(context.scene, "nicmm_live_update", text="Live", toggle=True, icon="PLAY")
    if context.scene.nicmm_live_update:
        layout.prop(context.scene, "nicmm_live_playback")


def register() -> None:
    bpy.utils.register_class(NICMM_UL_curves)
    bpy.types.WindowManager.nicmm_active_curve = IntProperty(
        name="Active Curve",
        description="Active curve in the viewport",
        get=_active_index,
        set=_activate,
        options={"SKIP_SAVE"},
    )


def unregister() -> None:
    del bpy.types.WindowManager.nicmm_active_curve
    bpy.utils.unregister_class(NICMM_UL_curves)
