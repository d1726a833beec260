# SPDX-License-Identifier: GPL-3.0-or-later
"""Caches the surfaces of mesh objects for code that runs on every mouse move.

Blender reports every change of an object; the surface of a changed object is dropped.
"""

import bpy
from bpy.app.handlers import persistent

from .surface import Surface, read

MOST = 4
"""Maximum number of surfaces in the cache."""

FEW_FACES = 60_000
"""Faces up to which a mesh is read immediately, in some hundredths of a second.

The tool shows a message before it reads a larger mesh.
"""


class _Cache:
    """Surfaces by session_uid, mode and use of modifiers, and the count of reported changes."""

    def __init__(self) -> None:
        self.surfaces: dict = {}
        self.read: set = set()  # session_uids of all objects read since the file was opened
        self.changes = 0


_cache = _Cache()


def changes() -> int:
    """A counter that increases whenever a mesh or a designed curve may have changed."""
    return _cache.changes


def note_change() -> None:
    """Record that a designed curve has changed."""
    _cache.changes += 1


def cached(mesh_object, use_modifiers: bool) -> Surface | None:
    """The surface of an object if it has been read since the object's last change, or None."""
    return _cache.surfaces.get(_key(mesh_object, use_modifiers))


def was_read(mesh_object) -> bool:
    """Whether the surface of an object has been read since the file was opened."""
    return mesh_object.session_uid in _cache.read


def get(mesh_object, use_modifiers: bool) -> Surface:
    """The surface of an object, read again only if the object has changed."""
    found = cached(mesh_object, use_modifiers)
    if found is None:
        found = read(mesh_object, use_modifiers)
        bpy.context.view_layer.update()  # handles the reports caused by reading itself
        while len(_cache.surfaces) >= MOST:
            del _cache.surfaces[next(iter(_cache.surfaces))]
        _cache.surfaces[_key(mesh_object, use_modifiers)] = found
        _cache.read.add(mesh_object.session_uid)
    return found


def has_few_faces(mesh_object) -> bool:
    """Whether reading the surface of an object takes no longer than about two frames."""
    evaluated = mesh_object.evaluated_get(bpy.context.evaluated_depsgraph_get())
    return len(evaluated.data.polygons) <= FEW_FACES and not any(
        modifier.show_viewport and modifier.type in {"SUBSURF", "MULTIRES"} and modifier.levels > 2
        for modifier in mesh_object.modifiers
        if hasattr(modifier, "levels")
    )


def _key(mesh_object, use_modifiers: bool) -> tuple:
    return mesh_object.session_uid, mesh_object.mode, use_modifiers


@persistent
def note_updates(_scene, depsgraph) -> None:
    """Drop the surfaces of the objects that have changed."""
    for update in depsgraph.updates:
        changed = update.id.original
        if not isinstance(changed, bpy.types.Object):
            continue
        if changed.type in {"CURVE", "CURVES"}:
            _cache.changes += 1
        if changed.type != "MESH":
            continue
        # Blender reports strokes in Sculpt Mode as changes of the shading only.
        sculpted = update.is_updated_shading and changed.mode == "SCULPT"
        if update.is_updated_geometry or update.is_updated_transform or sculpted:
            _drop(changed.session_uid)


def _drop(uid: int) -> None:
    _cache.changes += 1
    for key in [key for key in _cache.surfaces if key[0] == uid]:
        del _cache.surfaces[key]


@persistent
def forget(*_arguments) -> None:
    """Drop all surfaces: after undo or redo, a frame change, or opening a file."""
    _cache.surfaces.clear()
    _cache.changes += 1


@persistent
def forget_file(*_arguments) -> None:
    """Drop everything before another file is opened."""
    forget()
    _cache.read.clear()


HANDLERS = (
    ("depsgraph_update_post", note_updates),
    ("frame_change_post", forget),
    ("undo_post", forget),
    ("redo_post", forget),
    ("load_pre", forget_file),
    ("load_post", forget),
)


def register() -> None:
    for name, function in HANDLERS:
        getattr(bpy.app.handlers, name).append(function)


def unregister() -> None:
    for name, function in HANDLERS:
        getattr(bpy.app.handlers, name).remove(function)
    forget_file()
