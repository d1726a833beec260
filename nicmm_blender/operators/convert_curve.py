# SPDX-License-Identifier: GPL-3.0-or-later
"""The operator that converts a designed curve to another output."""

import bpy
from bpy.props import BoolProperty

from .. import settings
from ..outputs import curve_object, parallel_curves, tube_radius, writing
from ..scene import avoided_curves, curve_record, mesh_data, mirror_plane
from ..scene.messages import InputError, counted
from . import polls
from .error_reports import with_error_reports


class NICMM_OT_convert_curve(settings.OutputProperties, bpy.types.Operator):
    """Convert a designed curve to another object, or to edges, a region or parts of its mesh.

    Another object looks like the curve: settings of its appearance that are not given are those of
    the curve, and its name and materials are kept.
    """

    bl_idname = "nicmm.convert_curve"
    bl_label = "Convert Designed Curve"
    bl_description = (
        "Convert a designed curve to another object, or to edges, a region or parts of its mesh"
    )
    bl_options = {"REGISTER", "UNDO"}

    # Not remembered for the next curve, which has an appearance of its own.
    spline: settings.with_options(settings.output_property("spline"), {"SKIP_SAVE"})
    radius: settings.with_options(settings.output_property("radius"), {"SKIP_SAVE"})
    offset: settings.with_options(settings.output_property("offset"), {"SKIP_SAVE"})
    thickness: settings.with_options(settings.output_property("thickness"), {"SKIP_SAVE"})
    keep_original: BoolProperty(
        name="Keep Original",
        description="Keep the original curve object",
        default=False,
    )

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        # Outputs that change the mesh make it active. The redo panel exists only if the operator
        # could run then, although Blender undoes it first.
        active = context.active_object
        can_run = curve_record.has_record(active) or mesh_data.mesh_object(context) is not None
        return polls.usable(cls, context, can_run, polls.NO_CURVE, polls.OBJECT)

    def draw(self, context: bpy.types.Context) -> None:
        settings.draw_output(self.layout, self)
        row = self.layout.row()
        row.active = self.output != writing.PARALLEL  # which always keeps it
        row.prop(self, "keep_original")

    def invoke(self, context: bpy.types.Context, _event: bpy.types.Event) -> set[str]:
        settings.choose_tube(self)
        return self.execute(context)

    def execute(self, context: bpy.types.Context) -> set[str]:
        return with_error_reports(self, lambda: self._execute(context))

    def _execute(self, context: bpy.types.Context) -> set[str]:
        original = context.active_object
        if not curve_record.has_record(original):
            raise InputError(polls.NO_CURVE)
        name = original.name
        mesh_object = curve_record.mesh_in_view_layer(context, original)
        mesh_data.synchronise(mesh_object)
        surface = curve_record.surface_of(original, mesh_object)
        curves = curve_record.read_curves(original, surface)
        if self.output == writing.PARALLEL:
            found = parallel_curves.computed(surface, curves, self)
            parallel_curves.add(context, original, surface, found, self)
            self.report({"INFO"}, f'"{name}": {counted(len(found), "parallel curve")}')
            return {"FINISHED"}
        curve_settings = curve_record.settings_of(original)
        is_separate = self.output in writing.SEPARATE
        if is_separate:
            self._take_appearance(original, mesh_object)
        corners = curve_record.corners_of(original)
        via = curve_record.current_via_points(original, mesh_object, surface)
        mirror = mirror_plane.mirror_of(mesh_object, surface, curve_settings)
        others = avoided_curves.above(original, mesh_object, surface, curve_settings)
        summary = writing.apply(
            context,
            mesh_object,
            surface,
            curves,
            self,
            curve_settings,
            corners,
            via,
            mirror,
            others,
        )
        if is_separate:
            converted = context.active_object
            if not self.keep_original:
                curve_record.take_place_of(converted, original)
                parallel_curves.set_source(converted, original)
            curve_object.copy_materials(original, converted)
        if not self.keep_original:
            curve_object.remove(original)
            if is_separate:
                converted.name = name
        if not is_separate:
            curve_object.select_only(context, mesh_object)
        self.report({"INFO"}, f'"{name}": {summary}')
        return {"FINISHED"}

    def _take_appearance(self, original: bpy.types.Object, mesh_object: bpy.types.Object) -> None:
        """Take the settings of the appearance that are not given from the curve."""
        drawn = curve_record.drawn_as(original)
        radius = tube_radius.radius_of(original)
        radius *= curve_object.scale_in_scene(original, mesh_object)
        found: dict[str, str | float] = {"radius": radius}
        found |= {"spline": drawn["spline"], "offset": drawn["offset"]}
        if not radius:
            found["thickness"] = 0.0  # it would be used instead of a radius of zero
        is_set = self.properties.is_property_set
        if is_set("thickness") and not is_set("radius"):
            found["radius"] = 0.0
        for name, value in found.items():
            if not is_set(name):
                setattr(self, name, value)


def register() -> None:
    bpy.utils.register_class(NICMM_OT_convert_curve)


def unregister() -> None:
    bpy.utils.unregister_class(NICMM_OT_convert_curve)
