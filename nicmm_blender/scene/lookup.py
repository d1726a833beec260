# SPDX-License-Identifier: GPL-3.0-or-later
"""Finds objects in the file and in view layers."""

import bpy


def by_uid(uid: int) -> bpy.types.Object | None:
    """The object with this session_uid, or None. Undo replaces Blender's Python objects."""
    return next((found for found in bpy.data.objects if found.session_uid == uid), None)


def is_in(view_layer: bpy.types.ViewLayer, candidate: bpy.types.Object) -> bool:
    """Whether a view layer contains an object.

    The name alone does not tell: an object linked from a library may have the same name.
    """
    objects = view_layer.objects
    named = objects.get(candidate.name)
    return named == candidate or (named is not None and any(each == candidate for each in objects))


def is_in_a_scene(candidate: bpy.types.Object) -> bool:
    """Whether any scene contains an object.

    Blender keeps a deleted object while a custom property refers to it.
    """
    return any(
        named == candidate or (named is not None and any(each == candidate for each in objects))
        for objects in (scene.objects for scene in bpy.data.scenes)
        for named in [objects.get(candidate.name)]
    )
