# SPDX-License-Identifier: GPL-3.0-or-later
"""The base of the operators that change single control points."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

import bpy
import numpy as np

from ..operators import polls
from ..operators.asymmetry_report import asymmetry_text
from ..operators.long_solves import LongSolves
from ..outputs import edited_curve
from ..outputs.edited_curve import Opened
from ..outputs.writing import SEPARATE
from ..scene import curve_record, mirror_images, point_lists
from ..scene.control_points import ControlPoints
from ..scene.design_request import DesignRequest
from ..scene.messages import InputError
from . import modes

if TYPE_CHECKING:
    from ...nicmm_core import SurfacePoints
    from ..scene.design_request import Answer
    from ..scene.via_points import ViaPoints


class ChangesPoints(LongSolves):
    """A mixin for operators that change control points: designs the curve through the new ones.

    `dragged` is the position of a dragged point, as a point of the core, or None in a script.
    """

    searches_course = False
    """Whether the change selects a course, which is searched for; otherwise the curve keeps its."""

    snaps = True
    """Whether a dragged point snaps to curves that the curve avoids."""

    curve: str
    index: int
    position: Sequence[float]
    from_mouse: bool
    image: bool
    """Properties of the operators; each has those that it needs."""

    IMAGE = bpy.props.BoolProperty(
        name="Mirror Image",
        description="The position is that of the mirror image of the point",
        default=False,
        options={"SKIP_SAVE", "HIDDEN"},
    )

    if TYPE_CHECKING:  # Blender evaluates annotations of operators without loading the core
        dragged: SurfacePoints | None
    dragged = None

    def changed(self, opened: Opened) -> ControlPoints:
        """The control points after the change."""
        return opened.points

    def changed_via(self, opened: Opened) -> ViaPoints:
        """The via points after the change."""
        return opened.via

    def edited(self, opened: Opened) -> Opened:
        """The curve after the change, before it is designed."""
        curve = None if self.searches_course else opened.curve
        via = self.changed_via(opened)
        points = edited_curve.snapped(opened, self.changed(opened))
        return replace(opened, points=points, via=via, curve=curve)

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        has_mesh = curve_record.mesh_of_context(context) is not None
        return polls.usable(cls, context, has_mesh, polls.NO_MESH_OR_CURVE, polls.TOOL)

    def requests(self, context: bpy.types.Context) -> list[DesignRequest]:
        self._edited = self.edited(self.open_curve(context))
        return edited_curve.request(self._edited, self._edited.points)

    def open_curve(self, context: bpy.types.Context) -> Opened:
        """Open the curve to change."""
        edited = edited_curve.chosen(context, self.curve)
        if edited is None:
            raise InputError(polls.NO_CURVE)
        return edited_curve.open_curve(context, edited)

    def finish(
        self, context: bpy.types.Context, _requests: list[DesignRequest], answers: list[Answer]
    ) -> set[str]:
        curves, remark = edited_curve.curves_of(answers), self._edited.remark
        for answer in answers:
            design = edited_curve.design_of(answer)
            remark += asymmetry_text(context.scene, self._edited.surface, design)
        panel = context.scene.nicmm_curves
        edited = self._edited
        result = edited_curve.write(context, edited, edited.points, curves, _Output(panel))
        modes.make_active(context, result)
        self.changed_curves = (result.session_uid,)
        if remark:
            count = len(edited.points)
            kind = {"WARNING"} if edited.remark else {"INFO"}
            self.report(kind, f'"{result.name}" through {count} points{remark}')
        return {"FINISHED"}

    def checked_index(self, opened: Opened) -> int:
        """The index of the control point; an error if there is no such point."""
        count = len(opened.points)
        if not 0 <= self.index < count:
            raise InputError(
                f"There is no control point {self.index}; the curve has {count}, counted from 0"
            )
        return self.index

    def checked_via_index(self, opened: Opened) -> int:
        """The index of the via point; an error if there is no such point."""
        count = len(opened.via)
        if not 0 <= self.index < count:
            raise InputError(
                f"There is no via point {self.index}; the curve has {count}, counted from 0"
            )
        return self.index

    def place(self, opened: Opened, moved: int | None = None) -> SurfacePoints:
        """The position of the new or moved point on the surface, as a point of the core.

        It is on the side of the other control points if the curve is joined to its mirror image.
        `moved` is the index of a control point that moves there.
        """
        place = self._place(opened)
        if opened.mirror is None:
            return place
        if getattr(self, "image", False):
            place = mirror_images.reflected(opened.surface, opened.mirror, place)
        if not opened.mirror.joined:
            return place
        others = opened.points.places
        if moved is not None:
            others = point_lists.without_point(others, moved)
        return mirror_images.on_given_side(opened.surface, opened.mirror, place, others)

    def _place(self, opened: Opened) -> SurfacePoints:
        """The position that is given, or under the mouse."""
        if self.dragged is not None:
            return self.dragged
        given = np.array([self.position[:]], dtype=float)
        if self.from_mouse:  # the redo panel after a click, where any position can be entered
            return edited_curve.nearest_surface_points(opened, given)
        return edited_curve.surface_points_at(opened, given, "position")


class _Output:
    """The output settings of the sidebar for a new object, limited to outputs of the tool."""

    def __init__(self, panel: bpy.types.PropertyGroup) -> None:
        self.output: str = panel.output if panel.output in SEPARATE else "CURVE"
        self.spline: str = panel.spline
        self.radius: float = panel.radius
        self.thickness: float = panel.thickness
        self.offset: float = panel.offset
        self.tube: bool = panel.tube
