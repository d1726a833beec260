# SPDX-License-Identifier: GPL-3.0-or-later
"""The operator that converts a designed curve to another output."""

import bpy
from bpy.props import BoolProperty

from .. import settings
from ..outputs import curve_object, writing
from ..scene import curve_record, mesh_data
from ..scene.messages import InputError
from . import polls
from .long_solves import with_error_reports


class NICMM_OT_convert_curve(settings.OutputProperties, bpy.types.Operator):
    """Convert a designed curve to another object, or to edges, a region or parts of its mesh"""

    bl_idname = "nicmm.convert_curve"
    bl_label = "Convert Designed Curve"
    bl_options = {"REGISTER", "UNDO"}

    keep_original: BoolProperty(
        name="Keep Original",
        description="Keep the original curve object",
        default=False,
    )

    @classmethod
    def poll(cls, context):
        # Outputs that change the mesh make it active. The redo panel exists only if the operator
        # could run then, although Blender undoes it first.
        active = context.active_object
        can_run = curve_record.has_record(active) or mesh_data.mesh_object(context) is not None
        return polls.usable(cls, context, can_run, polls.NO_CURVE, polls.OBJECT)

    def draw(self, context):
        settings.draw_output(self.layout, self)
        self.layout.prop(self, "keep_original")

    def invoke(self, context, _event):
        settings.choose_tube(self)
        return self.execute(context)

    def execute(self, context):
        return with_error_reports(self, lambda: self._execute(context))

    def _execute(self, context):
        original = context.active_object
        if not curve_record.has_record(original):
            raise InputError(polls.NO_CURVE)
        name = original.name
        mesh_object = curve_record.mesh_in_view_layer(context, original)
        mesh_data.synchronise(mesh_object)
        surface = curve_record.surface_of(original, mesh_object)
        curves = curve_record.read_curves(original, surface)
        curve_settings = curve_record.settings_of(original)
        summary = writing.apply(context, mesh_object, surface, curves, self, curve_settings)
        if not self.keep_original:
            curve_object.remove(original)
        if self.output not in writing.SEPARATE:
            curve_object.select_only(context, mesh_object)
        self.report({"INFO"}, f'"{name}": {summary}')
        return {"FINISHED"}


def register() -> None:
    bpy.utils.register_class(NICMM_OT_convert_curve)


def unregister() -> None:
    bpy.utils.unregister_class(NICMM_OT_convert_curve)
