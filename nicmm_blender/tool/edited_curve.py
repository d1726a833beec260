# SPDX-License-Identifier: GPL-3.0-or-later
"""Opens an editing session on a curve object, and writes its curve back."""

from dataclasses import dataclass, replace

import numpy as np

from ..outputs import curve_object, writing
from ..scene import curve_record, designers, mesh_data
from ..scene.curve_record import Asked
from ..scene.messages import InputError
from ..scene.surface import group_weights, read, shown_beyond_the_cage
from .edit_session import EditSession


@dataclass(frozen=True)
class Opened:
    """A session, its mesh object, and a remark for the user."""

    mesh_object: object
    session: EditSession
    remark: str


def chosen(context, name: str):
    """The designed curve with a name, or the active one; None for a new curve."""
    import bpy

    if not name:
        active = context.active_object
        return active if curve_record.has_record(active) else None
    found = bpy.data.objects.get(name)
    if not curve_record.has_record(found):
        raise InputError(
            f'There is no designed curve "{name}". Give the name of a designed curve, or no name '
            "for a new curve"
        )
    return found


def open_session(context, edited, asked: Asked) -> Opened:
    """Open a session with the points of a curve, or without points on the active mesh."""
    if edited is None:
        mesh_object = mesh_data.mesh_object(context)
    else:
        mesh_object = curve_record.present_mesh(context, edited)
        _check_editable(edited)
    surface = read(mesh_object, asked.use_modifiers)
    if not len(surface.faces):
        raise InputError(f'"{mesh_object.name}" has no faces to draw on. Choose another mesh')
    designer = designers.designer_for(surface.solved, surface.faces)
    remarks = []
    shown = shown_beyond_the_cage(mesh_object)
    if shown and not asked.use_modifiers:
        remarks.append(f"on the mesh without its {shown}")
    for name in ("obstacle_group", "alignment_group"):
        group = getattr(asked, name)
        if edited is not None and group and group not in mesh_object.vertex_groups:
            asked = replace(asked, **{name: ""})
            remarks.append(f'without the vertex group "{group}", which no longer exists')
    points = curve = None
    if edited is not None:
        points, moved = curve_record.controls_now(edited, mesh_object, surface)
        if moved:
            remarks.append(f"the mesh has changed: {moved} points moved to the nearest positions")
        elif asked == replace(curve_record.asked_of(edited), method=asked.method):
            curve = _curve_of(edited, surface)

    def weights(name: str) -> np.ndarray | None:
        return group_weights(mesh_object, name, asked.use_modifiers)

    session = EditSession(surface, designer, weights, asked, points, curve)
    return Opened(mesh_object, session, "".join(f"; {remark}" for remark in remarks))


def keep(context, opened: Opened, edited, settings):
    """Write a session's curve into the edited object, or a new one; return the object.

    `settings` holds the output settings of a new one.
    """
    session, mesh_object = opened.session, opened.mesh_object
    surface, curves = session.surface, [session.curve]
    made = edited
    if edited is None:
        made = writing.as_object(mesh_object, surface, curves, settings)
    else:
        writing.redraw(edited, surface, curves)
    drawn = writing.drawn_as(settings) if edited is None else curve_record.drawn_as(edited)
    curve_record.remember(made, mesh_object, surface, curves, session.asked, drawn, session.points)
    if edited is None:
        curve_object.place(context, mesh_object, made)
    return made


def _check_editable(edited) -> None:
    library = edited.library or edited.data.library
    if library is not None:
        raise InputError(
            f'"{edited.name}" is linked from {library.filepath}. Make it local '
            "(Object > Relations > Make Local) first"
        )


def _curve_of(edited, surface):
    """The recorded curve of an object; None if it has to be designed again."""
    if not curve_record.lies_on(edited, surface):
        return None
    curves = curve_record.recall(edited, surface)
    whole = len(curves) == 1 and (curves[0].control_index >= 0).all()
    return curves[0] if whole else None
