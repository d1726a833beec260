# SPDX-License-Identifier: GPL-3.0-or-later
"""The tool that edits a curve interactively: mouse and keys change an `edit_session`."""

import time
from dataclasses import replace

import bpy
import numpy as np

from .. import settings
from ..operators import polls, viewports
from ..operators.long_solves import reporting
from ..operators.viewports import NAVIGATION, WHEEL
from ..outputs.writing import SEPARATE
from ..scene import curve_record, designers, mesh_data
from ..scene.curve_record import Asked
from ..scene.messages import InputError
from ..scene.surface import read
from .edit_overlay import Overlay
from .edit_view import view_of
from .edited_curve import chosen, keep, open_session

INTERVAL = 1.0 / 60.0
"""Seconds between two steps of a curve that is converging."""

PAUSE = 0.15
"""Seconds without mouse movement before a dragged curve is designed from scratch."""

POINT_REACH, CURVE_REACH = 12.0, 8.0
"""Greatest distance of the mouse from a point and from the curve, in pixels at a scale of 1."""

PASSED_ON = NAVIGATION | {
    "HOME",
    "ACCENT_GRAVE",
    *(f"NUMPAD_{digit}" for digit in range(10)),
    "NUMPAD_PERIOD",
    "NUMPAD_PLUS",
    "NUMPAD_MINUS",
    "NUMPAD_SLASH",
}
"""Events that Blender handles, so that the view can be moved while editing."""

HINTS = (
    ("MOUSE_LMB", "Add, Move, Insert on the Curve"),
    ("EVENT_CTRL", ""),
    ("MOUSE_LMB", "Remove"),
    ("EVENT_C", "Closed or Open"),
    ("EVENT_O", "Obstacles"),
    ("EVENT_A", "Alignment"),
    ("EVENT_UP_ARROW", ""),
    ("EVENT_DOWN_ARROW", "Smoothness"),
    ("EVENT_CTRL", ""),
    ("EVENT_Z", "Undo"),
    ("EVENT_RETURN", "Keep"),
    ("EVENT_ESC", "Cancel"),
)


DRAWN = ("spline", "radius", "thickness", "offset")
"""Properties of a drawing that the tool shares with the sidebar."""

_OUTPUT = settings.OutputProperties.__annotations__


class NICMM_PG_control_point(bpy.types.PropertyGroup):
    """A control point, for scripts"""

    position: bpy.props.FloatVectorProperty(
        name="Position",
        description="Position on the surface in the object's local space",
        subtype="XYZ",
    )


