# SPDX-License-Identifier: GPL-3.0-or-later
"""The settings of a designed curve as properties of its object, which take effect immediately.

They are read from the record of the curve. A change designs the curve again; if that is impossible,
the curve and its settings stay as they were, and the reason is shown below the settings.
"""

from __future__ import annotations

import functools
from collections.abc import Callable

import bpy
from bpy.props import PointerProperty

from .. import settings
from ..outputs import curve_object, edited_curve, tube_radius, writing
from ..scene import curve_order, curve_record, surface_cache
from ..scene.curve_record import CurveSettings
from ..scene.messages import InputError, check_finite
from ..scene.surface import vertex_group
from .answers import answer_now
from .followers import follow_now
from .message_labels import draw_message

Value = bool | float | str
"""A setting of a curve."""

COURSE = (
    "closed",
    "smoothness",
    "normal_bending",
    "avoid_others",
    "use_modifiers",
    "obstacle_group",
    "alignment_group",
    "clearance",
    "mirror_axis",
    "mirror_as",
)
DRAWING = ("spline", "offset")

UNDO_DELAY = 0.3
"""Seconds without another change after which an undo step is added in modes of painting."""

PAINTING = {"SCULPT"} if bpy.app.version >= (5, 0, 0) else {"SCULPT", "PAINT_WEIGHT"}
"""Modes in which Blender adds no undo step for a change of a property.

Blender 4.3 adds none in Weight Paint, 5.2 does. Where both add one, the second changes nothing.
"""

_problems: dict[int, tuple[str, str]] = {}
"""Messages about changes that were impossible, by the session_uid of the curve.

Each is stored with the digest of the curve at that time, and is out of date if that has changed.
"""


def problem_of(curve: bpy.types.Object) -> str:
    """Why the last change of a curve's settings was impossible; empty if it was not."""
    digest, message = _problems.get(curve.session_uid, ("", ""))
    return message if curve_record.is_current(curve, digest) else ""


def _read(group: bpy.types.PropertyGroup, name: str, default: Value) -> Value:
    """A setting of a curve, or the default if its record cannot be read."""
    curve = group.id_data
    if not curve_record.has_record(curve):
        return default
    try:
        if name in DRAWING:
            drawn = curve_record.drawn_as(curve)
            return drawn["spline"] if name == "spline" else drawn["offset"]
        return getattr(curve_record.settings_of(curve), name)
    except InputError:
        return default


def _write(
    group: bpy.types.PropertyGroup, change: Callable[[bpy.types.Object], list[str] | None]
) -> None:
    """Change a curve, or store the reason why that is impossible.

    `change` may return remarks about other curves, which are shown too.
    """
    from ... import nicmm_core as nicmm

    curve = group.id_data
    if not curve_record.has_record(curve):
        return
    try:
        remarks = change(curve)
    except (InputError, nicmm.NicmmError, ImportError) as error:
        _problems[curve.session_uid] = curve_record.digest_of(curve), str(error)
    else:
        _problems.pop(curve.session_uid, None)
        if remarks:
            _problems[curve.session_uid] = curve_record.digest_of(curve), "; ".join(remarks)
        _push_undo_later()


def _push_undo_later() -> None:
    """Add an undo step soon in modes in which Blender adds none."""
    if bpy.app.background or bpy.context.mode not in PAINTING:
        return
    _cancel_undo()
    bpy.app.timers.register(_push_undo, first_interval=UNDO_DELAY)


def _push_undo() -> float | None:
    """Push the undo step; later while an operator runs, such as a stroke, which pushes its own."""
    if bpy.context.mode not in PAINTING:
        return None
    windows = bpy.context.window_manager.windows
    if any(len(window.modal_operators) for window in windows):
        return UNDO_DELAY
    with bpy.context.temp_override(window=windows[0]):
        bpy.ops.ed.undo_push(message="Curve Settings")
    return None


def _cancel_undo() -> None:
    if bpy.app.timers.is_registered(_push_undo):
        bpy.app.timers.unregister(_push_undo)


def _change(curve: bpy.types.Object, name: str, value: Value) -> list[str]:
    """Change a setting of a curve; return remarks about other curves that cannot follow."""
    context = bpy.context
    check_finite(name, value)
    curve_settings = curve_record.settings_of(curve)
    if name in DRAWING:
        opened = edited_curve.open_curve(context, curve)
        before = curve_record.drawn_as(curve)
        curves = (
            curve_record.read_curves(curve, opened.surface) if curve_record.has_curve(curve) else []
        )
        record = curve[curve_order.RECORD_KEY]
        record["drawn"] = {**before, name: value}
        try:
            writing.redraw(curve, opened.surface, curves, opened.points.corners, opened.mirror)
        except BaseException:
            record["drawn"] = before
            raise
        surface_cache.note_change()
        return []
    wanted = curve_settings.with_value(name, value)
    if value or name not in edited_curve.MAPS:
        _check_maps(curve_record.mesh_in_view_layer(context, curve), wanted)
    opened = edited_curve.open_curve(context, curve, wanted, keeps_course=True)
    requests = edited_curve.request(opened, opened.points)
    curves = edited_curve.curves_of(answer_now(context, requests))
    edited_curve.rewrite(opened, opened.points, curves)
    return follow_now(context, [curve])


