# SPDX-License-Identifier: GPL-3.0-or-later
"""The curves that were designed on a mesh: their list, and designing them again."""

import bpy
from bpy.props import BoolProperty, IntProperty, StringProperty

from . import curve_object, curve_record, design_request, mesh_data, outputs
from .edit_operator import NICMM_OT_edit_curve
from .long_solves import LongSolves

ICONS = {"CURVE": "OUTLINER_OB_CURVE", "CURVES": "OUTLINER_OB_CURVES"}
EDIT_ICON = "EDITMODE_HLT"
UPDATE_ICON = "FILE_REFRESH"


class NICMM_OT_update_curves(LongSolves, bpy.types.Operator):
    """Design curves again with their own settings, on the mesh and its weights as they are now"""

    bl_idname = "nicmm.update_curves"
    bl_label = "Update Curves"
    bl_options = {"REGISTER", "UNDO"}

    curve: StringProperty(
        name="Curve",
        description="Name of a designed curve. Without one, all curves on the mesh are updated",
        options={"SKIP_SAVE"},
    )
    use_panel: BoolProperty(
        name="Settings of the Panel",
        description="Use the settings in the sidebar from now on, not those that each curve has",
        default=False,
    )

    @classmethod
    def poll(cls, context):
        if mesh_of_context(context) is None:
            cls.poll_message_set("Make a mesh active, or a curve that was designed on one")
            return False
        return True

    def requests(self, context) -> list:
        curves = self._curves(context)
        for designed in curves:
            check_replaceable(designed)
        self._names = [designed.name for designed in curves]
        chosen = None
        if self.use_panel:
            chosen = curve_record.asked_by(context.scene.nicmm_curves)
        return [request_again(designed, chosen) for designed in curves]

    def _curves(self, context) -> list:
        if self.curve:
            return [named(self.curve)]
        mesh_object = mesh_of_context(context)
        curves = curve_record.designed_on(mesh_object)
        if not curves:
            raise mesh_data.InputError(
                f'No curve was designed on "{mesh_object.name}". Select vertices and run '
                "Design Curve on Surface"
            )
        return curves

    def finish(self, _context, requests: list, answers: list) -> set:
        failed = []
        for name, request, answer in zip(self._names, requests, answers, strict=True):
            try:
                replace(named(name), request, answer)
            except mesh_data.InputError as error:
                failed.append(f'"{name}": {error}')
        if len(failed) == len(requests):
            raise mesh_data.InputError("; ".join(failed))
        done = f"{len(requests) - len(failed)} of {len(requests)} curves updated"
        moved = sum(request.moved for request in requests)
        if moved:
            failed.append(f"{moved} control points lay on triangles that are gone and were moved")
        if failed:
            self.report({"WARNING"}, f"{done}; {'; '.join(failed)}")
        else:
            self.report({"INFO"}, done)
        return {"FINISHED"}


def mesh_of_context(context):
    """The mesh whose curves are meant: the active one, or that of the active designed curve."""
    active = context.active_object
    if curve_record.has_record(active):
        return curve_record.mesh_of(active)
    return mesh_data.mesh_object(context)


def named(name: str):
    """A designed curve by its name."""
    found = bpy.data.objects.get(name)
    if not curve_record.has_record(found):
        raise mesh_data.InputError(
            f'There is no designed curve "{name}". Choose one from the list of curves'
        )
    return found


def check_replaceable(designed) -> None:
    """Refuse a curve object whose points cannot be replaced."""
    library = designed.library or designed.data.library
    if library is not None:
        raise mesh_data.InputError(
            f'"{designed.name}" is linked from {library.filepath}. '
            "Make it local (Object > Relations > Make Local)"
        )
    if designed.mode != "OBJECT":
        raise mesh_data.InputError(
            f'"{designed.name}" is being edited. Switch to Object Mode first'
        )


def request_again(designed, chosen=None):
    """A request for a curve once more, with its own settings or others."""
    mesh_object = curve_record.mesh_of(designed)
    if mesh_object is None:
        raise mesh_data.InputError(
            f'The mesh that "{designed.name}" was designed on is gone. Draw the curve again'
        )
    mesh_data.synchronise(mesh_object)
    surface = mesh_data.triangles(mesh_object)
    asked = curve_record.asked_of(designed) if chosen is None else chosen
    return design_request.for_curve(designed, mesh_object, surface, asked)


def replace(designed, request, answer) -> None:
    """Give a curve object the curve that has been found."""
    if isinstance(answer, Exception):
        raise mesh_data.InputError(str(answer)) from answer
    if not answer.curves:
        raise mesh_data.InputError(str(answer.status))
    outputs.redraw(designed, request.surface, answer.curves)
    curve_record.remember(
        designed, request.mesh_object(), request.surface, answer.curves, request.asked
    )


class NICMM_UL_curves(bpy.types.UIList):
    """All objects of the file, of which the list shows the curves on one mesh"""

    def draw_item(self, _context, layout, _data, item, _icon, _active_data, _active_name):
        row = layout.row(align=True)
        row.prop(item, "name", text="", emboss=False, icon=ICONS.get(item.type, "OBJECT_DATA"))
        edit = row.operator(NICMM_OT_edit_curve.bl_idname, text="", icon=EDIT_ICON, emboss=False)
        edit.curve = item.name
        update = row.operator(
            NICMM_OT_update_curves.bl_idname, text="", icon=UPDATE_ICON, emboss=False
        )
        update.curve = item.name
        row.prop(item, "hide_viewport", text="", emboss=False)

    def filter_items(self, context, data, name):
        shown = set(curve_record.designed_on(mesh_of_context(context)))
        objects = getattr(data, name)
        wanted = self.filter_name.casefold()
        flags = [
            self.bitflag_filter_item if found in shown and wanted in found.name.casefold() else 0
            for found in objects
        ]
        return flags, []


def _active_index(_window_manager) -> int:
    """Where the active object is among all objects: the list follows the viewport."""
    active = bpy.context.active_object
    return -1 if active is None else bpy.data.objects.find(active.name)


def _activate(_window_manager, index: int) -> None:
    """Make an object active, as a click on it does; in other modes the mesh must stay active."""
    context = bpy.context
    if context.mode == "OBJECT" and index < len(bpy.data.objects):
        chosen = bpy.data.objects[index]
        if chosen.visible_get():
            curve_object.select_only(context, chosen)


def draw(layout, context) -> None:
    """Draw the list and its buttons."""
    layout.template_list(
        NICMM_UL_curves.__name__, "", bpy.data, "objects", context.window_manager,
        "nicmm_active_curve", rows=3,
    )  # fmt: skip
    row = layout.row(align=True)
    row.operator(NICMM_OT_update_curves.bl_idname, icon=UPDATE_ICON)
    row.prop(context.scene, "nicmm_live_update", text="Live", toggle=True, icon="PLAY")


CLASSES = (NICMM_OT_update_curves, NICMM_UL_curves)


def register() -> None:
    for found in CLASSES:
        bpy.utils.register_class(found)
    bpy.types.WindowManager.nicmm_active_curve = IntProperty(
        name="Active Curve",
        description="The curve that is active in the viewport",
        get=_active_index,
        set=_activate,
        options={"SKIP_SAVE"},
    )


def unregister() -> None:
    del bpy.types.WindowManager.nicmm_active_curve
    for found in reversed(CLASSES):
        bpy.utils.unregister_class(found)
