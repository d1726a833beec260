# SPDX-License-Identifier: GPL-3.0-or-later
"""The operator that designs a curve through the selected vertices."""

from dataclasses import replace
from typing import TYPE_CHECKING

import bpy
import numpy as np
from bpy.props import StringProperty

from .. import settings
from ..outputs import writing
from ..scene import curve_order, curve_record, design_request, mesh_data, selection
from ..scene.design_request import DesignRequest
from ..scene.messages import InputError, counted
from ..scene.surface import Surface, active_modifiers_text, read
from . import polls
from .asymmetry_report import asymmetry_text
from .long_solves import LongSolves

if TYPE_CHECKING:
    from ...nicmm_core import Design, SurfacePoints
    from ..scene.design_request import Answer

# For reports, by the core's name of the order and whether the points are the selected vertices.
ORDER_NAMES = {
    ("given", True): "in the order of selection",
    ("given", False): "in the order given",
    ("shortest", True): "in the shortest order",
    ("shortest", False): "in the shortest order",
}


class NICMM_OT_design_curve(
    LongSolves, settings.DesignProperties, settings.OutputProperties, bpy.types.Operator
):
    """Draw a smooth curve on the surface of the mesh through its selected vertices"""

    bl_idname = "nicmm.design_curve"
    bl_label = "Design Curve on Surface"
    bl_options = {"REGISTER", "UNDO"}

    points: StringProperty(
        name="Points",
        description="Control points instead of the selected vertices, for scripts. Vertex indices "
        "or positions in the object's local space, separated by commas, such as 12, 80, 0.5 0 1",
        options={"HIDDEN", "SKIP_SAVE"},
    )
    point_group: StringProperty(
        name="Point Group",
        description="Vertex group whose vertices are the control points instead of the selected "
        "vertices, for scripts",
        options={"HIDDEN", "SKIP_SAVE"},
    )
    via_points: StringProperty(
        name="Via Points",
        description="Points near which the curve runs on its way from one control point to the "
        "next, for scripts. For each leg the index of the control point at which it begins and "
        "points, such as 1: 57, 63; 2: 0.5 0 1",
        options={"HIDDEN", "SKIP_SAVE"},
    )

    corners: settings.CORNERS

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        has_mesh = mesh_data.mesh_object(context) is not None
        return polls.usable(cls, context, has_mesh, polls.NO_MESH, polls.OBJECT_OR_EDIT)

    def draw(self, context: bpy.types.Context) -> None:
        settings.draw(self.layout, self, mesh_data.mesh_object(context))

    def invoke(self, context: bpy.types.Context, event: bpy.types.Event) -> set[str]:
        settings.take_from_sidebar(self, context.scene.nicmm_curves)
        return super().invoke(context, event)

    def requests(self, context: bpy.types.Context) -> list[DesignRequest]:
        mesh_object = mesh_data.mesh_object(context)
        mesh_data.synchronise(mesh_object)
        surface = read(mesh_object, self.use_modifiers)
        points, order = self._control_points(mesh_object, surface)
        curve_settings = curve_record.settings_from(self)
        request = design_request.for_points(mesh_object, surface, points, order, curve_settings)
        if self.via_points:
            via = selection.given_via_points(surface, self.via_points)
            request = design_request.with_via_points(request, via)
        alternatives = _alternatives(self)
        if alternatives and self.output not in writing.SEPARATE:
            raise InputError(
                "Alternatives are separate curves. Set Output to Curve or Sticky Curves, or set "
                "Alternatives to 0"
            )
        corners = selection.given_corners(self.corners, len(points))
        further = {
            "alternatives": alternatives,
            "corners": design_request.corner_indices(corners),
        }
        return [replace(request, options={**request.options, **further})]

    def _control_points(
        self, mesh_object: bpy.types.Object, surface: Surface
    ) -> "tuple[np.ndarray | SurfacePoints, str]":
        if self.points and self.point_group:
            raise InputError(
                "points and point_group both define the control points. Give only one of them"
            )
        if self.points:
            return selection.given_points(surface, self.points, self.order)
        if self.point_group:
            vertices, order = selection.points_of_group(mesh_object, self.point_group, self.order)
        else:
            vertices, order = selection.selected_points(mesh_object, self.order)
        return selection.points_at(surface, vertices), order

    def finish(
        self, context: bpy.types.Context, requests: list[DesignRequest], answers: "list[Answer]"
    ) -> set[str]:
        from ... import nicmm_core as nicmm

        (request,), (design,) = requests, answers
        if isinstance(design, Exception):
            raise design
        if not design.curves:
            raise InputError(str(design.status))
        mesh_object = request.mesh_object()
        for each in design.alternatives[::-1]:
            # An alternative is not meant to be together with the fairest curve.
            chosen = replace(request.settings, avoid_others=False)
            self._write(context, replace(request, settings=chosen, others=()), each)
        result = self._write(context, request, design)  # the last one is active
        if design.alternatives:
            count = 1 + len(design.alternatives)
            curve_order.reverse(curve_record.designed_on(mesh_object)[-count:])
        selected = not (self.points or self.point_group)
        order = ORDER_NAMES[request.order, selected]
        summary = f"{_summary(mesh_object, design, order, request)}: {result}"
        summary += asymmetry_text(context.scene, request.surface, design)
        if ignored := _other_selections():
            self.report({"WARNING"}, ignored)
        if design.repairs:
            summary += f"; repaired for the curve: {_repairs_text(design.repairs)}"
        if _alternatives(self):
            summary += f"; {counted(len(design.alternatives), 'alternative')}"
        if design.status == nicmm.Status.CONVERGED:
            self.report({"INFO"}, summary)
        else:
            self.report({"WARNING"}, f"{summary}; {design.status}")
        return {"FINISHED"}

    def _write(self, context: bpy.types.Context, request: DesignRequest, design: "Design") -> str:
        """Make the output of a design, and return a summary."""
        return writing.apply(
            context,
            request.mesh_object(),
            request.surface,
            design.curves,
            self,
            request.settings,
            design_request.corners_of(request, design),
            request.via,
            request.mirror,
            request.others,
        )


