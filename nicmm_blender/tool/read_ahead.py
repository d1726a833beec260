# SPDX-License-Identifier: GPL-3.0-or-later
"""Reads the surface under the tool from a timer, for drawing and for the mark under the mouse.

Reading a surface makes temporary objects, which Blender does not allow while it draws, or while it
asks gizmos about the mouse.
"""

import bpy

from ..operators.viewports import redraw
from ..outputs import edited_curve
from ..scene import surface_cache
from ..scene.messages import InputError
from . import picking

DELAY = 0.3
"""Seconds until a large mesh is read, so that several undo steps in a row cause one reading."""

_wanted: set = set()
"""Surfaces to read: the session_uid of the mesh object, and whether modifiers are used."""

_failed: dict = {}
"""Surfaces that could not be read, with the count of changes at that time."""


def is_read(context, mesh_object, curve) -> bool:
    """Whether what is under the mouse is known. If not, the surface is read soon.

    A large mesh is read only if it was read before: the first click on it shows the progress.
    """
    needed = picking.modifier_uses(context, mesh_object, curve)
    missing = [uses for uses in needed if surface_cache.cached(mesh_object, uses) is None]
    if not missing:
        return picking.is_ready(context, mesh_object, curve)
    few = surface_cache.has_few_faces(mesh_object)
    if few or surface_cache.was_read(mesh_object):
        for uses in missing:
            _want((mesh_object.session_uid, uses), 0.0 if few else DELAY)
    return False


def _want(key: tuple, delay: float) -> None:
    """Read a surface after a delay, unless that has failed and nothing has changed since."""
    if _failed.get(key) == surface_cache.changes():
        return
    _wanted.add(key)
    if not bpy.app.timers.is_registered(_read):
        bpy.app.timers.register(_read, first_interval=delay)


def _read() -> float | None:
    from ...nicmm_core import NicmmError

    if bpy.app.is_job_running("RENDER"):
        return DELAY
    wanted = list(_wanted)
    _wanted.clear()
    _failed.clear()
    for uid, uses_modifiers in wanted:
        mesh_object = edited_curve.by_uid(uid)
        if mesh_object is None:
            continue
        try:
            surface_cache.get(mesh_object, uses_modifiers)
            surface_cache.note_change()  # curves on this surface can be shown now
        except (InputError, NicmmError):  # a click reports the error
            bpy.context.view_layer.update()  # so that the reading itself counts as no change
            _failed[uid, uses_modifiers] = surface_cache.changes()
    redraw()
    return None


def register() -> None:
    """Nothing to register: the timer is registered when a surface has to be read."""


def unregister() -> None:
    if bpy.app.timers.is_registered(_read):
        bpy.app.timers.unregister(_read)
    _wanted.clear()
    _failed.clear()
