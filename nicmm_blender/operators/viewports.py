# SPDX-License-Identifier: GPL-3.0-or-later
"""The 3D viewports while an operator runs: events that turn the view, and drawing again."""

import bpy

WHEEL = ("WHEELUPMOUSE", "WHEELDOWNMOUSE")

NAVIGATION = {
    "MIDDLEMOUSE",
    *WHEEL,
    "TRACKPADPAN",
    "TRACKPADZOOM",
    "MOUSEROTATE",
    "MOUSESMARTZOOM",
    "NDOF_MOTION",
}
"""Events that turn or move the view, and that Blender itself handles."""


def redraw() -> None:
    """Draw all viewports again."""
    for window in bpy.context.window_manager.windows:
        for area in window.screen.areas:
            if area.type == "VIEW_3D":
                area.tag_redraw()
