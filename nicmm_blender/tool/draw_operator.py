# SPDX-License-Identifier: GPL-3.0-or-later
"""The operator that each click of the tool runs: it calls the one for what is under the mouse."""

from collections.abc import Callable

import bpy

from ..operators.error_reports import called, with_error_reports
from ..operators.sliced_operator import SlicedOperator
from ..scene import surface_cache
from ..scene.messages import InputError
from . import modes, picking
from .picking import Kind

PASS = {"PASS_THROUGH"}


class NICMM_OT_draw_on_surface(SlicedOperator[bool], bpy.types.Operator):
    """Add a point to the designed curve, move or insert one, or activate the curve under the mouse

    The first click on a large mesh prepares the mesh in time slices before it acts.
    """

    bl_idname = "nicmm.draw_on_surface"
    bl_label = "Surface Curve"
    bl_description = (
        "Add a point to the designed curve, move or insert one, or activate the curve under the "
        "mouse"
    )
    bl_options = {"INTERNAL"}

    remove: bpy.props.BoolProperty(
        name="Remove",
        description="Remove the point or the via point under the mouse instead; elsewhere on the "
        "surface, invert snapping",
        default=False,
        options={"SKIP_SAVE"},
    )
    via: bpy.props.BoolProperty(
        name="Via Point",
        description="Add a via point to the active curve under the mouse, or move one, instead",
        default=False,
        options={"SKIP_SAVE"},
    )

    def invoke(self, context: bpy.types.Context, event: bpy.types.Event) -> set[str]:
        if context.mode not in modes.TOOLS or not picking.is_view(context):
            return PASS
        return with_error_reports(self, lambda: self._invoke(context, event))

    def _invoke(self, context: bpy.types.Context, event: bpy.types.Event) -> set[str]:
        mesh_object, curve = picking.mesh_and_curve(context)
        if mesh_object is None:
            return PASS
        self._pixel, self._is_down = picking.pixel_of(event), True
        self._view = context.region_data.perspective_matrix.copy()
        context.window.cursor_modal_set("WAIT")
        try:
            surface = picking.surface_for(context, mesh_object, curve)
        finally:
            context.window.cursor_modal_restore()
        if surface_cache.is_prepared(surface):
            return self._act(context)
        return self.work_on(context, lambda progress: surface_cache.prepare(surface, progress))

    def modal(self, context: bpy.types.Context, event: bpy.types.Event) -> set[str]:
        if event.type == "LEFTMOUSE" and event.value == "RELEASE":
            self._is_down = False
        return super().modal(context, event)

    def done(self, context: bpy.types.Context, _result: bool) -> set[str]:
        """Do what the click was for."""
        if not self.is_sliced:
            return self._act(context)
        view = context.region_data
        if view is None or view.perspective_matrix != self._view:
            self.report({"INFO"}, "The view has changed since the click. Click again")
            return {"CANCELLED"}
        result = self._act(context)
        return {"CANCELLED"} if result == PASS else result  # the event has not been passed on

    def progress_text(self) -> str:
        return "Preparing the mesh"

    def _act(self, context: bpy.types.Context) -> set[str]:
        hit = picking.under_mouse(context, self._pixel, inverted=self.remove)
        if hit is None:
            return PASS
        if not (self.remove or self.via):
            stroke = _call_of_action(context.scene.nicmm_curves.tool_action, hit)
            if stroke is not None:
                operator, arguments = stroke
                return called(self, operator, "INVOKE_DEFAULT", **arguments)
        call = _call_of(hit, self.remove, self.via)
        if call is None:
            return PASS
        operator, arguments = call
        if "from_mouse" in arguments:
            arguments["from_mouse"] = self._is_down
        return called(self, operator, "INVOKE_DEFAULT", **arguments)


def _call_of_action(
    action: str, hit: picking.Hit
) -> tuple[Callable[..., set[str]], dict[str, object]] | None:
    """The operator for a stroke, or for a curve along a feature; None for single points."""
    beside = {Kind.SURFACE, Kind.JUNCTION, Kind.CURVE}
    if action == "FREEHAND" and hit.kind in beside | {Kind.LINE}:
        return bpy.ops.nicmm.draw_stroke, {}
    if action == "FEATURE" and hit.kind in beside:
        return bpy.ops.nicmm.feature_curve, {"position": hit.position}
    return None


def _call_of(
    hit: picking.Hit, remove: bool, via: bool
) -> tuple[Callable[..., set[str]], dict[str, object]] | None:
    """The operator for what is under the mouse, with its arguments; None if there is none."""
    calls = bpy.ops.nicmm
    if remove:
        removals = {Kind.POINT: calls.remove_point, Kind.VIA: calls.remove_via_point}
        if hit.kind in removals:
            return removals[hit.kind], {"curve": hit.name, "index": hit.index}
        if hit.kind not in {Kind.SURFACE, Kind.JUNCTION}:
            return None
    named = {"curve": hit.name, "position": hit.position, "from_mouse": True}
    if hit.kind is Kind.VIA:
        return calls.move_via_point, {**named, "index": hit.index}
    if hit.kind in {Kind.POINT, Kind.LINE}:
        named["image"] = hit.is_image
    if via:
        if hit.kind is not Kind.LINE:
            return None
        if not hit.index:
            raise InputError(
                "The leg from the first point to its mirror image has no via points. Drag from "
                "another leg"
            )
        return calls.add_via_point, {**named, "leg": hit.index - 1}
    if hit.kind is Kind.CURVE:
        return calls.activate_curve, {"curve": hit.name}
    if hit.kind in {Kind.SURFACE, Kind.JUNCTION}:
        return calls.add_point, named
    operator = calls.move_point if hit.kind is Kind.POINT else calls.insert_point
    return operator, {**named, "index": hit.index}


def register() -> None:
    bpy.utils.register_class(NICMM_OT_draw_on_surface)


def unregister() -> None:
    bpy.utils.unregister_class(NICMM_OT_draw_on_surface)
