# SPDX-License-Identifier: GPL-3.0-or-later
"""The operator that moves a curve up or down in the list of the curves of its mesh."""

from collections.abc import Iterable

import bpy
from bpy.props import EnumProperty

from ..outputs import edited_curve
from ..scene import curve_order, curve_record, surface_cache
from ..scene.messages import InputError
from ..settings import CURVE
from . import polls
from .error_reports import with_error_reports
from .followers import follow_now


class NICMM_OT_move_curve(bpy.types.Operator):
    """Move the curve in the list. A curve can avoid the curves above it"""

    bl_idname = "nicmm.move_curve"
    bl_label = "Move Curve"
    bl_options = {"REGISTER", "UNDO"}

    curve: CURVE
    direction: EnumProperty(
        name="Direction",
        description="Where to move the curve",
        items=(
            ("UP", "Up", "Move the curve above the one before it"),
            ("DOWN", "Down", "Move the curve below the one after it"),
        ),
        options={"SKIP_SAVE"},
    )

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        has_mesh = curve_record.mesh_of_context(context) is not None
        return polls.usable(cls, context, has_mesh, polls.NO_MESH_OR_CURVE, polls.TOOL)

    @classmethod
    def description(
        cls, _context: bpy.types.Context, properties: bpy.types.OperatorProperties
    ) -> str:
        where = "up" if properties.direction == "UP" else "down"
        return f"Move the active curve {where} in the list. A curve can avoid the curves above it"

    def execute(self, context: bpy.types.Context) -> set[str]:
        return with_error_reports(self, lambda: self._execute(context))

    def _execute(self, context: bpy.types.Context) -> set[str]:
        moved = edited_curve.chosen(context, self.curve)
        mesh_object = None if moved is None else curve_record.mesh_of(moved)
        if moved is None or mesh_object is None:
            raise InputError(polls.NO_CURVE)
        curves = curve_record.designed_on(mesh_object)
        number = curves.index(moved)
        other = number + (-1 if self.direction == "UP" else 1)
        if not 0 <= other < len(curves):
            return {"CANCELLED"}
        curves[number], curves[other] = curves[other], curves[number]
        ranks = curve_order.new_ranks(curves)
        _check_local(ranks)
        for each, rank in ranks.items():
            curve_order.set_rank(each, rank)
        surface_cache.note_change()
        if remarks := follow_now(context, curves[min(number, other) :]):
            self.report({"WARNING"}, "; ".join(remarks))
        return {"FINISHED"}


def _check_local(curves: Iterable[bpy.types.Object]) -> None:
    """Raise an error if a curve is linked, so that Blender would not save its rank."""
    for each in curves:
        if each.library is not None:
            raise InputError(
                f'"{each.name}" is linked from {each.library.filepath}, so the order of the curves '
                "cannot change. Make it local (Object > Relations > Make Local)"
            )


def register() -> None:
    bpy.utils.register_class(NICMM_OT_move_curve)


def unregister() -> None:
    bpy.utils.unregister_class(NICMM_OT_move_curve)