class NICMM_OT_edit_curve(settings.EditingProperties, bpy.types.Operator):
    """Draw a curve on the surface of the mesh point by point, or edit a designed curve"""

    bl_idname = "nicmm.edit_curve"
    bl_label = "Draw Curve on Surface"
    bl_options = {"REGISTER", "UNDO"}

    output: bpy.props.EnumProperty(
        name="Output",
        description="Type of a new curve object",
        items=(
            ("CURVE", "Curve", "A curve object of polylines"),
            ("STICKY", "Sticky Curves", "A hair curves object that follows the mesh"),
        ),
        default="CURVE",
    )
    spline: _OUTPUT["spline"]
    radius: _OUTPUT["radius"]
    offset: _OUTPUT["offset"]
    thickness: _OUTPUT["thickness"]
    tube: _OUTPUT["tube"]
    curve: bpy.props.StringProperty(
        name="Curve Object",
        description="Name of the designed curve to edit. Leave empty to edit the active curve, or "
        "to draw a new one if a mesh is active",
        options={"SKIP_SAVE", "HIDDEN"},
    )
    points: bpy.props.CollectionProperty(
        name="Control Points",
        description="Control points of the curve, for scripts. Leave empty to keep its points",
        type=NICMM_PG_control_point,
        options={"SKIP_SAVE", "HIDDEN"},
    )
    at_mouse: bpy.props.BoolProperty(
        name="At Mouse",
        description="Begin with a click at the mouse position",
        default=False,
        options={"SKIP_SAVE", "HIDDEN"},
    )

    @classmethod
    def poll(cls, context):
        has_mesh = mesh_data.mesh_object(context) is not None
        return polls.usable(cls, context, has_mesh, polls.NO_MESH_OR_CURVE, polls.OBJECT_OR_EDIT)

    def draw(self, context):
        layout = self.layout
        layout.use_property_split = True
        layout.use_property_decorate = False
        mesh_object = mesh_data.mesh_object(context)
        for name in ("closed", "smoothness", "use_modifiers"):
            layout.prop(self, name)
        for name in ("obstacle_group", "alignment_group"):
            layout.prop_search(self, name, mesh_object, "vertex_groups")
        layout.prop(self, "clearance")
        if not self.curve:
            for name in ("output", *DRAWN):
                if name != "thickness" or not self.radius:
                    layout.prop(self, name)
            if self.output == "STICKY":
                layout.prop(self, "tube")

    # For scripts, and for the redo panel.

    def execute(self, context):
        return reporting(self, lambda: self._execute(context))

    def _execute(self, context):
        edited = chosen(context, self.curve)
        opened = open_session(context, edited, self._asked_for(context, edited))
        session = opened.session
        if len(self.points):
            session.set_points(np.array([point.position[:] for point in self.points]))
        elif edited is None:
            raise InputError(
                'There are no control points. Pass points=[{"name": "", "position": (x, y, '
                "z)}, …], or draw with the mouse in the 3D viewport"
            )
        session.converge()
        return self._keep(context, opened, edited)

    def _asked_for(self, context, edited) -> Asked:
        """The settings of the curve or the panel, with those set for this call."""
        if edited is None:
            asked = curve_record.asked_by(context.scene.nicmm_curves)
        else:
            asked = curve_record.asked_of(edited)
        given = {
            name: getattr(self, name)
            for name in settings.EditingProperties.__annotations__
            if self.properties.is_property_set(name)
        }
        return replace(asked, method="NICMM", **given)

    # In a window.

    def invoke(self, context, event):
        settings.choose_tube(self)
        if context.space_data is None or context.space_data.type != "VIEW_3D":
            return self.execute(context)
        return reporting(self, lambda: self._invoke(context, event))

    def _invoke(self, context, event):
        self._take_output(context.scene.nicmm_curves)
        self._area = context.area
        self._grabbed, self._grip = None, np.zeros(2)
        self._last_move = 0.0
        edited = chosen(context, self.curve)
        if self.at_mouse:
            clicked = self._clicked(context, event)
            if clicked is None:
                # Off the mesh a click selects, as with Blender's own tools.
                bpy.ops.view3d.select("INVOKE_DEFAULT")
                return {"CANCELLED"}
            edited = clicked[0]
        self._opened = opened = open_session(context, edited, self._asked_for(context, edited))
        self._edited_name = "" if edited is None else edited.name
        self._hidden = _Hidden(opened, edited)
        self._overlay = Overlay(opened.mesh_object, opened.session)
        self._timer = context.window_manager.event_timer_add(INTERVAL, window=context.window)
        context.window_manager.modal_handler_add(self)
        self._show_status(context)
        if self.at_mouse:
            self._press(context, event)
        viewports.redraw()
        return {"RUNNING_MODAL"}

    def _take_output(self, panel) -> None:
        """Take the settings of the sidebar for a new object, as far as the tool makes it."""
        for name in ("output", *DRAWN):
            value = getattr(panel, name)
            given = self.properties.is_property_set(name, ghost=False)
            if not given and (name != "output" or value in SEPARATE):
                setattr(self, name, value)

    def _clicked(self, context, event) -> tuple | None:
        """A tuple of the designed curve under the mouse, or of None for a new one.

        None if the mouse is neither on the mesh nor on a curve.
        """
        mesh_object = mesh_data.mesh_object(context)
        surface = read(mesh_object, context.scene.nicmm_curves.use_modifiers)
        mesh = designers.designer_for(surface.solved, surface.faces).mesh
        view, pixel = self._view_on(context, event, mesh_object, surface, mesh)
        if view is None:
            return None
        scale = context.preferences.system.ui_scale
        for drawn in curve_record.curves_on(context, mesh_object):
            asked = curve_record.asked_of(drawn)
            on = surface
            if asked.use_modifiers != surface.with_modifiers:
                on = read(mesh_object, asked.use_modifiers)
            points, line = curve_record.places(drawn, on)
            if (
                view.nearest_point(pixel, points, POINT_REACH * scale) is not None
                or view.nearest_on_line(pixel, line, CURVE_REACH * scale) is not None
            ):
                return (drawn,)
        return None if view.place_at(pixel) is None else (None,)

    def modal(self, context, event):
        try:
            result = self._modal(context, event)
        except Exception:
            self._end(context)
            raise
        if result & {"FINISHED", "CANCELLED"}:
            viewports.redraw()
        return result

    def cancel(self, context):
        """Called by Blender if it ends the tool, for example when it quits."""
        self._end(context)

    def _modal(self, context, event):
        session = self._opened.session
        if event.type == "TIMER":
            still = time.monotonic() - self._last_move > PAUSE
            # A design from scratch takes longer than a frame, so it waits until the mouse stops.
            if not session.idle and (still or not (session.waiting and self._grabbed is not None)):
                session.step()
                self._show(context)
            return {"RUNNING_MODAL"}
        if event.type == "MOUSEMOVE":
            self._last_move = time.monotonic()
            if self._grabbed is None:
                self._hover(context, event)
            else:
                self._drag(context, event)
            return {"RUNNING_MODAL"}
        if event.type == "LEFTMOUSE" and event.value == "RELEASE":
            self._release(context)
            return {"RUNNING_MODAL"}
        if event.type in PASSED_ON and not (event.type in WHEEL and event.ctrl):
            return {"PASS_THROUGH"}
        if event.value not in {"PRESS", "DOUBLE_CLICK"}:
            return {"RUNNING_MODAL"}
        if event.type == "ESC":
            self._end(context)
            return {"CANCELLED"}
        if event.type in {"RET", "NUMPAD_ENTER"}:
            return self._finish(context)
        if self._grabbed is not None:
            if event.type == "RIGHTMOUSE":
                session.drop_back()
                self._release(context)
            return {"RUNNING_MODAL"}
        if event.type == "LEFTMOUSE":
            self._press(context, event)
        elif event.type in WHEEL:
            session.smoother(1 if event.type == "WHEELUPMOUSE" else -1)
        else:
            self._key(context, event)
        self._show(context)
        return {"RUNNING_MODAL"}

    def _key(self, context, event) -> None:
        session, key = self._opened.session, event.type
        if key == "Z" and (event.ctrl or event.oskey):
            if event.shift:
                session.redo()
            else:
                session.undo()
            self._overlay.hover = None
        elif key == "C":
            session.ask_for(closed=not session.asked.closed)
        elif key in {"O", "A"}:
            name = "obstacle_group" if key == "O" else "alignment_group"
            groups = ["", *(group.name for group in self._opened.mesh_object.vertex_groups)]
            now = getattr(session.asked, name)
            at = groups.index(now) if now in groups else 0
            session.ask_for(**{name: groups[(at + (-1 if event.shift else 1)) % len(groups)]})
        elif key in {"UP_ARROW", "DOWN_ARROW"}:
            session.smoother(1 if key == "UP_ARROW" else -1)
        elif key in {"X", "DEL", "BACK_SPACE"} and len(session.points):
            last = len(session.points) - 1
            session.remove(last if self._overlay.hover is None else self._overlay.hover)
            self._overlay.hover = None

    def _press(self, context, event) -> None:
        view, pixel = self._view(context, event)
        if view is None:
            return
        session = self._opened.session
        scale = context.preferences.system.ui_scale
        number = view.nearest_point(pixel, session.positions(), POINT_REACH * scale)
        if event.ctrl:
            if number is not None:
                session.remove(number)
                self._overlay.hover = None
            return
        self._grip = np.zeros(2)
        if number is not None:
            self._grip = view.project(session.positions())[number] - pixel
        elif (found := self._on_curve(view, pixel, scale)) is not None:
            number = session.insert(*found)
        elif (place := view.place_at(pixel)) is not None:
            number = session.add(*place)
        if number is not None:
            session.grab()
            self._grabbed = self._overlay.hover = number

    def _on_curve(self, view, pixel, scale: float):
        line = self._opened.session.polyline()
        if not len(line) or self._opened.session.problem:
            return None
        return view.nearest_on_line(pixel, line, CURVE_REACH * scale)

    def _drag(self, context, event) -> None:
        view, pixel = self._view(context, event, anywhere=True)
        place = None if view is None else view.place_at(pixel + self._grip)
        if place is not None:
            self._opened.session.move(self._grabbed, *place)
            self._show(context)

    def _hover(self, context, event) -> None:
        view, pixel = self._view(context, event)
        found = None
        if view is not None:
            reach = POINT_REACH * context.preferences.system.ui_scale
            found = view.nearest_point(pixel, self._opened.session.positions(), reach)
        if found != self._overlay.hover:
            self._overlay.hover = found
            viewports.redraw()

    def _release(self, context) -> None:
        self._opened.session.drop()
        self._grabbed = None
        self._show(context)

    def _finish(self, context):
        session = self._opened.session
        if session.untouched:
            self._end(context)
            return {"CANCELLED"}
        self._release(context)
        session.converge()
        if session.what_is_missing():
            self._show(context)
            return {"RUNNING_MODAL"}
        self._end(context)
        return reporting(self, lambda: self._keep(context, self._opened, self._edited()))

    def _edited(self):
        return bpy.data.objects.get(self._edited_name) if self._edited_name else None

    def _end(self, context) -> None:
        """Restore the window."""
        self._overlay.remove()
        self._hidden.restore()
        context.window_manager.event_timer_remove(self._timer)
        context.workspace.status_text_set(None)
        if self._area is not None:
            self._area.header_text_set(None)
        viewports.redraw()

    def _keep(self, context, opened, edited):
        """Write the curve of a session, and store its settings for the redo panel."""
        session = opened.session
        missing = session.what_is_missing()
        if missing:
            raise InputError(missing)
        made = keep(context, opened, edited, self)
        for name in settings.EditingProperties.__annotations__:
            setattr(self, name, getattr(session.asked, name))
        self.points.clear()
        for position in session.positions():
            self.points.add().position = position
        count = len(session.points)
        words = f'"{made.name}" through {count} points{opened.remark}'
        chosen = context.scene.nicmm_curves.bl_rna.properties["output"].enum_items
        wanted = context.scene.nicmm_curves.output
        if edited is None and wanted not in SEPARATE:
            words += f". Convert it for {chosen[wanted].name}: the tool draws curve objects"
        self.report({"INFO"}, words)
        return {"FINISHED"}

    # Display.

    def _view(self, context, event, anywhere: bool = False):
        opened = self._opened
        surface, mesh = opened.session.surface, opened.session.designer.mesh
        return self._view_on(context, event, opened.mesh_object, surface, mesh, anywhere)

    def _view_on(self, context, event, mesh_object, surface, mesh, anywhere: bool = False):
        """The view under the mouse and the pixel in its region; None over panels and elsewhere.

        With `anywhere` also outside the region in which the mouse button was pressed.
        """
        for region in self._area.regions:
            inside = (
                0 <= event.mouse_x - region.x < region.width
                and 0 <= event.mouse_y - region.y < region.height
            )
            if region.type != "WINDOW" and inside and region.height > 1 and not anywhere:
                return None, None
        under = None
        for region in self._area.regions:
            if region.type != "WINDOW":
                continue
            x, y = event.mouse_x - region.x, event.mouse_y - region.y
            if (0 <= x < region.width and 0 <= y < region.height) or (
                anywhere and region == context.region
            ):
                under = region, np.array([x, y], dtype=np.float64)
        if under is None:
            return None, None
        region, pixel = under
        return view_of(region, region.data, mesh_object, surface, mesh), pixel

    def _show(self, context) -> None:
        self._show_status(context)
        viewports.redraw()

    def _show_status(self, context) -> None:
        session = self._opened.session
        self._area.header_text_set(in_words(session) + self._opened.remark)
        problem = session.problem or session.state.notice
        context.workspace.status_text_set(lambda header, _context: _draw_hints(header, problem))


