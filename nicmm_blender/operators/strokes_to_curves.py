# SPDX-License-Identifier: GPL-3.0-or-later
"""The operator that turns Grease Pencil strokes and curves near a mesh into designed curves."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING

import bpy
import numpy as np
from bpy.props import BoolProperty, FloatProperty

from mathutils import Matrix

from ..outputs import curve_object, edited_curve
from ..scene import curve_record, mesh_arrays, mesh_data
from ..scene.messages import InputError, counted, user_message
from . import polls
from .answers import answer_now
from .error_reports import with_error_reports

if TYPE_CHECKING:
    from ..outputs.edited_curve import Opened

SOURCES = {"CURVE", "CURVES", "GREASEPENCIL"}
"""Types of objects that have strokes."""

NO_STROKES = "Select Grease Pencil or curve objects, and make the mesh active"

FEWEST = 2
"""Least number of points of a stroke."""


Line = tuple[np.ndarray, bool, Matrix]
"""Points of a line, (n, 3), whether it is closed, and the transform of its points to the world."""


@dataclass(frozen=True)
class Stroke:
    """Points of a stroke in world space, (n, 3), and the name of its object."""

    name: str
    points: np.ndarray
    closed: bool


class NICMM_OT_strokes_to_curves(bpy.types.Operator):
    """Create designed curves on the active mesh from the selected strokes and curves near it"""

    bl_idname = "nicmm.strokes_to_curves"
    bl_label = "Strokes to Designed Curves"
    bl_options = {"REGISTER", "UNDO"}

    tolerance: FloatProperty(
        name="Tolerance",
        description="Greatest distance between a stroke and its curve, and of the stroke from the "
        "mesh",
        default=0.05,
        min=0.0,
        soft_max=1.0,
        subtype="DISTANCE",
    )
    keep_original: BoolProperty(
        name="Keep Original",
        description="Keep the objects with the strokes",
        default=True,
    )

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        # The new curve is active and selected afterwards. The redo panel exists only if the
        # operator could run then, although Blender undoes it first.
        can_run = has_strokes(context) or curve_record.has_record(context.active_object)
        return polls.usable(cls, context, can_run, NO_STROKES, polls.OBJECT)

    def execute(self, context: bpy.types.Context) -> set[str]:
        return with_error_reports(self, lambda: self._execute(context))

    def _execute(self, context: bpy.types.Context) -> set[str]:
        from ... import nicmm_core as nicmm

        mesh_object, sources = mesh_data.mesh_object(context), _sources(context)
        if mesh_object is None or not sources:
            raise InputError(NO_STROKES)
        strokes = [stroke for source in sources for stroke in strokes_of(source)]
        if not strokes:
            raise InputError("The selected objects have no strokes with at least two points")
        selected = context.selected_objects
        made, remarks = [], []
        for stroke in strokes:
            try:
                made.append(self._design(context, mesh_object, stroke))
            except InputError as error:
                remarks.append(f'"{stroke.name}": {error}')
            except nicmm.NicmmError as error:
                remarks.append(f'"{stroke.name}": {user_message(error)}')
        if not made:
            for each in selected:
                each.select_set(True)
            raise InputError("; ".join(remarks))
        if not self.keep_original and not remarks:
            for source in sources:
                curve_object.remove(source)
        curve_object.select_only(context, made[-1])
        done = f"{len(made)} of {counted(len(strokes), 'stroke')} converted"
        self.report({"WARNING"} if remarks else {"INFO"}, "; ".join([done, *remarks]))
        return {"FINISHED"}

    def _design(
        self, context: bpy.types.Context, mesh_object: bpy.types.Object, stroke: Stroke
    ) -> bpy.types.Object:
        curve_object.select_only(context, mesh_object)
        opened = _through(edited_curve.open_new(context), stroke, self.tolerance)
        requests = edited_curve.request(opened, opened.points)
        curves = edited_curve.curves_of(answer_now(context, requests))
        panel = context.scene.nicmm_curves
        made = edited_curve.write(context, opened, opened.points, curves, panel)
        made.name = f"{stroke.name} Curve"
        return made


def has_strokes(context: bpy.types.Context) -> bool:
    """Whether objects with strokes are selected and a mesh is active."""
    return mesh_data.mesh_object(context) is not None and bool(_sources(context))


def _sources(context: bpy.types.Context) -> list[bpy.types.Object]:
    """The selected objects with strokes, without designed curves."""
    return [
        each
        for each in context.selected_objects
        if each.type in SOURCES and not curve_record.has_record(each)
    ]


def _through(opened: Opened, stroke: Stroke, tolerance: float) -> Opened:
    """A new curve that follows a stroke."""
    surface = opened.surface
    back = np.linalg.inv(surface.local_to_world)
    local = stroke.points @ back[:3, :3].T + back[:3, 3]
    given = local @ surface.local_to_core.T
    found = edited_curve.points_along(opened, given, tolerance, stroke.closed)
    return edited_curve.new_through(opened, found, stroke.closed)


def strokes_of(source: bpy.types.Object) -> Iterator[Stroke]:
    """The strokes of an object, without its modifiers."""
    found = _pencil_strokes if source.type == "GREASEPENCIL" else _curve_lines
    for points, closed, to_world in found(source):
        if len(points) >= FEWEST:
            matrix = np.array(to_world)
            yield Stroke(source.name, points @ matrix[:3, :3].T + matrix[:3, 3], closed)


def _pencil_strokes(source: bpy.types.Object) -> Iterator[Line]:
    """The strokes of a Grease Pencil object at the current frame."""
    for layer in source.data.layers:
        frame = layer.current_frame()
        if layer.hide or frame is None:
            continue
        to_world = _parent_to_world(source, layer) @ layer.matrix_local
        for stroke in frame.drawing.strokes:
            points = np.array([point.position[:] for point in stroke.points])
            yield points, stroke.cyclic, to_world


def _parent_to_world(source: bpy.types.Object, layer: bpy.types.GreasePencilLayer) -> Matrix:
    """The transform to the world from the space in which a layer is placed."""
    parent = layer.parent
    if parent is None:
        return source.matrix_world
    to_world = parent.matrix_world
    if parent.type == "ARMATURE" and layer.parent_bone in parent.pose.bones:
        to_world = to_world @ parent.pose.bones[layer.parent_bone].matrix
    return to_world @ layer.matrix_parent_inverse


def _curve_lines(source: bpy.types.Object) -> Iterator[Line]:
    """The splines of a curve object, without its bevel."""
    world = source.matrix_world
    if source.type == "CURVES":
        positions = mesh_arrays.read(source.data.points, "position", 3, np.float32)
        cyclic = source.data.attributes.get("cyclic")
        for number, curve in enumerate(source.data.curves):
            begin = curve.first_point_index
            points = positions[begin : begin + curve.points_length].astype(np.float64)
            yield points, cyclic is not None and cyclic.data[number].value, world
        return
    plain = source.data.copy()
    try:
        plain.dimensions = "3D"  # a flat curve would be filled
        plain.bevel_depth = plain.extrude = plain.offset = 0.0
        plain.bevel_object = plain.taper_object = None
        holder = bpy.data.objects.new(source.name, plain)
        mesh = holder.to_mesh()
        for points, closed in _lines_of_mesh(mesh):
            yield points, closed, world
        holder.to_mesh_clear()
        bpy.data.objects.remove(holder)
    finally:
        bpy.data.curves.remove(plain)


def _lines_of_mesh(mesh: bpy.types.Mesh) -> Iterator[tuple[np.ndarray, bool]]:
    """The polylines that the edges of a mesh form, with consecutive vertices."""
    places = np.array([vertex.co[:] for vertex in mesh.vertices]).reshape(-1, 3)
    pairs = {tuple(sorted(edge.vertices)) for edge in mesh.edges}
    begin = 0
    for end in range(1, len(places) + 1):
        if end < len(places) and (end - 1, end) in pairs:
            continue
        yield places[begin:end], (begin, end - 1) in pairs and end - begin > 2
        begin = end


def register() -> None:
    bpy.utils.register_class(NICMM_OT_strokes_to_curves)


def unregister() -> None:
    bpy.utils.unregister_class(NICMM_OT_strokes_to_curves)
