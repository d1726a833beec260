# SPDX-License-Identifier: GPL-3.0-or-later
"""The operators: a curve through the selected vertices, and other things made from a curve."""

import sys
from contextlib import contextmanager

import bpy

from . import curve_object, curve_record, designers, mesh_data, outputs, settings

ORDER_NAMES = {"given": "in the order of selection", "shortest": "in the shortest order"}


class NICMM_OT_design_curve(
    settings.DesignProperties, settings.OutputProperties, bpy.types.Operator
):
    """Draw a smooth curve on the surface of the mesh through its selected vertices"""

    bl_idname = "nicmm.design_curve"
    bl_label = "Design Curve on Surface"
    bl_options = {"REGISTER", "UNDO"}

    @classmethod
    def poll(cls, context):
        mesh_object = mesh_data.mesh_object(context)
        if mesh_object is None:
            cls.poll_message_set("Make a mesh object active")
            return False
        if context.mode not in {"OBJECT", "EDIT_MESH"}:
            cls.poll_message_set("Switch to Object Mode or Edit Mode")
            return False
        if context.mode == "EDIT_MESH" and not mesh_object.data.total_vert_sel:
            cls.poll_message_set("Select the vertices that the curve should pass through")
            return False
        return True

    def draw(self, context):
        settings.draw(self.layout, self, mesh_data.mesh_object(context))

    def execute(self, context):
        return reporting(self, lambda: self._execute(context))

    def _execute(self, context):
        from .. import nicmm_core as nicmm

        mesh_object = mesh_data.mesh_object(context)
        try:
            surface, order, design = self._design(context, mesh_object)
        except nicmm.UnreachableError as error:
            group = f' (obstacles: the vertex group "{self.obstacle_group}")'
            message = f"{error}{group if self.obstacle_group else ''}"
            raise mesh_data.InputError(message) from error
        if not design.curves:
            raise mesh_data.InputError(str(design.status))
        asked = curve_record.asked_by(self)
        made = outputs.apply(context, mesh_object, surface, design.curves, self, asked)
        summary = f"{_summary(mesh_object, design, order)}: {made}"
        if design.status == nicmm.Status.CONVERGED:
            self.report({"INFO"}, summary)
        else:
            self.report({"WARNING"}, f"{summary}; {design.status}")
        return {"FINISHED"}

    def _design(self, context, mesh_object):
        """Read the mesh and let the core draw; return the triangles, the order and the design."""
        mesh_data.synchronise(mesh_object)
        vertices, order = mesh_data.control_points(mesh_object, self.order)
        obstacles = mesh_data.group_weights(mesh_object, self.obstacle_group)
        alignment = mesh_data.group_weights(mesh_object, self.alignment_group)
        surface = mesh_data.triangles(mesh_object)
        with _progress(context) as progress:
            designer = designers.designer_for(surface.solved, surface.faces)
            # The same settings give the same curve, whatever was designed before.
            designer.forget()
            design = designer.design(
                vertices,
                closed=self.closed,
                order=order,
                method=self.method.lower().replace("_", "-"),
                obstacles=obstacles,
                alignment=alignment,
                clearance=0.0 if obstacles is None else self.clearance,
                smoothness=self.smoothness,
                progress=progress,
            )
        return surface, order, design


class NICMM_OT_convert_curve(settings.OutputProperties, bpy.types.Operator):
    """Turn a designed curve into another one, or into edges, a region or parts of its mesh"""

    bl_idname = "nicmm.convert_curve"
    bl_label = "Convert Designed Curve"
    bl_options = {"REGISTER", "UNDO"}

    keep_original: bpy.props.BoolProperty(
        name="Keep Original",
        description="Keep the curve object",
        default=False,
    )

    @classmethod
    def poll(cls, context):
        if not curve_record.has_record(context.active_object):
            cls.poll_message_set("Make a curve active that was designed on a mesh")
            return False
        if context.mode != "OBJECT":
            cls.poll_message_set("Switch to Object Mode")
            return False
        return True

    def draw(self, context):
        settings.draw_output(self.layout, self)
        self.layout.prop(self, "keep_original")

    def execute(self, context):
        return reporting(self, lambda: self._execute(context))

    def _execute(self, context):
        original = context.active_object
        name = original.name
        mesh_object = curve_record.present_mesh(context, original)
        surface = mesh_data.triangles(mesh_object)
        curves = curve_record.recall(original, surface)
        asked = curve_record.asked_of(original)
        made = outputs.apply(context, mesh_object, surface, curves, self, asked)
        if not self.keep_original:
            curve_object.remove(original)
        if self.output not in {"CURVE", "STICKY"}:
            curve_object.select_only(context, mesh_object)
        self.report({"INFO"}, f"{name}: {made}")
        return {"FINISHED"}


def reporting(operator, work):
    """Do an operator's work; what it cannot do becomes a report that says what would mend it."""
    try:
        from .. import nicmm_core as nicmm
    except ImportError as error:
        return _cancelled(
            operator,
            f"A library that NICMM Curves needs cannot be loaded ({error}). "
            "Install the zip that was made for this platform and this Blender",
        )
    try:
        return work()
    except nicmm.MissingPackageError as error:
        return _cancelled(
            operator,
            f"{error}. Blender's Python is {sys.executable}; a zip of NICMM Curves that was "
            "built with --with-torch brings PyTorch along",
        )
    except (mesh_data.InputError, nicmm.NicmmError) as error:
        return _cancelled(operator, str(error))


def _cancelled(operator, message: str):
    operator.report({"ERROR"}, message)
    return {"CANCELLED"}


def _summary(mesh_object, design, order: str) -> str:
    curve = design.curves[0]
    summary = (
        f"Curve through {len(curve.control_index)} vertices {ORDER_NAMES[order]}, "
        f"{design.seconds:.1f} s"
    )
    if any(modifier.show_viewport for modifier in mesh_object.modifiers):
        summary += ", on the mesh without its modifiers"
    return summary


@contextmanager
def _progress(context):
    """Show progress at the mouse pointer; gives the callable that the core reports to."""
    window_manager = context.window_manager
    window_manager.progress_begin(0.0, 1.0)
    try:
        yield lambda fraction, _polyline: window_manager.progress_update(fraction)
    finally:
        window_manager.progress_end()


def register() -> None:
    bpy.utils.register_class(NICMM_OT_design_curve)
    bpy.utils.register_class(NICMM_OT_convert_curve)


def unregister() -> None:
    bpy.utils.unregister_class(NICMM_OT_convert_curve)
    bpy.utils.unregister_class(NICMM_OT_design_curve)
