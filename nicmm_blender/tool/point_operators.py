# SPDX-License-Identifier: GPL-3.0-or-later
"""The operators that change single control points, and those that activate or end a curve.

Each has a full `execute` and is one undo step. The only state is the curve object with its record.
"""

import bpy
import numpy as np

from ..operators import polls
from ..operators.error_reports import with_error_reports
from ..operators.long_solves import LongSolves
from ..outputs import edited_curve
from ..outputs.writing import SEPARATE
from ..scene import curve_record
from ..scene.messages import InputError
from ..settings import CURVE
from . import modes
from .point_drag import PointDrag

POSITION = bpy.props.FloatVectorProperty(
    name="Position",
    description="Position of the point on the surface in the local space of the mesh object",
    subtype="TRANSLATION",
    precision=4,
    options={"SKIP_SAVE"},
)


INDEX = bpy.props.IntProperty(
    name="Point",
    description="Index of the control point",
    min=0,
    options={"SKIP_SAVE"},
)


class _ChangesPoints(LongSolves):
    """A mixin for operators with `changed(opened)`: designs the curve through these points."""

    @classmethod
    def poll(cls, context):
        has_mesh = curve_record.mesh_of_context(context) is not None
        return polls.usable(cls, context, has_mesh, polls.NO_MESH_OR_CURVE, polls.TOOL)

    def requests(self, context) -> list:
        self._opened = self.open_curve(context)
        self._points = self.changed(self._opened)
        return edited_curve.request(self._opened, self._points)

    def open_curve(self, context):
        """Open the curve to change."""
        edited = edited_curve.chosen(context, self.curve)
        if edited is None:
            raise InputError(polls.NO_CURVE)
        return edited_curve.open_curve(context, edited)

    def finish(self, context, _requests: list, answers: list) -> set:
        curves = edited_curve.curves_of(answers)
        panel = context.scene.nicmm_curves
        opened, points = self._opened, self._points
        result = edited_curve.write(context, opened, points, curves, _Output(panel))
        modes.make_active(context, result)
        if opened.remark:
            self.report({"WARNING"}, f'"{result.name}" through {len(points)} points{opened.remark}')
        return {"FINISHED"}

    def checked_index(self, opened) -> int:
        """The index of the control point; an error if there is no such point."""
        count = len(opened.points)
        if not 0 <= self.index < count:
            raise InputError(
                f"There is no control point {self.index}; the curve has {count}, counted from 0"
            )
        return self.index

    def place(self, opened):
        """The position of the new or moved point on the surface, as a point of the core."""
        if self.dragged is not None:
            return self.dragged
        given = np.array([self.position[:]], dtype=float)
        if self.from_mouse:  # the redo panel after a click, where any position can be entered
            return edited_curve.nearest_surface_points(opened, given)
        return edited_curve.surface_points_at(opened, given, "position")


class _Output:
    """The output settings of the sidebar for a new object, limited to outputs of the tool."""

    def __init__(self, panel) -> None:
        self.output = panel.output if panel.output in SEPARATE else "CURVE"
        for name in ("spline", "radius", "thickness", "offset", "tube"):
            setattr(self, name, getattr(panel, name))


class NICMM_OT_add_point(PointDrag, _ChangesPoints, bpy.types.Operator):
    """Add a control point at the end of the active curve, or begin a new curve on the mesh"""

    bl_idname = "nicmm.add_point"
    bl_label = "Add Point on Surface"
    bl_options = {"REGISTER", "UNDO"}

    curve: CURVE
    position: POSITION
    from_mouse: PointDrag.FROM_MOUSE

    def open_curve(self, context):
        return edited_curve.open_curve(context, edited_curve.chosen(context, self.curve))

    def changed(self, opened):
        return edited_curve.with_point(opened.points, len(opened.points), self.place(opened))


