# SPDX-License-Identifier: GPL-3.0-or-later
"""Draws the active curve and its control points over the 3D viewports while the tool is active.

Parts hidden by the mesh are dimmed. A mark under the mouse shows what a click would do.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
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
from . import element_snap, modes, picking
from .picking import Kind
from .view import OFFSET, View

if TYPE_CHECKING:
    from ...nicmm_core import SurfaceCurve
    from ...nicmm_core.geometry.plane_section import PlaneSection

Colour = tuple[float, ...]
"""Red, green and blue, and possibly opacity."""

HIDDEN = 0.22
"""Opacity of parts hidden by the mesh."""

IMAGE, PLANE = 0.6, 0.35
"""Opacity of mirror images of control points, and of the line where a mirror cuts the mesh."""

LINE_WIDTH, POINT_RADIUS, OUTLINE_WIDTH = 3.0, 5.5, 1.5
RING_RADIUS, HOLE_RADIUS, IMAGE_HOLE = 6.5, 4.5, 3.0
PLANE_WIDTH = 1.0
"""Sizes in pixels at a resolution scale of 1."""

DASHES = 40
"""Number of dashes of a line with a problem, which can be told from others without its colour."""

MOST_VIEWS = 8
"""Number of views whose visible points are kept; a quad view has four."""

DISC_SIDES = 20
"""Number of sides of the disc that shows a control point, and of the ring of a via point."""

OUTLINE = (0.05, 0.05, 0.05)
"""Dark colour under every line and point, so that they stand out from any theme colour."""


@dataclass(frozen=True)
class _Drawn:
    """A curve with its points, and what its lines are: those of a curve, or of a pair."""

    opened: Opened
    lines: list[np.ndarray]
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
        self.batches: list[gpu.types.GPUBatch] = []
        self.batches_of: list[np.ndarray] = []
        self.dashed = False
        self.plane: gpu.types.GPUBatch | None = None
        self.plane_of: PlaneSection | None = None
        self.visible: dict[tuple[object, ...], np.ndarray] = {}


_state = _State()


def show_dragged(edited: Opened, curves: list[SurfaceCurve], problem: str = "") -> None:
    """Draw a curve that is being changed, with its changed points, instead of the active one."""
    _state.hover = None
    lines = [edited_curve.polyline_of(edited.surface, curve) for curve in curves]
    _state.dragged = _Drawn(edited, lines, problem, radius_of(edited))


def show_active() -> None:
    """Draw the active curve again instead of one that is being changed."""
    _state.dragged, _state.hover = None, None


def show_hover(hit: picking.Hit | None) -> None:
    """Mark what is under the mouse, a `picking.Hit` or None."""
    if hit != _state.hover:
        _state.hover = hit
        redraw()


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
    except (InputError, NicmmError, ImportError):
        return None  # a click reports the error
    return _Drawn(opened, opened.lines(), "", radius_of(opened))


def _hover_on(drawn: _Drawn) -> picking.Hit | None:
    """What is marked under the mouse on the drawn mesh, or None; nothing is marked in a drag."""
    hit = _state.hover
    is_here = hit is not None and hit.mesh_uid == drawn.opened.mesh_uid
    marks = is_here and _state.dragged is None
    return hit if marks else None


def radius_of(opened: Opened) -> float:
    """How far the curve object reaches from its line; see `picking.radius_of`."""
    curve = opened.curve_object
    return 0.0 if curve is None else picking.radius_of(curve, opened.surface)


def _draw_lines() -> None:
    context = bpy.context
    drawn = _drawn_now(context)
    if drawn is None or (mesh_object := by_uid(drawn.opened.mesh_uid)) is None:
        return
    colours, surface = Colours(context), drawn.opened.surface
    if (plane := _plane_batch(drawn.opened)) is not None:
        nearer = towards_the_eye(context.region_data, mesh_object, surface, 0.0)
        layers = [(PLANE_WIDTH, colours.point)]
        draw_layers(context, nearer, plane, layers, PLANE)
    nearer = towards_the_eye(context.region_data, mesh_object, surface, drawn.radius)
    colour = colours.problem if drawn.problem else colours.line
    for batch in _line_batches(drawn.lines, bool(drawn.problem)):
        draw_line(context, nearer, batch, colour)
    hit = _hover_on(drawn)
    if hit is not None and hit.kind is Kind.CURVE:
        for line in picking.other_lines(context):
            if line.name == hit.name and len(line.positions) > 1:
                nearer = towards_the_eye(context.region_data, mesh_object, surface, line.radius)
                draw_line(context, nearer, batch_of_line(line.positions), colours.hover)


def draw_line(
    context: bpy.types.Context,
    matrix: Matrix,
    batch: gpu.types.GPUBatch,
    colour: Colour,
    line_width: float = LINE_WIDTH,
) -> None:
    """Draw a line with an outline; parts that the mesh hides are dimmed."""
    layers = [(line_width + 2.0 * OUTLINE_WIDTH, OUTLINE), (line_width, colour)]
    draw_layers(context, matrix, batch, layers)


def draw_layers(
    context: bpy.types.Context,
    matrix: Matrix,
    batch: gpu.types.GPUBatch,
    layers: Sequence[tuple[float, Colour]],
    shown: float = 1.0,
) -> None:
    """Draw a line several times, with other widths and colours; hidden parts are dimmed.

    `shown` is the opacity of the other parts.
    """
    shader = gpu.shader.from_builtin("POLYLINE_UNIFORM_COLOR")
    region, scale = context.region, context.preferences.system.ui_scale
    hidden = shown if picking.is_xray(context.space_data) else HIDDEN * shown
    gpu.state.blend_set("ALPHA")
    gpu.state.depth_mask_set(False)
    with gpu.matrix.push_pop():
        gpu.matrix.load_matrix(matrix)
        shader.bind()
        shader.uniform_float("viewportSize", (region.width, region.height))
        for width, shade in layers:
            shader.uniform_float("lineWidth", width * scale)
            for test, opacity in (("GREATER", hidden), ("LESS_EQUAL", shown)):
                gpu.state.depth_test_set(test)
                shader.uniform_float("color", (*shade[:3], opacity))
                batch.draw(shader)
    gpu.state.depth_test_set("NONE")
    gpu.state.blend_set("NONE")


def _line_batches(lines: list[np.ndarray], dashed: bool) -> list[gpu.types.GPUBatch]:
    """The batches of the active lines, rebuilt only if the lines have changed."""
    before = _state.batches_of
    same = len(before) == len(lines) and all(map(np.array_equal, before, lines))
    if not same or dashed != _state.dashed:
        batch_of = _batch_of_dashes if dashed else batch_of_line
        _state.batches = [batch_of(line) for line in lines]
        _state.batches_of, _state.dashed = lines, dashed
    return _state.batches


def _batch_of_dashes(line: np.ndarray) -> gpu.types.GPUBatch:
    """The batch of a dashed line, (n, 3), for `draw_line`."""
    shader = gpu.shader.from_builtin("POLYLINE_UNIFORM_COLOR")
    ends = dashes(line).reshape(-1, 3)
    return batch_for_shader(shader, "LINES", {"pos": ends.astype(np.float32)})


def dashes(line: np.ndarray) -> np.ndarray:
    """The ends of the segments of a line, (n, 3), that lie on its dashes, (m, 2, 3)."""
    segments = np.stack([line[:-1], line[1:]], axis=1)
    length = np.linalg.norm(segments[:, 1] - segments[:, 0], axis=1)
    middle = np.cumsum(length) - 0.5 * length
    dash = (2 * DASHES * middle / max(length.sum(), np.finfo(float).tiny)).astype(int)
    return segments[dash % 2 == 0]


def _plane_batch(opened: Opened) -> gpu.types.GPUBatch | None:
    """The batch of the line where the mirror cuts the mesh; None without such a line."""
    section = opened.section
    if section is None or not len(section.faces):
        return None
    if _state.plane is None or _state.plane_of is not section:
        shader = gpu.shader.from_builtin("POLYLINE_UNIFORM_COLOR")
        faces = np.repeat(section.faces, 2)
        ends = opened.surface.points(faces, section.barycentric.reshape(-1, 3))
        _state.plane = batch_for_shader(shader, "LINES", {"pos": ends.astype(np.float32)})
        _state.plane_of = section
    return _state.plane


def batch_of_line(line: np.ndarray) -> gpu.types.GPUBatch:
    """The batch of a line, (n, 3), for `draw_line`."""
    shader = gpu.shader.from_builtin("POLYLINE_UNIFORM_COLOR")
    return batch_for_shader(shader, "LINE_STRIP", {"pos": line.astype(np.float32)})


def _draw_points() -> None:
    context = bpy.context
    drawn = _drawn_now(context)
    if drawn is None or (mesh_object := by_uid(drawn.opened.mesh_uid)) is None:
        return
    view = picking.view_on(context, mesh_object, drawn.opened.surface)
    marks = _marks(drawn.opened, _hover_on(drawn), Colours(context))
    if not marks:
        return
    positions = np.array([mark.position for mark in marks])
    centres, visible = view.project(positions), _visible(view, positions)
    scale = context.preferences.system.ui_scale
    outlines, colour_of = [], []
    shown = np.flatnonzero(np.isfinite(centres).all(axis=1))
    for number in shown[np.argsort(visible[shown], kind="stable")].tolist():
        mark = marks[number]
        opacity = mark.opacity * (1.0 if visible[number] else HIDDEN)
        for shape, colour in zip(mark.shapes, (OUTLINE, mark.fill), strict=True):
            outlines.append(centres[number] + scale * shape)
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


@dataclass(frozen=True)
class _Mark:
    """What is drawn at a position: the outline and the filled shape, and the colour of this."""

    position: np.ndarray | tuple[float, float, float]
    shapes: tuple[np.ndarray, np.ndarray]
    fill: Colour
    opacity: float = 1.0


def _marks(opened: Opened, hit: picking.Hit | None, colours: Colours) -> list[_Mark]:
    """The marks of control points and via points, of their images, and of what is hovered."""
    hovered_is = None if hit is None else (hit.kind, hit.index, hit.is_image)

    def fill(kind: Kind, index: int, is_image: bool = False) -> Colour:
        return colours.hover if hovered_is == (kind, index, is_image) else colours.point

    corners, junctions, marks = opened.points.corners, opened.junctions, []
    for number, position in enumerate(opened.positions()):
        shapes = _SHAPES[bool(corners[number]), bool(junctions[number])]
        marks.append(_Mark(position, shapes, fill(Kind.POINT, number)))
    for owner, position in zip(opened.images.owners, opened.image_positions(), strict=True):
        shapes = _HOLLOW_SQUARES if corners[owner] else _HOLLOW_DISCS
        marks.append(_Mark(position, shapes, fill(Kind.POINT, owner, True), IMAGE))
    for number, position in enumerate(opened.via_positions()):
        marks.append(_Mark(position, _RINGS, fill(Kind.VIA, number)))
    if hit is not None and hit.kind in _SHAPES_OF_NEW_POINTS:
        shapes = _SHAPES_OF_ELEMENTS.get(hit.element, _SHAPES_OF_NEW_POINTS[hit.kind])
        marks.append(_Mark(hit.position, shapes, colours.hover))
    return marks


def _visible(view: View, positions: np.ndarray) -> np.ndarray:
    """Which points are visible; rays are cast only if no viewport has shown them in this view."""
    key = view.perspective.tobytes(), view.xray, id(view.mesh), positions.tobytes()
    if key not in _state.visible:
        if len(_state.visible) == MOST_VIEWS:
            del _state.visible[next(iter(_state.visible))]
        _state.visible[key] = view.visible(positions)
    return _state.visible[key]


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


def _square(inner: float, outer: float) -> np.ndarray:
    """Triangles between two squares around the origin, as consecutive corners, (24, 2)."""
    rim = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1], [-1, -1]], dtype=np.float64)
    (a, b), (c, d) = ((half * rim[:-1], half * rim[1:]) for half in (inner, outer))
    return np.stack([a, c, d, a, d, b], axis=1).reshape(-1, 2)


def _triangle(inner: float, outer: float) -> np.ndarray:
    """Triangles between two upright triangles around the origin, as corners, (18, 2)."""
    angles = np.pi * (0.5 + np.arange(4) * 2.0 / 3.0)
    rim = np.stack([np.cos(angles), np.sin(angles)], axis=1)
    (a, b), (c, d) = ((size * rim[:-1], size * rim[1:]) for size in (inner, outer))
    return np.stack([a, c, d, a, d, b], axis=1).reshape(-1, 2)


def _outlined(
    shape: Callable[[float, float], np.ndarray], inner: float, outer: float
) -> tuple[np.ndarray, np.ndarray]:
    """A shape, and before it a larger one that shows as its outline."""
    outline = shape(max(inner - OUTLINE_WIDTH, 0.0), outer + OUTLINE_WIDTH)
    return outline, shape(inner, outer)


_DISCS, _HOLLOW_DISCS = (_outlined(_ring, hole, POINT_RADIUS) for hole in (0.0, IMAGE_HOLE))
_SMALL_DISCS = 0.6 * _DISCS[0], 0.6 * _DISCS[1]  # where a click would add a point
_SQUARES, _HOLLOW_SQUARES = (_outlined(_square, hole, POINT_RADIUS) for hole in (0.0, IMAGE_HOLE))
_RINGS = _outlined(_ring, HOLE_RADIUS, RING_RADIUS)
_TURN = np.array([[1.0, 1.0], [-1.0, 1.0]])
"""A turn by 45 degrees that enlarges by the square root of 2, so that a diamond is as wide as a
disc with a rim."""
_DIAMONDS = _SQUARES[0] @ _TURN, _SQUARES[1] @ _TURN
_STARS = tuple(
    np.concatenate([square, diamond / np.sqrt(2.0)])
    for square, diamond in zip(_SQUARES, _DIAMONDS, strict=True)
)

_SHAPES = {
    (False, False): _DISCS,
    (True, False): _SQUARES,
    (False, True): _DIAMONDS,
    (True, True): _STARS,
}
"""Shapes of control points, by whether they are corners and whether they lie on other curves."""

_SHAPES_OF_ELEMENTS = {
    element_snap.VERTEX: _outlined(_square, HOLE_RADIUS, RING_RADIUS),
    element_snap.MIDPOINT: _outlined(_triangle, HOLE_RADIUS, RING_RADIUS + 2.0),
    element_snap.EDGE: _outlined(_ring, HOLE_RADIUS, RING_RADIUS),
    element_snap.CENTRE: (
        np.concatenate([_outlined(_ring, HOLE_RADIUS, RING_RADIUS)[0], _ring(0.0, 3.0)]),
        np.concatenate([_ring(HOLE_RADIUS, RING_RADIUS), _ring(0.0, 2.0)]),
    ),
    picking.CURVE: _DIAMONDS,
}
"""Shapes of the mark where a click would add a point, by the element that it snaps to."""

_SHAPES_OF_NEW_POINTS = {
    Kind.LINE: _SMALL_DISCS,
    Kind.SURFACE: _SMALL_DISCS,
    Kind.JUNCTION: _DIAMONDS,
}
"""Shapes of the mark where a click would add a point, by what is under the mouse."""


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