def _alternatives(operator: NICMM_OT_design_curve) -> int:
    """Number of alternatives; the setting has no effect with other methods."""
    return operator.alternatives if operator.method == "ELASTIC" else 0


def _summary(
    mesh_object: bpy.types.Object, design: "Design", order: str, request: DesignRequest
) -> str:
    points = counted(len(request.points), "control point")
    if request.mirror is not None:
        order += ", with mirror images" if request.mirror.joined else ", with its mirror image"
    summary = f"Curve through {points} {order}, {design.seconds:.1f} s"
    shown = "" if request.settings.use_modifiers else active_modifiers_text(mesh_object)
    return f"{summary}, on the mesh without its {shown}" if shown else summary


def _repairs_text(repairs: dict[str, int]) -> str:
    """What was repaired, such as "vertices joined (40), faces turned (12)"."""
    return ", ".join(f"{repair} ({number:,})" for repair, number in repairs.items())


def _other_selections() -> str:
    """A warning if other meshes in Edit Mode have selected vertices; empty if none has."""
    context = bpy.context
    names = [
        f'"{other.name}"'
        for other in context.objects_in_mode_unique_data
        if other != context.object and other.type == "MESH" and other.data.total_vert_sel
    ]
    if context.mode != "EDIT_MESH" or not names:
        return ""
    return f"The vertices selected on {', '.join(names)} are ignored: a curve lies on one mesh"


def register() -> None:
    bpy.utils.register_class(NICMM_OT_design_curve)


def unregister() -> None:
    bpy.utils.unregister_class(NICMM_OT_design_curve)