def _check_maps(mesh_object: bpy.types.Object, wanted: CurveSettings) -> None:
    """Raise an error if a map no longer exists; another setting would drop it otherwise."""
    for name in edited_curve.MAPS:
        if getattr(wanted, name):
            vertex_group(mesh_object, getattr(wanted, name))


def _get_radius(group: bpy.types.PropertyGroup) -> float:
    curve = group.id_data
    mesh_object = curve_record.mesh_of(curve) if curve_record.has_record(curve) else None
    if mesh_object is None:
        return 0.0
    return tube_radius.radius_of(curve) * curve_object.scale_in_scene(curve, mesh_object)


def _set_radius(curve: bpy.types.Object, value: float) -> None:
    check_finite("radius", value)
    writing.check_replaceable(curve)
    mesh_object = curve_record.mesh_in_view_layer(bpy.context, curve)
    tube_radius.set_radius(curve, value / curve_object.scale_in_scene(curve, mesh_object))
    curve.data.update_tag()
    surface_cache.note_change()


def _property(name: str, given: bpy.props._PropertyDeferred) -> bpy.props._PropertyDeferred:
    """A property that reads a setting from the record of its curve and writes it there."""
    words = {**given.keywords, "options": set()}  # not animatable: a change designs the curve
    default = words.get("default", "")
    get, put = functools.partial(_read, name=name, default=default), _setter(name)
    if "items" in words:
        names = [item[0] for item in words["items"]]
        return given.function(
            **words,
            get=lambda group: names.index(get(group)),
            set=lambda group, number: put(group, names[number]),
        )
    return given.function(**words, get=lambda group: get(group), set=put)


def _setter(name: str) -> Callable[[bpy.types.PropertyGroup, Value], None]:
    return lambda group, value: _write(group, lambda curve: _change(curve, name, value))


def _radius_property() -> bpy.props._PropertyDeferred:
    words = dict(settings.OutputProperties.__annotations__["radius"].keywords)
    words |= {"description": "Radius of the curve. Set to zero for a line", "options": set()}
    return bpy.props.FloatProperty(
        **words,
        get=_get_radius,
        set=lambda group, value: _write(group, lambda curve: _set_radius(curve, value)),
    )


_GIVEN = settings.EditingProperties.__annotations__ | settings.OutputProperties.__annotations__


class NICMM_PG_curve_settings(bpy.types.PropertyGroup):
    """Settings of a designed curve. A change designs the curve again"""

    __annotations__ = {  # noqa: RUF012 - as Blender reads it
        **{name: _property(name, _GIVEN[name]) for name in (*COURSE, *DRAWING)},
        "radius": _radius_property(),
    }


def draw_in_header(layout: bpy.types.UILayout, curve: bpy.types.Object) -> None:
    """Draw the settings that users change most often while drawing."""
    values = curve.nicmm_settings
    mesh_object = curve_record.mesh_of(curve)
    for name in ("closed", "smoothness", "normal_bending"):
        layout.prop(values, name)
    settings.draw_avoid_others(layout, values, "Avoid Others")  # the header is narrow
    settings.draw_mirror_in_header(layout, values)
    if mesh_object is not None:
        for name in edited_curve.MAPS:
            layout.prop_search(values, name, mesh_object, "vertex_groups")
    if problem_of(curve):
        layout.label(text="See Sidebar", icon="ERROR")  # the header is too narrow for the reason


def draw(layout: bpy.types.UILayout, curve: bpy.types.Object) -> None:
    """Draw the settings of a curve, without its maps."""
    values = curve.nicmm_settings
    layout.use_property_split = True
    layout.use_property_decorate = False
    for name in ("closed", "smoothness", "normal_bending"):
        layout.prop(values, name)
    settings.draw_avoid_others(layout, values)
    settings.draw_mirror(layout, values, curve_record.mesh_of(curve))
    layout.prop(values, "use_modifiers")
    for name in ("spline", "radius", "offset"):
        layout.prop(values, name)
    if problem := problem_of(curve):
        draw_message(layout, problem)


def register() -> None:
    bpy.utils.register_class(NICMM_PG_curve_settings)
    bpy.types.Object.nicmm_settings = PointerProperty(type=NICMM_PG_curve_settings)


def unregister() -> None:
    _cancel_undo()
    _problems.clear()
    del bpy.types.Object.nicmm_settings
    bpy.utils.unregister_class(NICMM_PG_curve_settings)