class _Hidden:
    """Hides the old curve while editing, and modifiers that the curve is drawn without."""

    def __init__(self, opened, edited) -> None:
        modifiers = () if opened.session.asked.use_modifiers else opened.mesh_object.modifiers
        self._modifiers = [each for each in modifiers if each.show_viewport]
        for modifier in self._modifiers:
            modifier.show_viewport = False
        self._edited = edited if edited is not None and not edited.hide_get() else None
        if self._edited is not None:
            self._edited.hide_set(True)

    def restore(self) -> None:
        for modifier in self._modifiers:
            modifier.show_viewport = True
        if self._edited is not None:
            self._edited.hide_set(False)


def _draw_hints(header, problem: str) -> None:
    layout = header.layout
    if problem:
        layout.label(text=problem, icon="ERROR")
        return
    for icon, text in HINTS:
        layout.label(text=text, icon=icon)


def in_words(session) -> str:
    """The settings of the curve in one line."""
    asked = session.asked
    count = len(session.points)
    parts = [
        f"{count} point{'' if count == 1 else 's'}",
        "closed" if asked.closed else "open",
        f"smoothness {asked.smoothness:.2g}",
        f"obstacles: {asked.obstacle_group or 'none'}",
        f"alignment: {asked.alignment_group or 'none'}",
    ]
    if asked.closed and count == 2:
        parts[1] = "closed with three or more points"
    return ", ".join(parts)


def register() -> None:
    bpy.utils.register_class(NICMM_PG_control_point)
    bpy.utils.register_class(NICMM_OT_edit_curve)


def unregister() -> None:
    bpy.utils.unregister_class(NICMM_OT_edit_curve)
    bpy.utils.unregister_class(NICMM_PG_control_point)
