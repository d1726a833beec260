# SPDX-License-Identifier: GPL-3.0-or-later
"""The operator that sets all control points of a curve in scripts, and chooses the tool."""

from dataclasses import replace
from typing import TYPE_CHECKING

import bpy
import numpy as np

from .. import settings
from ..operators import polls
from ..operators.answers import answer_now
from ..operators.asymmetry_report import asymmetry_text
from ..operators.error_reports import with_error_reports
from ..operators.followers import follow_now
from ..outputs import edited_curve
from ..outputs.edited_curve import Opened
from ..scene import curve_record, selection
from ..scene.control_points import ControlPoints
from ..scene.curve_record import CurveSettings
from ..scene.messages import InputError
from ..scene.via_points import ViaPoints, no_via_points, sorted_by_leg
from . import modes

if TYPE_CHECKING:
    from ...nicmm_core import Design

OBJECT_SETTINGS = ("spline", "radius", "thickness", "offset")
"""Properties of a new curve object, shown in the redo panel."""

TOO_FEW_POINTS = "A curve needs at least two points, a closed curve at least three. Add more points"


class NICMM_PG_control_point(bpy.types.PropertyGroup):
    """A control point, for scripts"""

    position: bpy.props.FloatVectorProperty(
        name="Position",
        description="Position on the surface in the object's local space",
        subtype="TRANSLATION",
    )


class NICMM_PG_via_point(NICMM_PG_control_point):
    """A via point, for scripts"""

    leg: bpy.props.IntProperty(
        name="Leg",
        description="Index of the control point at which the leg begins",
        min=0,
    )


