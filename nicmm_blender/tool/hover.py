# SPDX-License-Identifier: GPL-3.0-or-later
"""Follows the mouse while the tool is active, through a gizmo that is never selected.

Blender asks gizmos about every mouse move in a viewport, so no operator has to run.
"""

import bpy
import numpy as np

from . import modes, overlay, picking


class NICMM_GT_hover(bpy.types.Gizmo):
    bl_idname = "NICMM_GT_hover"

    def draw(self, _context: bpy.types.Context) -> None:
        """Draw nothing, since the overlay draws the mark."""

    def test_select(self, context: bpy.types.Context, location: tuple[int, int]) -> int:
        overlay.show_hover(picking.under_mouse_now(context, np.array(location, dtype=np.float64)))
        return -1


class NICMM_GGT_hover(bpy.types.GizmoGroup):
    bl_idname = "NICMM_GGT_hover"
    bl_label = "Surface Curve"
    bl_space_type = "VIEW_3D"
    bl_region_type = "WINDOW"
    bl_options = {"3D", "PERSISTENT", "SHOW_MODAL_ALL"}  # noqa: RUF012 - as Blender reads it

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return modes.is_tool_active(context)

    def setup(self, _context: bpy.types.Context) -> None:
        self.gizmos.new(NICMM_GT_hover.bl_idname)


CLASSES = (NICMM_GT_hover, NICMM_GGT_hover)


def register() -> None:
    for each in CLASSES:
        bpy.utils.register_class(each)


def unregister() -> None:
    for each in reversed(CLASSES):
        bpy.utils.unregister_class(each)
