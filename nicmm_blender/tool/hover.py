# SPDX-License-Identifier: GPL-3.0-or-later
"""Follows the mouse while the tool is active, through a gizmo that is never selected.

Blender asks gizmos about every mouse move in a viewport, so no operator has to run.
"""

import bpy
import numpy as np

from ..scene.messages import InputError
from . import modes, overlay, picking


class NICMM_GT_hover(bpy.types.Gizmo):
    bl_idname = "NICMM_GT_hover"

    def draw(self, _context: bpy.types.Context) -> None:
        """Draw nothing, since the overlay draws the mark."""

    def test_select(self, context: bpy.types.Context, location: tuple[int, int]) -> int:
        overlay.show_hover(_under(context, location))
        return -1


def _under(context: bpy.types.Context, location: tuple[int, int]) -> picking.Hit | None:
    """What is under the mouse, or None if that would need a long computation."""
    from ...nicmm_core import NicmmError

    if not picking.is_view(context):
        return None
    try:
        mesh_object, curve = picking.mesh_and_curve(context)
        if mesh_object is None or not picking.is_ready(context, mesh_object, curve):
            return None
        return picking.under_mouse(context, np.array(location, dtype=np.float64))
    except (InputError, NicmmError):
        return None  # a click reports the error


class NICMM_GGT_hover(bpy.types.GizmoGroup):
    bl_idname = "NICMM_GGT_hover"
    bl_label = "Surface Curve"
    bl_space_type = "VIEW_3D"
    bl_region_type = "WINDOW"
    bl_options = {"3D", "PERSISTENT", "SHOW_MODAL_ALL"}  # noqa: RUF012 - as Blender reads it

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        active = modes.is_tool_active(context)
        if not active and overlay.hovered() is not None:
            overlay.show_hover(None)
        return active

    def setup(self, _context: bpy.types.Context) -> None:
        self.gizmos.new(NICMM_GT_hover.bl_idname)


CLASSES = (NICMM_GT_hover, NICMM_GGT_hover)


def register() -> None:
    for each in CLASSES:
        bpy.utils.register_class(each)


def unregister() -> None:
    for each in reversed(CLASSES):
        bpy.utils.unregister_class(each)
