# SPDX-License-Identifier: GPL-3.0-or-later
"""The operator that designs the curves of a mesh again."""

import bpy
from bpy.props import BoolProperty, StringProperty

from ..outputs import writing
from ..scene import curve_record, design_request, mesh_data
from ..scene.messages import InputError, counted
from ..scene.surface import read
from . import polls
from .long_solves import LongSolves


class NICMM_OT_update_curves(LongSolves, bpy.types.Operator):
    """Design curves again with their own settings, on the current mesh and weights"""

    bl_idname = "nicmm.update_curves"
    bl_label = "Update Curves"
    bl_options = {"REGISTER", "UNDO"}

    curve: StringProperty(
        name="Curve",
        description="Name of a designed curve. Leave empty to update all curves on the mesh",
        options={"SKIP_SAVE"},
    )
    use_panel: BoolProperty(
        name="Use Sidebar Settings",
        description="Replace the settings of each curve with those in the sidebar",
        default=False,
        options={"SKIP_SAVE"},
    )

    @classmethod
    def poll(cls, context):
        if curve_record.mesh_of_context(context) is None:
            cls.poll_message_set(polls.NO_MESH_OR_CURVE)
            return False
        return True

    def requests(self, context) -> list:
        curves = self._curves(context)
        for designed in curves:
            writing.check_replaceable(designed)
        self._names = [designed.name for designed in curves]
        chosen = None
        if self.use_panel:
            chosen = curve_record.settings_from(context.scene.nicmm_curves)
        return [request_again(designed, chosen) for designed in curves]

    def _curves(self, context) -> list:
        if self.curve:
            return [named(self.curve)]
        mesh_object = curve_record.mesh_of_context(context)
        curves = curve_record.designed_on(mesh_object)
        if not curves:
            raise InputError(
                f'No curve was designed on "{mesh_object.name}". Select vertices and run '
                "Design Curve on Surface"
            )
        return curves

    def finish(self, _context, requests: list, answers: list) -> set:
        failed = []
        for name, request, answer in zip(self._names, requests, answers, strict=True):
            try:
                writing.replace(named(name), request, answer)
            except InputError as error:
                failed.append(f'"{name}": {error}')
        if len(failed) == len(requests):
            raise InputError("; ".join(failed))
        done = f"{len(requests) - len(failed)} of {counted(len(requests), 'curve')} updated"
        moved = sum(request.moved for request in requests)
        if moved:
            failed.append(f"{counted(moved, 'control point')} moved because triangles were deleted")
        if failed:
            self.report({"WARNING"}, f"{done}; {'; '.join(failed)}")
        else:
            self.report({"INFO"}, done)
        return {"FINISHED"}


def named(name: str):
    """Return the designed curve with a name, or raise an error if there is none."""
    found = bpy.data.objects.get(name)
    if not curve_record.has_record(found):
        raise InputError(f'There is no designed curve "{name}". Choose one in the list of curves')
    return found


def request_again(designed, chosen=None):
    """A request to design a curve again, with its recorded settings or with `chosen`."""
    mesh_object = curve_record.mesh_in_any_scene(designed)
    mesh_data.synchronise(mesh_object)
    settings = curve_record.settings_of(designed) if chosen is None else chosen
    surface = read(mesh_object, settings.use_modifiers)
    return design_request.for_curve(designed, mesh_object, surface, settings)


def register() -> None:
    bpy.utils.register_class(NICMM_OT_update_curves)


def unregister() -> None:
    bpy.utils.unregister_class(NICMM_OT_update_curves)
