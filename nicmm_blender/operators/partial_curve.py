# SPDX-License-Identifier: GPL-3.0-or-later
"""Shows an unfinished curve in every 3D viewport."""

from __future__ import annotations

import bpy
import numpy as np

from ..scene import viewports

COLOUR = (1.0, 0.6, 0.1, 1.0)
WIDTH = 2.0
"""Line width in pixels at a resolution scale of 1."""


class PartialCurve:
    """A polyline in world space, drawn in front of everything until it is removed."""

    def __init__(self) -> None:
        self._positions: list[list[float]] = []
        self._handle = bpy.types.SpaceView3D.draw_handler_add(self._draw, (), "WINDOW", "POST_VIEW")

    def show(self, points: np.ndarray, closed: bool) -> None:
        """Replace the points, (n, 3)."""
        positions = points.tolist()
        self._positions = positions + positions[:1] if closed else positions
        viewports.redraw()

    def remove(self) -> None:
        """Stop drawing."""
        bpy.types.SpaceView3D.draw_handler_remove(self._handle, "WINDOW")
        viewports.redraw()

    def _draw(self) -> None:
        import gpu
        from gpu_extras.batch import batch_for_shader

        if len(self._positions) < 2:
            return
        shader = gpu.shader.from_builtin("POLYLINE_UNIFORM_COLOR")
        batch = batch_for_shader(shader, "LINE_STRIP", {"pos": self._positions})
        shader.uniform_float("viewportSize", gpu.state.viewport_get()[2:])
        shader.uniform_float("lineWidth", WIDTH * bpy.context.preferences.system.ui_scale)
        shader.uniform_float("color", COLOUR)
        gpu.state.blend_set("ALPHA")
        batch.draw(shader)
        gpu.state.blend_set("NONE")
