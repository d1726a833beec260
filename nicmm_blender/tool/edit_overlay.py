# SPDX-License-Identifier: GPL-3.0-or-later
"""Draws the edited curve and its control points over the 3D viewports.

Parts hidden by the mesh are dimmed.
"""

import bpy
import gpu
import numpy as np
from gpu_extras.batch import batch_for_shader

from mathutils import Matrix

from .edit_view import OFFSET, view_of

CURVE = (1.0, 0.72, 0.1, 1.0)
OUT_OF_DATE = (1.0, 0.3, 0.25, 1.0)
POINT = (1.0, 1.0, 1.0, 1.0)
UNDER_MOUSE = (0.35, 0.85, 1.0, 1.0)
OUTLINE = (0.05, 0.05, 0.05, 1.0)
HIDDEN = 0.22
"""Opacity of parts hidden by the mesh."""

LINE_WIDTH, POINT_RADIUS, OUTLINE_WIDTH = 3.0, 5.5, 1.5
"""In pixels at a resolution scale of 1."""

CORNERS = 20
"""Number of corners of the disc that shows a point."""


class Overlay:
    """The drawing of an editing session; `hover` is the index of the point under the mouse."""

    def __init__(self, mesh_object, session) -> None:
        self.mesh_object, self.session = mesh_object, session
        self.hover: int | None = None
        self._line, self._line_of = None, None
        add = bpy.types.SpaceView3D.draw_handler_add
        self._handlers = [
            add(self._draw_curve, (), "WINDOW", "POST_VIEW"),
            add(self._draw_points, (), "WINDOW", "POST_PIXEL"),
        ]

    def remove(self) -> None:
        for handler in self._handlers:
            bpy.types.SpaceView3D.draw_handler_remove(handler, "WINDOW")
        self._handlers = []

    def _draw_curve(self) -> None:
        context, session = bpy.context, self.session
        if session.curve is None:
            return
        shader = gpu.shader.from_builtin("POLYLINE_UNIFORM_COLOR")
        if self._line_of is not session.curve:
            line = session.polyline().astype(np.float32)
            self._line = batch_for_shader(shader, "LINE_STRIP", {"pos": line})
            self._line_of = session.curve
        colour = OUT_OF_DATE if session.problem else CURVE
        region, scale = context.region, context.preferences.system.ui_scale
        nearer = _towards_the_eye(context.region_data, self.mesh_object, session.surface)
        gpu.state.blend_set("ALPHA")
        gpu.state.depth_mask_set(False)
        with gpu.matrix.push_pop():
            gpu.matrix.load_matrix(nearer)
            shader.bind()
            shader.uniform_float("viewportSize", (region.width, region.height))
            shader.uniform_float("lineWidth", LINE_WIDTH * scale)
            for test, opacity in (("GREATER", HIDDEN), ("LESS_EQUAL", 1.0)):
                gpu.state.depth_test_set(test)
                shader.uniform_float("color", (*colour[:3], opacity))
                self._line.draw(shader)
        gpu.state.depth_test_set("NONE")
        gpu.state.blend_set("NONE")

    def _draw_points(self) -> None:
        context, session = bpy.context, self.session
        positions = session.positions()
        view = view_of(
            context.region,
            context.region_data,
            self.mesh_object,
            session.surface,
            session.designer.mesh,
        )
        centres, visible = view.project(positions), view.visible(positions)
        shown = np.flatnonzero(np.isfinite(centres).all(axis=1))
        if not len(shown):
            return
        scale = context.preferences.system.ui_scale
        corners, colours = [], []
        for number in shown[np.argsort(visible[shown], kind="stable")].tolist():
            inner = UNDER_MOUSE if number == self.hover else POINT
            opacity = 1.0 if visible[number] else HIDDEN
            for radius, colour in (
                (POINT_RADIUS + OUTLINE_WIDTH, OUTLINE),
                (POINT_RADIUS, inner),
            ):
                corners.append(centres[number] + scale * radius * _DISC)
                colours.append(np.tile((*colour[:3], opacity), (len(_DISC), 1)))
        shader = gpu.shader.from_builtin("SMOOTH_COLOR")
        flat = np.concatenate(corners)
        batch = batch_for_shader(
            shader,
            "TRIS",
            {
                "pos": np.concatenate([flat, np.zeros((len(flat), 1))], axis=1).astype(np.float32),
                "color": np.concatenate(colours).astype(np.float32),
            },
        )
        gpu.state.blend_set("ALPHA")
        batch.draw(shader)
        gpu.state.blend_set("NONE")


def _disc() -> np.ndarray:
    """Triangles of a disc of radius 1, as consecutive corners, (n, 2)."""
    angles = np.linspace(0.0, 2.0 * np.pi, CORNERS + 1)
    rim = np.stack([np.cos(angles), np.sin(angles)], axis=1)
    return np.stack([np.zeros((CORNERS, 2)), rim[:-1], rim[1:]], axis=1).reshape(-1, 2)


_DISC = _disc()


def _towards_the_eye(region_3d, mesh_object, surface):
    """The model-view matrix, moved slightly towards the eye: lines lie in front of the mesh.

    In perspective it scales about the eye, so that no point moves on the screen.
    """
    world = mesh_object.matrix_world
    step = OFFSET * surface.diagonal * max(world.to_scale(), key=abs)
    if region_3d.is_perspective:
        distance = (region_3d.view_matrix @ world.translation).length
        nearer = Matrix.Scale(1.0 - min(abs(step) / max(distance, abs(step)), 0.5), 4)
        nearer[3][3] = 1.0
    else:
        nearer = Matrix.Translation((0.0, 0.0, abs(step)))
    return nearer @ region_3d.view_matrix @ world
