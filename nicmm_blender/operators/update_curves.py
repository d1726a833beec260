# SPDX-License-Identifier: GPL-3.0-or-later
"""The operator that designs the curves of a mesh again."""

from collections.abc import Callable
from functools import cache
from typing import TYPE_CHECKING

import bpy
from bpy.props import BoolProperty, StringProperty

from ..outputs import writing
from ..scene import curve_record, design_request, mesh_data
from ..scene.curve_record import CurveSettings
from ..scene.design_request import DesignRequest
from ..scene.messages import InputError, counted
from ..scene.surface import Surface, read
from . import polls
from .long_solves import LongSolves

if TYPE_CHECKING:
    from ..scene.design_request import Answer


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
    def poll(cls, context: bpy.types.Context) -> bool:
        if curve_record.mesh_of_context(context) is None:
            cls.poll_message_set(polls.NO_MESH_OR_CURVE)
            return False
        return True

    def requests(self, context: bpy.types.Context) -> list[DesignRequest]:
        chosen = None
        if self.use_panel:
            chosen = curve_record.settings_from(context.scene.nicmm_curves)
        requests, self._names, self._failed = [], [], []
        read_once = cache(read)  # several curves may lie on the same surface
        for designed in self._curves(context):
            try:
                writing.check_replaceable(designed)
                requests.append(_request_again(designed, chosen, read_once))
                self._names.append(designed.name)
            except InputError as error:
                self._failed.append((designed.name, str(error)))
        if not requests:
            raise InputError("; ".join(message for _, message in self._failed))
        return requests

    def _curves(self, context: bpy.types.Context) -> list[bpy.types.Object]:
        """The curve with the given name, or all curves on the mesh without unfinished drawings."""
        if self.curve:
            return [named(self.curve)]
        mesh_object = curve_record.mesh_of_context(context)
        if mesh_object is None:
            raise InputError(polls.NO_MESH_OR_CURVE)
        curves = curve_record.designed_on(mesh_object)
        if not curves:
            raise InputError(
                f'No curve was designed on "{mesh_object.name}". Select vertices and run '
                "Design Curve on Surface"
            )
        return [each for each in curves if not curve_record.is_unfinished(each)] or curves

    def finish(
        self, _context: bpy.types.Context, requests: list[DesignRequest], answers: "list[Answer]"
    ) -> set[str]:
        total = len(requests) + len(self._failed)
        for name, request, answer in zip(self._names, requests, answers, strict=True):
            try:
                updated = named(name)
                writing.replace(updated, request, answer)
                if self.curve:  # otherwise all curves are updated anyway
                    self.changed_curves = (updated.session_uid,)
            except InputError as error:
                self._failed.append((name, str(error)))
        remarks = [f'"{name}": {message}' for name, message in self._failed]
        if len(self._failed) == total:
            raise InputError("; ".join(remarks))
        done = f"{total - len(self._failed)} of {counted(total, 'curve')} updated"
        moved = sum(request.moved for request in requests)
        if moved:
            remarks.append(
                f"{counted(moved, 'control point')} moved to the nearest positions, because their "
                "triangles no longer exist"
            )
        if remarks:
            self.report({"WARNING"}, f"{done}; {'; '.join(remarks)}")
        else:
            self.report({"INFO"}, done)
        return {"FINISHED"}


def named(name: str) -> bpy.types.Object:
    """Return the designed curve with a name, or raise an error if there is none."""
    found = bpy.data.objects.get(name)
    if not curve_record.has_record(found):
        raise InputError(f'There is no designed curve "{name}". Choose one in the list of curves')
    return found


def _request_again(
    designed: bpy.types.Object, chosen: CurveSettings | None, read_once: Callable[..., Surface]
) -> DesignRequest:
    """A request to design a curve again, with its recorded settings or with `chosen`.

    `read_once` is a cached `surface.read`.
    """
    mesh_object = curve_record.mesh_in_any_scene(designed)
    settings = curve_record.settings_of(designed) if chosen is None else chosen
    mesh_data.synchronise(mesh_object)
    surface = read_once(mesh_object, settings.use_modifiers)
    return design_request.for_curve(designed, mesh_object, surface, settings)


def register() -> None:
    bpy.utils.register_class(NICMM_OT_update_curves)


def unregister() -> None:
    bpy.utils.unregister_class(NICMM_OT_update_curves)