class NICMM_OT_edit_curve(settings.EditingProperties, bpy.types.Operator):
    """Choose the tool that draws curves on the surface and edits designed curves"""

    bl_idname = "nicmm.edit_curve"
    bl_label = "Edit Curve on Surface"
    bl_options = {"REGISTER", "UNDO"}

    output: bpy.props.EnumProperty(
        name="Output",
        description="Type of a new curve object",
        items=(
            ("CURVE", "Curve", "A curve object on the surface"),
            ("STICKY", "Sticky Curves", "A hair curves object that follows the mesh"),
        ),
        default="CURVE",
    )
    spline: settings.output_property("spline")
    radius: settings.output_property("radius")
    offset: settings.output_property("offset")
    thickness: settings.output_property("thickness")
    tube: settings.output_property("tube")
    curve: bpy.props.StringProperty(
        name="Curve Object",
        description="Name of the designed curve to edit. Leave empty to edit the active curve, or "
        "to draw a new one if a mesh is active",
        options={"SKIP_SAVE", "HIDDEN"},
    )
    points: bpy.props.CollectionProperty(
        name="Control Points",
        description="Control points of the curve, for scripts. Leave empty to keep its points",
        type=NICMM_PG_control_point,
        options={"SKIP_SAVE", "HIDDEN"},
    )
    via_points: bpy.props.CollectionProperty(
        name="Via Points",
        description="Via points of the curve, for scripts. Leave empty to keep those of the curve, "
        "or, with other control points, for none",
        type=NICMM_PG_via_point,
        options={"SKIP_SAVE", "HIDDEN"},
    )

    corners: settings.CORNERS

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        has_mesh = curve_record.mesh_of_context(context) is not None
        return polls.usable(cls, context, has_mesh, polls.NO_MESH_OR_CURVE, polls.TOOL_OR_EDIT)

    def draw(self, context: bpy.types.Context) -> None:
        if not len(self.points):  # the tool was chosen
            return
        layout = self.layout
        layout.use_property_split = True
        layout.use_property_decorate = False
        mesh_object = curve_record.mesh_of_context(context)
        for name in ("closed", "smoothness", "normal_bending"):
            layout.prop(self, name)
        settings.draw_mirror(layout, self, mesh_object)
        layout.prop(self, "use_modifiers")
        for name in edited_curve.MAPS:
            layout.prop_search(self, name, mesh_object, "vertex_groups")
        settings.draw_avoid_others(layout, self)
        layout.prop(self, "clearance")
        if not self.curve:
            for name in ("output", *OBJECT_SETTINGS):
                if name != "thickness" or not self.radius:
                    layout.prop(self, name)
            if self.output == "STICKY":
                layout.prop(self, "tube")

    def invoke(self, context: bpy.types.Context, _event: bpy.types.Event) -> set[str]:
        """Choose the tool in a 3D viewport; with points given, or elsewhere, execute instead."""
        settings.choose_tube(self)
        in_view = context.space_data is not None and context.space_data.type == "VIEW_3D"
        if len(self.points) or not in_view:
            return self.execute(context)
        return with_error_reports(self, lambda: self._choose_tool(context))

    def _choose_tool(self, context: bpy.types.Context) -> set[str]:
        edited = edited_curve.chosen(context, self.curve)
        if context.mode not in modes.TOOLS:
            raise InputError(modes.WRONG_MODE)
        if edited is not None:
            curve_record.mesh_in_view_layer(context, edited)
            modes.make_active(context, edited)
        bpy.ops.wm.tool_set_by_id(name=modes.TOOLS[context.mode])
        # Without a curve nothing has changed that could be undone.
        return {"CANCELLED"} if edited is None else {"FINISHED"}

    def execute(self, context: bpy.types.Context) -> set[str]:
        return with_error_reports(self, lambda: self._execute(context))

    def _execute(self, context: bpy.types.Context) -> set[str]:
        edited = edited_curve.chosen(context, self.curve)
        opened = edited_curve.open_curve(context, edited, self._settings_for(context, edited))
        points = opened.points
        if len(self.points):
            positions = np.array([point.position[:] for point in self.points])
            places = edited_curve.surface_points_at(opened, positions, "points")
            points = ControlPoints(places, np.zeros(len(places), dtype=bool))
            opened = replace(opened, points=points, via=no_via_points())
        elif edited is None:
            raise InputError(
                'There are no control points. Pass points=[{"name": "", "position": (x, y, '
                "z)}, …], or draw with the Surface Curve tool in the 3D viewport"
            )
        changes_corners = self.properties.is_property_set("corners")
        if changes_corners:
            points = replace(points, corners=selection.given_corners(self.corners, len(points)))
        if len(self.via_points):  # they select the course, so it is searched for
            opened = replace(opened, via=self._given_via_points(opened), curve=None)
        is_outdated = edited is not None and not edited_curve.is_current(edited, opened)
        if len(self.points) or changes_corners or is_outdated or opened.curve is None:
            design = _design(context, opened, points)
            curves, remark = design.curves, asymmetry_text(context.scene, opened.surface, design)
        else:
            curves, remark = opened.curves, ""
        result = edited_curve.write(context, opened, points, curves, self)
        self._store(opened, points)
        report = f'"{result.name}" through {len(points)} points{remark}{opened.remark}'
        remarks = follow_now(context, [result])
        self.report({"WARNING" if remarks else "INFO"}, "; ".join([report, *remarks]))
        return {"FINISHED"}

    def _given_via_points(self, opened: Opened) -> ViaPoints:
        legs = [edited_curve.checked_leg(opened, point.leg) for point in self.via_points]
        positions = np.array([point.position[:] for point in self.via_points])
        points = edited_curve.surface_points_at(opened, positions, "via_points")
        return sorted_by_leg(np.array(legs, dtype=np.int64), points)

    def _settings_for(
        self, context: bpy.types.Context, edited: bpy.types.Object | None
    ) -> CurveSettings:
        """The settings of the curve, or of the sidebar, replaced by those given in this call."""
        if edited is None:
            curve_settings = curve_record.settings_from(context.scene.nicmm_curves)
        else:
            curve_settings = curve_record.settings_of(edited)
        given = {
            name: getattr(self, name)
            for name in settings.EditingProperties.__annotations__
            if self.properties.is_property_set(name)
        }
        return replace(curve_settings, method="ELASTIC", **given)

    def _store(self, opened: Opened, points: ControlPoints) -> None:
        """Store points and settings for the redo panel."""
        for name in settings.EditingProperties.__annotations__:
            setattr(self, name, getattr(opened.settings, name))
        self.points.clear()
        for position in edited_curve.positions_of(opened.surface, points):
            self.points.add().position = position
        self.corners = ", ".join(map(str, np.flatnonzero(points.corners)))
        self.via_points.clear()
        for leg, position in zip(opened.via.legs, opened.via_positions(), strict=True):
            stored = self.via_points.add()
            stored.leg, stored.position = leg, position


def _design(context: bpy.types.Context, opened: Opened, points: ControlPoints) -> "Design":
    """The design of the curve through points; an error if it has no curve."""
    requests = edited_curve.request(opened, points)
    if not requests:
        raise InputError(TOO_FEW_POINTS)
    (answer,) = answer_now(context, requests)
    return edited_curve.design_of(answer)


def register() -> None:
    bpy.utils.register_class(NICMM_PG_control_point)
    bpy.utils.register_class(NICMM_PG_via_point)
    bpy.utils.register_class(NICMM_OT_edit_curve)


def unregister() -> None:
    bpy.utils.unregister_class(NICMM_OT_edit_curve)
    bpy.utils.unregister_class(NICMM_PG_via_point)
    bpy.utils.unregister_class(NICMM_PG_control_point)
