# SPDX-License-Identifier: GPL-3.0-or-later
"""The operators that change single points of a curve, and those that activate or end a curve.

Each has a full `execute` and is one undo step. The only state is the curve object with its record.
"""

from typing import TYPE_CHECKING

import bpy

from ..operators import polls
from ..operators.error_reports import with_error_reports
from ..outputs import edited_curve
from ..outputs.edited_curve import Opened
from ..scene import curve_record
from ..scene.control_points import ControlPoints
from ..scene.messages import InputError
from ..settings import CURVE
from . import mirror_snap, modes, picking
from .changes_points import ChangesPoints
from .point_drag import PointDrag

if TYPE_CHECKING:
    from ..scene.via_points import ViaPoints

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


VIA_INDEX = bpy.props.IntProperty(
    name="Via Point",
    description="Index of the via point among all via points of the curve",
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

    def changed_via(self, opened: Opened) -> "ViaPoints":
        return edited_curve.via_after_insertion(opened, len(opened.points), self.place(opened))

    def may_be_on_plane(self, opened: Opened) -> bool:
        return mirror_snap.may_end_on_plane(opened)


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
    image: ChangesPoints.IMAGE

    def changed(self, opened: Opened) -> ControlPoints:
        count = len(opened.points)
        if self.index != count:
            self.checked_index(opened)
        return edited_curve.with_point(opened.points, self.index, self.place(opened))

    def changed_via(self, opened: Opened) -> "ViaPoints":
        return edited_curve.via_after_insertion(opened, self.index, self.place(opened))

    def may_be_on_plane(self, opened: Opened) -> bool:
        return mirror_snap.may_be_inserted_on_plane(opened, self.index)


class NICMM_OT_move_point(PointDrag, bpy.types.Operator):
    """Move a control point of a curve on the surface"""

    bl_idname = "nicmm.move_point"
    bl_label = "Move Point on Surface"
    bl_options = {"REGISTER", "UNDO"}

    curve: CURVE
    index: INDEX
    position: POSITION
    from_mouse: PointDrag.FROM_MOUSE
    image: ChangesPoints.IMAGE

    def changed(self, opened: Opened) -> ControlPoints:
        number = self.checked_index(opened)
        place = self.place(opened, number)
        return edited_curve.with_point(opened.points, number, place, replaced=True)

    def may_be_on_plane(self, opened: Opened) -> bool:
        return self.index in mirror_snap.ends(opened, len(opened.points))


class NICMM_OT_remove_point(ChangesPoints, bpy.types.Operator):
    """Remove a control point from a curve"""

    bl_idname = "nicmm.remove_point"
    bl_label = "Remove Point from Curve"
    bl_options = {"REGISTER", "UNDO"}

    curve: CURVE
    index: INDEX

    def changed(self, opened: Opened) -> ControlPoints:
        return edited_curve.without_point(opened.points, self.checked_index(opened))

    def changed_via(self, opened: Opened) -> "ViaPoints":
        return opened.via.after_removal(self.index, *opened.path)


class NICMM_OT_add_via_point(PointDrag, bpy.types.Operator):
    """Add a via point to a leg of a curve, which then takes the course that passes near it"""

    bl_idname = "nicmm.add_via_point"
    bl_label = "Add Via Point to Curve"
    bl_options = {"REGISTER", "UNDO"}

    searches_course = True
    snaps = False

    curve: CURVE
    leg: bpy.props.IntProperty(
        name="Leg",
        description="Index of the control point at which the leg begins",
        min=0,
        options={"SKIP_SAVE"},
    )
    index: bpy.props.IntProperty(
        name="Index",
        description="Index of the new via point among all via points of the curve. -1 finds it by "
        "the position along the leg",
        default=-1,
        min=-1,
        options={"SKIP_SAVE", "HIDDEN"},
    )
    position: POSITION
    from_mouse: PointDrag.FROM_MOUSE
    image: ChangesPoints.IMAGE

    def changed_via(self, opened: Opened) -> "ViaPoints":
        place, leg = self.place(opened), edited_curve.checked_leg(opened, self.leg)
        if self.index < 0:  # once only, so that it stays while the point is dragged
            self.index = edited_curve.index_of_new_via(opened, leg, place)
        return opened.via.inserted(self.index, leg, place)


class NICMM_OT_move_via_point(PointDrag, bpy.types.Operator):
    """Move a via point of a curve, which then takes the course that passes near it"""

    bl_idname = "nicmm.move_via_point"
    bl_label = "Move Via Point on Surface"
    bl_options = {"REGISTER", "UNDO"}

    searches_course = True
    snaps = False

    curve: CURVE
    index: VIA_INDEX
    position: POSITION
    from_mouse: PointDrag.FROM_MOUSE

    def changed_via(self, opened: Opened) -> "ViaPoints":
        return opened.via.moved(self.checked_via_index(opened), self.place(opened))


class NICMM_OT_remove_via_point(ChangesPoints, bpy.types.Operator):
    """Remove a via point from a curve, and search for its course again"""

    bl_idname = "nicmm.remove_via_point"
    bl_label = "Remove Via Point from Curve"
    bl_options = {"REGISTER", "UNDO"}

    searches_course = True

    curve: CURVE
    index: VIA_INDEX

    def changed_via(self, opened: Opened) -> "ViaPoints":
        return opened.via.without(self.checked_via_index(opened))


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
    NICMM_OT_add_via_point,
    NICMM_OT_move_via_point,
    NICMM_OT_remove_via_point,
    NICMM_OT_activate_curve,
    NICMM_OT_end_curve,
)


def register() -> None:
    for operator in CLASSES:
        bpy.utils.register_class(operator)


def unregister() -> None:
    for operator in reversed(CLASSES):
        bpy.utils.unregister_class(operator)
