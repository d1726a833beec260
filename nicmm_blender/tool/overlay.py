# SPDX-License-Identifier: GPL-3.0-or-later
"""Draws the active curve and its control points over the 3D viewports while the tool is active.

Parts hidden by the mesh are dimmed. A mark under the mouse shows what a click would do.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import bpy
import gpu
import numpy as np
from gpu_extras.batch import batch_for_shader

from mathutils import Matrix

from ..outputs import edited_curve
from ..outputs.edited_curve import Opened
from ..scene.lookup import by_uid
from ..scene.messages import InputError
from ..scene.surface import Surface
from ..scene.viewports import redraw
from . import modes, picking
from .picking import Kind
from .view import OFFSET, View

if TYPE_CHECKING:
    from ...nicmm_core import SurfaceCurve

Colour = tuple[float, ...]
"""Red, green and blue, and possibly opacity."""

HIDDEN = 0.22
"""Opacity of parts hidden by the mesh."""

LINE_WIDTH, POINT_RADIUS, OUTLINE_WIDTH = 3.0, 5.5, 1.5
RING_RADIUS, HOLE_RADIUS = 6.5, 4.5
"""Sizes in pixels at a resolution scale of 1."""

DISC_SIDES = 20
"""Number of sides of the disc that shows a control point, and of the ring of a via point."""

OUTLINE = (0.05, 0.05, 0.05)
"""Dark colour under every line and point, so that they stand out from any theme colour."""


@dataclass(frozen=True)
class _Drawn:
    """Points, (k, 3), via points, (m, 3), and line, (n, 3), in the local space of a mesh object.

    `corners` and `junctions`, (k,), tell which of the points are corners, and which lie on other
    curves.
    """

    mesh_uid: int
    surface: Surface
    points: np.ndarray
    corners: np.ndarray
    junctions: np.ndarray
    via: np.ndarray
    line: np.ndarray
    problem: str = ""
    radius: float = 0.0


class _State:
    """What is drawn. Holds no Blender objects, since undo replaces them."""

    def __init__(self) -> None:
        self.handlers: list[object] = []
        self.reset()

    def reset(self) -> None:
        """Draw nothing."""
        self.dragged: _Drawn | None = None
        self.hover: picking.Hit | None = None
        self.batch: gpu.types.GPUBatch | None = None
        self.batch_of: np.ndarray | None = None
        self.visible: np.ndarray = np.zeros(0, dtype=bool)
        self.visible_of: tuple[bytes, bool, int, bytes] | None = None


_state = _State()


def show_dragged(edited: Opened, curve: SurfaceCurve | None, problem: str = "") -> None:
    """Draw a curve that is being changed, with its changed points, instead of the active one."""
    _state.hover = None
    _state.dragged = _Drawn(
        edited.mesh_uid,
        edited.surface,
        edited.positions(),
        edited.points.corners,
        edited.junctions,
        edited.via_positions(),
        edited_curve.polyline_of(edited.surface, curve),
        problem,
        radius_of(edited),
    )


def show_active() -> None:
    """Draw the active curve again instead of one that is being changed."""
    _state.dragged, _state.hover = None, None


def show_hover(hit: picking.Hit | None) -> None:
    """Mark what is under the mouse, a `picking.Hit` or None."""
    if hit != _state.hover:
        _state.hover = hit
        redraw()


def hovered() -> picking.Hit | None:
    """What is marked under the mouse."""
    return _state.hover


def _drawn_now(context: bpy.types.Context) -> _Drawn | None:
    """What to draw; None if the tool is not active or the mesh would have to be read first."""
    from ...nicmm_core import NicmmError

    if _state.dragged is not None:
        return _state.dragged
    if not modes.is_tool_active(context) or not context.space_data.overlay.show_overlays:
        return None
    if context.screen.is_animation_playing:
        return None
    try:
        mesh_object, curve = picking.mesh_and_curve(context)
        if mesh_object is None or not picking.is_ready(context, mesh_object, curve):
            return None
        opened = picking.opened_now(context)
    except (InputError, NicmmError):
        return None  # a click reports the error
    return _Drawn(
        opened.mesh_uid,
        opened.surface,
        opened.positions(),
        opened.points.corners,
        opened.junctions,
        opened.via_positions(),
        opened.polyline(),
        "",
        radius_of(opened),
    )


def _hover_on(drawn: _Drawn) -> picking.Hit | None:
    """What is marked under the mouse on the drawn mesh, or None; nothing is marked in a drag."""
    hit = _state.hover
    marks = hit is not None and hit.mesh_uid == drawn.mesh_uid and _state.dragged is None
    return hit if marks else None


def radius_of(opened: Opened) -> float:
    """How far the curve object reaches from its line; see `picking.radius_of`."""
    curve = opened.curve_object
    return 0.0 if curve is None else picking.radius_of(curve, opened.surface)


def _draw_lines() -> None:
    context = bpy.context
    drawn = _drawn_now(context)
    if drawn is None or (mesh_object := by_uid(drawn.mesh_uid)) is None:
        return
    colours = Colours(context)
    nearer = towards_the_eye(context.region_data, mesh_object, drawn.surface, drawn.radius)
    if len(drawn.line):
        colour = colours.problem if drawn.problem else colours.line
        draw_line(context, nearer, _line_batch(drawn.line), colour)
    hit = _hover_on(drawn)
    if hit is not None and hit.kind is Kind.CURVE:
        for line in picking.other_lines(context):
            if line.name == hit.name and len(line.positions) > 1:
                nearer = towards_the_eye(
                    context.region_data, mesh_object, drawn.surface, line.radius
                )
                draw_line(context, nearer, batch_of_line(line.positions), colours.hover)


def draw_line(
    context: bpy.types.Context,
    matrix: Matrix,
    batch: gpu.types.GPUBatch,
    colour: Colour,
    line_width: float = LINE_WIDTH,
) -> None:
    """Draw a line with an outline; parts that the mesh hides are dimmed."""
    shader = gpu.shader.from_builtin("POLYLINE_UNIFORM_COLOR")
    region, scale = context.region, context.preferences.system.ui_scale
    hidden = 1.0 if picking.is_xray(context.space_data) else HIDDEN
    gpu.state.blend_set("ALPHA")
    gpu.state.depth_mask_set(False)
    with gpu.matrix.push_pop():
        gpu.matrix.load_matrix(matrix)
        shader.bind()
        shader.uniform_float("viewportSize", (region.width, region.height))
        for width, shade in ((line_width + 2.0 * OUTLINE_WIDTH, OUTLINE), (line_width, colour)):
            shader.uniform_float("lineWidth", width * scale)
            for test, opacity in (("GREATER", hidden), ("LESS_EQUAL", 1.0)):
                gpu.state.depth_test_set(test)
                shader.uniform_float("color", (*shade[:3], opacity))
                batch.draw(shader)
    gpu.state.depth_test_set("NONE")
    gpu.state.blend_set("NONE")


def _line_batch(line: np.ndarray) -> gpu.types.GPUBatch:
    """The batch of the active line, rebuilt only if the line has changed."""
    if _state.batch_of is None or not np.array_equal(_state.batch_of, line):
        _state.batch, _state.batch_of = batch_of_line(line), line
    return _state.batch


def batch_of_line(line: np.ndarray) -> gpu.types.GPUBatch:
    """The batch of a line, (n, 3), for `draw_line`."""
    shader = gpu.shader.from_builtin("POLYLINE_UNIFORM_COLOR")
    return batch_for_shader(shader, "LINE_STRIP", {"pos": line.astype(np.float32)})


def _draw_points() -> None:
    context = bpy.context
    drawn = _drawn_now(context)
    if drawn is None or (mesh_object := by_uid(drawn.mesh_uid)) is None:
        return
    view = picking.view_on(context, mesh_object, drawn.surface)
    colours = Colours(context)
    positions, marked = np.concatenate([drawn.points, drawn.via]), -1
    fills, n_points = [colours.point] * len(positions), len(drawn.points)
    hit = _hover_on(drawn)
    if hit is not None:
        if hit.kind is Kind.POINT and hit.index < n_points:
            fills[hit.index] = colours.hover
        elif hit.kind is Kind.VIA and hit.index < len(drawn.via):
            fills[n_points + hit.index] = colours.hover
        elif hit.kind in {Kind.LINE, Kind.JUNCTION, Kind.SURFACE}:
            marked = len(positions)
            positions = np.concatenate([positions, [hit.position]])
            fills.append(colours.hover)
    if not len(positions):
        return
    centres, visible = view.project(positions), _visible(view, positions)
    scale = context.preferences.system.ui_scale
    outlines, colour_of = [], []
    shown = np.flatnonzero(np.isfinite(centres).all(axis=1))
    for number in shown[np.argsort(visible[shown], kind="stable")].tolist():
        opacity = 1.0 if visible[number] else HIDDEN
        # Smaller where a click would add a point, except on another curve.
        on_curve = hit is not None and hit.kind is Kind.JUNCTION
        size = 0.6 if number == marked and not on_curve else 1.0
        if n_points <= number != marked:
            shapes = _OUTLINED_RING, _RING
        else:
            shapes = _shapes_at(drawn, number, hit)
        for shape, colour in zip(shapes, (OUTLINE, fills[number]), strict=True):
            outlines.append(centres[number] + size * scale * shape)
            colour_of.append(np.tile((*colour[:3], opacity), (len(shape), 1)))
    if not outlines:
        return
    shader = gpu.shader.from_builtin("SMOOTH_COLOR")
    flat = np.concatenate(outlines)
    batch = batch_for_shader(
        shader,
        "TRIS",
        {
            "pos": np.concatenate([flat, np.zeros((len(flat), 1))], axis=1).astype(np.float32),
            "color": np.concatenate(colour_of).astype(np.float32),
        },
    )
    gpu.state.blend_set("ALPHA")
    batch.draw(shader)
    gpu.state.blend_set("NONE")


def _shapes_at(
    drawn: _Drawn, number: int, hit: picking.Hit | None
) -> tuple[np.ndarray, np.ndarray]:
    """The outline and the filling of a control point, or of the mark where one would be added."""
    if number >= len(drawn.points):
        is_junction = hit is not None and hit.kind is Kind.JUNCTION
        return (_OUTLINED_DIAMOND, _DIAMOND) if is_junction else (_OUTLINED_DISC, _DISC)
    if drawn.junctions[number]:
        if drawn.corners[number]:
            return _OUTLINED_STAR, _STAR
        return _OUTLINED_DIAMOND, _DIAMOND
    return (_OUTLINED_SQUARE, _SQUARE) if drawn.corners[number] else (_OUTLINED_DISC, _DISC)


def _visible(view: View, positions: np.ndarray) -> np.ndarray:
    """Which points are visible; rays are cast only if the view or the points have changed."""
    key = view.perspective.tobytes(), view.xray, id(view.mesh), positions.tobytes()
    if _state.visible_of != key:
        _state.visible, _state.visible_of = view.visible(positions), key
    return _state.visible


class Colours:
    """Gizmo colours of the theme, which differ from its selection colours."""

    def __init__(self, context: bpy.types.Context) -> None:
        theme = context.preferences.themes[0].user_interface
        self.line, self.point = tuple(theme.gizmo_secondary), tuple(theme.gizmo_hi)
        self.hover, self.problem = tuple(theme.gizmo_primary), tuple(theme.axis_x)


def _ring(inner: float, outer: float) -> np.ndarray:
    """Triangles between two circles around the origin, as consecutive corners, (n, 2)."""
    angles = np.linspace(0.0, 2.0 * np.pi, DISC_SIDES + 1)
    rim = np.stack([np.cos(angles), np.sin(angles)], axis=1)
    (a, b), (c, d) = ((radius * rim[:-1], radius * rim[1:]) for radius in (inner, outer))
    return np.stack([a, c, d, a, d, b], axis=1).reshape(-1, 2)


def _square(half: float) -> np.ndarray:
    """Triangles of a square around the origin, as consecutive corners, (6, 2)."""
    corners = [[-1, -1], [1, -1], [1, 1], [-1, -1], [1, 1], [-1, 1]]
    return half * np.array(corners, dtype=np.float64)


_DISC = _ring(0.0, POINT_RADIUS)
_OUTLINED_DISC = _ring(0.0, POINT_RADIUS + OUTLINE_WIDTH)
_RING = _ring(HOLE_RADIUS, RING_RADIUS)
_OUTLINED_RING = _ring(HOLE_RADIUS - OUTLINE_WIDTH, RING_RADIUS + OUTLINE_WIDTH)
_SQUARE = _square(POINT_RADIUS)
_OUTLINED_SQUARE = _square(POINT_RADIUS + OUTLINE_WIDTH)
_TURN = np.array([[1.0, 1.0], [-1.0, 1.0]])
"""A turn by 45 degrees that enlarges by the square root of 2, so that a diamond is as wide as a
disc with a rim."""
_DIAMOND, _OUTLINED_DIAMOND = _SQUARE @ _TURN, _OUTLINED_SQUARE @ _TURN
_STAR = np.concatenate([_SQUARE, _DIAMOND / np.sqrt(2.0)])
_OUTLINED_STAR = np.concatenate([_OUTLINED_SQUARE, _OUTLINED_DIAMOND / np.sqrt(2.0)])


def towards_the_eye(
    region_3d: bpy.types.RegionView3D,
    mesh_object: bpy.types.Object,
    surface: Surface,
    radius: float,
) -> Matrix:
    """The model-view matrix, moved slightly towards the eye so that lines lie in front of the mesh.

    The shift includes the radius of the tube. In perspective the matrix is scaled about the eye, so
    that no point moves on the screen.
    """
    world = mesh_object.matrix_world
    step = (OFFSET * surface.diagonal + radius) * max(world.to_scale(), key=abs)
    if region_3d.is_perspective:
        distance = (region_3d.view_matrix @ world.translation).length
        nearer = Matrix.Scale(1.0 - min(abs(step) / max(distance, abs(step)), 0.5), 4)
        nearer[3][3] = 1.0
    else:
        nearer = Matrix.Translation((0.0, 0.0, abs(step)))
    return nearer @ region_3d.view_matrix @ world


def register() -> None:
    add = bpy.types.SpaceView3D.draw_handler_add
    _state.handlers = [
        add(_draw_lines, (), "WINDOW", "POST_VIEW"),
        add(_draw_points, (), "WINDOW", "POST_PIXEL"),
    ]


def unregister() -> None:
    for handler in _state.handlers:
        bpy.types.SpaceView3D.draw_handler_remove(handler, "WINDOW")
    _state.handlers.clear()
    _state.reset()
