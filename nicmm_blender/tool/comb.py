# SPDX-License-Identifier: GPL-3.0-or-later
"""Draws the curvature comb of the active designed curve over the 3D viewports.

Its teeth are perpendicular to the curve, in the tangent plane; their lengths are proportional to
the geodesic curvature.
"""

from __future__ import annotations

import bpy
import gpu
import numpy as np
from bpy.props import BoolProperty, FloatProperty
from gpu_extras.batch import batch_for_shader

from ..operators import measures
from ..outputs import edited_curve
from ..scene import curve_record
from ..scene.viewports import redraw
from . import overlay

WIDTH = 1.0
"""Line width in pixels at a scale of 1."""


def _draw() -> None:
    context = bpy.context
    settings = context.window_manager
    curve = edited_curve.active(context)
    if not settings.nicmm_show_comb or curve is None or not curve_record.has_record(curve):
        return
    if not context.space_data.overlay.show_overlays:
        return
    measured, mesh_object = measures.of(curve), curve_record.mesh_of(curve)
    if measured is None or mesh_object is None:
        return
    for comb, closed in zip(measured.combs, measured.closed, strict=True):
        ends = comb.copy()
        ends[:, 1] = ends[:, 0] + settings.nicmm_comb_scale * (ends[:, 1] - ends[:, 0])
        _draw_comb(context, mesh_object, ends, closed)


def _draw_comb(
    context: bpy.types.Context, mesh_object: bpy.types.Object, ends: np.ndarray, closed: bool
) -> None:
    shader = gpu.shader.from_builtin("POLYLINE_UNIFORM_COLOR")
    teeth = batch_for_shader(shader, "LINES", {"pos": ends.reshape(-1, 3).astype(np.float32)})
    tips = np.concatenate([ends[:, 1], ends[:1, 1]]) if closed else ends[:, 1]
    rim = overlay.batch_of_line(tips)
    matrix = context.region_data.view_matrix @ mesh_object.matrix_world
    colour = overlay.Colours(context).hover
    for batch in (teeth, rim):
        overlay.draw_layers(context, matrix, batch, [(WIDTH, colour)])


def _changed(_manager: bpy.types.WindowManager, _context: bpy.types.Context) -> None:
    redraw()


_handlers: list[object] = []


def register() -> None:
    manager = bpy.types.WindowManager
    manager.nicmm_show_comb = BoolProperty(
        name="Curvature Comb",
        description="Show the geodesic curvature of the active curve as teeth beside it",
        default=False,
        update=_changed,
    )
    manager.nicmm_comb_scale = FloatProperty(
        name="Scale",
        description="Length of the teeth",
        default=1.0,
        min=0.0,
        soft_max=10.0,
        update=_changed,
    )
    _handlers.append(bpy.types.SpaceView3D.draw_handler_add(_draw, (), "WINDOW", "POST_VIEW"))


def unregister() -> None:
    while _handlers:
        bpy.types.SpaceView3D.draw_handler_remove(_handlers.pop(), "WINDOW")
    del bpy.types.WindowManager.nicmm_comb_scale
    del bpy.types.WindowManager.nicmm_show_comb