class NICMM_OT_insert_point(PointDrag, _ChangesPoints, bpy.types.Operator):
    """Insert a control point between two control points of a curve"""

    bl_idname = "nicmm.insert_point"
    bl_label = "Insert Point into Curve"
    bl_options = {"REGISTER", "UNDO"}

    curve: CURVE
    index: bpy.props.IntProperty(
        name="Before",
        description="Index of the control point before which the new one is inserted",
        min=0,
        options={"SKIP_SAVE"},
    )
    position: POSITION
    from_mouse: PointDrag.FROM_MOUSE

    def changed(self, opened):
        count = len(opened.points)
        if self.index != count:
            self.checked_index(opened)
        return edited_curve.with_point(opened.points, self.index, self.place(opened))


class NICMM_OT_move_point(PointDrag, _ChangesPoints, bpy.types.Operator):
    """Move a control point of a curve on the surface"""

    bl_idname = "nicmm.move_point"
    bl_label = "Move Point on Surface"
    bl_options = {"REGISTER", "UNDO"}

    curve: CURVE
    index: INDEX
    position: POSITION
    from_mouse: PointDrag.FROM_MOUSE

    def changed(self, opened):
        number = self.checked_index(opened)
        return edited_curve.with_point(opened.points, number, self.place(opened), replaced=True)


class NICMM_OT_remove_point(_ChangesPoints, bpy.types.Operator):
    """Remove a control point from a curve"""

    bl_idname = "nicmm.remove_point"
    bl_label = "Remove Point from Curve"
    bl_options = {"REGISTER", "UNDO"}

    curve: CURVE
    index: INDEX

    def changed(self, opened):
        return edited_curve.without_point(opened.points, self.checked_index(opened))


class NICMM_OT_activate_curve(bpy.types.Operator):
    """Make a designed curve active, so that its points can be edited"""

    bl_idname = "nicmm.activate_curve"
    bl_label = "Activate Designed Curve"
    bl_options = {"REGISTER", "UNDO"}

    curve: CURVE

    @classmethod
    def poll(cls, context):
        has_mesh = curve_record.mesh_of_context(context) is not None
        return polls.usable(cls, context, has_mesh, polls.NO_MESH_OR_CURVE, polls.TOOL)

    def execute(self, context):
        return with_error_reports(self, lambda: self._execute(context))

    def _execute(self, context):
        chosen = edited_curve.chosen(context, self.curve)
        if chosen is None:
            raise InputError(polls.NO_CURVE)
        curve_record.mesh_in_view_layer(context, chosen)
        modes.make_active(context, chosen)
        return {"FINISHED"}


class NICMM_OT_end_curve(bpy.types.Operator):
    """End the active curve. Its mesh becomes active, and the next click begins a new curve"""

    bl_idname = "nicmm.end_curve"
    bl_label = "End Curve"
    bl_options = {"REGISTER", "UNDO"}

    @classmethod
    def poll(cls, context):
        has_curve = edited_curve.active(context) is not None
        return polls.usable(cls, context, has_curve, polls.NO_CURVE, polls.TOOL)

    def execute(self, context):
        return with_error_reports(self, lambda: self._execute(context))

    def _execute(self, context):
        ended = edited_curve.active(context)
        if not curve_record.has_curve(ended):
            raise InputError(curve_record.no_curve_message(ended))
        curve_record.mesh_in_view_layer(context, ended)
        modes.make_active(context, None)
        self.report({"INFO"}, f'"{ended.name}" is complete')
        return {"FINISHED"}


CLASSES = (
    NICMM_OT_add_point,
    NICMM_OT_insert_point,
    NICMM_OT_move_point,
    NICMM_OT_remove_point,
    NICMM_OT_activate_curve,
    NICMM_OT_end_curve,
)


def register() -> None:
    for operator in CLASSES:
        bpy.utils.register_class(operator)


def unregister() -> None:
    for operator in reversed(CLASSES):
        bpy.utils.unregister_class(operator)
