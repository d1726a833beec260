# SPDX-License-Identifier: GPL-3.0-or-later
"""The operator that each click of the tool runs: it calls the one for what is under the mouse."""

import bpy

from ..operators import long_solves, time_slices
from ..operators.long_solves import LONGEST_TIME_SLICE, PASSED_ON, with_error_reports
from ..operators.viewports import redraw
from ..scene import designers
from . import modes, picking
from .picking import Kind

PASS = {"PASS_THROUGH"}


class NICMM_OT_draw_on_surface(bpy.types.Operator):
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
        description="Remove the point under the mouse instead",
        default=False,
        options={"SKIP_SAVE"},
    )

    def invoke(self, context, event):
        if context.mode not in modes.TOOLS or not picking.is_view(context):
            return PASS
        return with_error_reports(self, lambda: self._invoke(context, event))

    def _invoke(self, context, event):
        mesh_object, curve = picking.mesh_and_curve(context)
        if mesh_object is None:
            return PASS
        self._pixel, self._is_down = picking.pixel_of(event), True
        if picking.is_ready(context, mesh_object, curve):
            return self._act(context)
        self._work, self._surface = None, None
        self._slices, self._view = 0, context.region_data.perspective_matrix.copy()
        self._timer = context.window_manager.event_timer_add(0.02, window=context.window)
        context.window_manager.modal_handler_add(self)
        long_solves.note_running(self)
        self._show(context)
        return {"RUNNING_MODAL"}

    def modal(self, context, event):
        if event.type == "ESC" and event.value == "PRESS":
            self.cancel(context)
            return {"CANCELLED"}
        if event.type == "LEFTMOUSE" and event.value == "RELEASE":
            self._is_down = False
        if event.type == "TIMER":
            try:
                result = with_error_reports(self, lambda: self._prepare(context))
            except Exception:
                self.cancel(context)
                raise
            if result & {"FINISHED", "CANCELLED"}:
                self.cancel(context)
            return result
        return PASS if event.type in PASSED_ON else {"RUNNING_MODAL"}

    def cancel(self, context):
        """Stop the preparation; also called by Blender when it opens another file or quits."""
        if self._work is not None:
            self._work.cancel()
        self._tidy(context)

    def _prepare(self, context):
        """Work for one time slice; after the last one, do what the click was for."""
        mesh_object, curve = picking.mesh_and_curve(context)
        if mesh_object is None:
            return {"CANCELLED"}
        self._slices += 1
        if self._slices == 1:
            return PASS  # so that the message is drawn before the mesh is read
        if self._surface is None:
            self._surface = surface = picking.surface_for(context, mesh_object, curve)
            self._work = time_slices.Work(
                lambda progress: designers.prepare(surface.core_positions, surface.faces, progress)
            )
        elif self._work.run_slice(LONGEST_TIME_SLICE):
            self._work.result()
            self._tidy(context)
            view = context.region_data
            if view is None or view.perspective_matrix != self._view:
                self.report({"INFO"}, "The view has changed since the click. Click again")
                return {"CANCELLED"}
            result = self._act(context)
            return {"CANCELLED"} if result == PASS else result  # the event has not been passed on
        self._show(context)
        return PASS

    def _show(self, context) -> None:
        what = "Reading the mesh" if self._surface is None else "Preparing the mesh"
        context.workspace.status_text_set(f"{self.bl_label}: {what}   |   Esc: Cancel")
        redraw()

    def _tidy(self, context) -> None:
        if self._timer is not None:
            context.window_manager.event_timer_remove(self._timer)
            self._timer = None
            long_solves.note_ended(self)
            context.workspace.status_text_set(None)

    def _act(self, context):
        hit = picking.under_mouse(context, self._pixel)
        if hit is None:
            return PASS
        call = _call_of(hit, self.remove)
        if call is None:
            return PASS
        operator, arguments = call
        if "from_mouse" in arguments:
            arguments["from_mouse"] = self._is_down
        try:
            operator("INVOKE_DEFAULT", True, **arguments)
        except RuntimeError as error:  # Blender raises what the operator has reported
            self.report({"ERROR"}, str(error).removeprefix("Error: ").strip())
            return {"CANCELLED"}
        return {"FINISHED"}


def _call_of(hit, remove: bool) -> tuple | None:
    """The operator for what is under the mouse, with its arguments; None if there is none."""
    calls = bpy.ops.nicmm
    if remove:
        if hit.kind is not Kind.POINT:
            return None
        return calls.remove_point, {"curve": hit.name, "index": hit.index}
    if hit.kind is Kind.CURVE:
        return calls.activate_curve, {"curve": hit.name}
    named = {"curve": hit.name, "position": hit.position, "from_mouse": True}
    if hit.kind is Kind.SURFACE:
        return calls.add_point, named
    operator = calls.move_point if hit.kind is Kind.POINT else calls.insert_point
    return operator, {**named, "index": hit.index}


def register() -> None:
    bpy.utils.register_class(NICMM_OT_draw_on_surface)


def unregister() -> None:
    bpy.utils.unregister_class(NICMM_OT_draw_on_surface)
