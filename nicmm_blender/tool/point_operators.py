# SPDX-License-Identifier: GPL-3.0-or-later
"""The operators that change single control points, and those that activate or end a curve.

Each has a full `execute` and is one undo step. The only state is the curve object with its record.
"""

import bpy

from ..operators import polls
from ..operators.error_reports import with_error_reports
from ..outputs import edited_curve
from ..outputs.edited_curve import Opened
from ..scene import curve_record
from ..scene.control_points import ControlPoints
from ..scene.messages import InputError
from ..settings import CURVE
from . import modes, picking
from .changes_points import ChangesPoints
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


class NICMM_OT_add_point(PointDrag, bpy.types.Operator):
    """Add a control point at the end of the active curve, or begin a new curve on the mesh"""

    bl_idname = "nicmm.add_point"
    bl_label = "Add Point on Surface"
    bl_options = {"REGISTER", "UNDO"}

    curve: CURVE
    position: POSITION
    from_mouse: PointDrag.FROM_MOUSE

    def open_curve(self, context: bpy.types.Context) -> Opened:
        return edited_curve.open_curve(context, edited_curve.chosen(context, self.curve))

    def changed(self, opened: Opened) -> ControlPoints:
        return edited_curve.with_point(opened.points, len(opened.points), self.place(opened))


class NICMM_OT_insert_point(PointDrag, bpy.types.Operator):
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

    def changed(self, opened: Opened) -> ControlPoints:
        count = len(opened.points)
        if self.index != count:
            self.checked_index(opened)
        return edited_curve.with_point(opened.points, self.index, self.place(opened))


class NICMM_OT_move_point(PointDrag, bpy.types.Operator):
    """Move a control point of a curve on the surface"""

    bl_idname = "nicmm.move_point"
    bl_label = "Move Point on Surface"
    bl_options = {"REGISTER", "UNDO"}

    curve: CURVE
    index: INDEX
    position: POSITION
    from_mouse: PointDrag.FROM_MOUSE

    def changed(self, opened: Opened) -> ControlPoints:
        number = self.checked_index(opened)
        return edited_curve.with_point(opened.points, number, self.place(opened), replaced=True)


class NICMM_OT_remove_point(ChangesPoints, bpy.types.Operator):
    """Remove a control point from a curve"""

    bl_idname = "nicmm.remove_point"
    bl_label = "Remove Point from Curve"
    bl_options = {"REGISTER", "UNDO"}

    curve: CURVE
    index: INDEX

    def changed(self, opened: Opened) -> ControlPoints:
        return edited_curve.without_point(opened.points, self.checked_index(opened))


class NICMM_OT_toggle_corner(ChangesPoints, bpy.types.Operator):
    """Let the curve turn freely at a control point, or make it smooth there again"""

    bl_idname = "nicmm.toggle_corner"
    bl_label = "Toggle Corner"
    bl_options = {"REGISTER", "UNDO"}

    curve: CURVE
    index: INDEX

    def invoke(self, context: bpy.types.Context, event: bpy.types.Event) -> set[str]:
        """Toggle the point with the given index, or else the one under the mouse."""
        if not self.properties.is_property_set("index"):
            hit = picking.under_mouse_now(context, picking.pixel_of(event))
            if hit is None or hit.kind is not picking.Kind.POINT:
                return {"PASS_THROUGH"}
            self.curve, self.index = hit.name, hit.index
        return super().invoke(context, event)

    def changed(self, opened: Opened) -> ControlPoints:
        return edited_curve.with_toggled_corner(opened.points, self.checked_index(opened))


class NICMM_OT_activate_curve(bpy.types.Operator):
    """Make a designed curve active, so that its points can be edited"""

    bl_idname = "nicmm.activate_curve"
    bl_label = "Activate Designed Curve"
    bl_options = {"REGISTER", "UNDO"}

    curve: CURVE

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        has_mesh = curve_record.mesh_of_context(context) is not None
        return polls.usable(cls, context, has_mesh, polls.NO_MESH_OR_CURVE, polls.TOOL)

    def execute(self, context: bpy.types.Context) -> set[str]:
        return with_error_reports(self, lambda: self._execute(context))

    def _execute(self, context: bpy.types.Context) -> set[str]:
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
    def poll(cls, context: bpy.types.Context) -> bool:
        has_curve = edited_curve.active(context) is not None
        return polls.usable(cls, context, has_curve, polls.NO_CURVE, polls.TOOL)

    def execute(self, context: bpy.types.Context) -> set[str]:
        return with_error_reports(self, lambda: self._execute(context))

    def _execute(self, context: bpy.types.Context) -> set[str]:
        ended = edited_curve.active(context)
        if ended is None:
            raise InputError(polls.NO_CURVE)
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
    NICMM_OT_toggle_corner,
    NICMM_OT_activate_curve,
    NICMM_OT_end_curve,
)


def register() -> None:
    for operator in CLASSES:
        bpy.utils.register_class(operator)


def unregister() -> None:
    for operator in reversed(CLASSES):
        bpy.utils.unregister_class(operator)
