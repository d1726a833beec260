# SPDX-License-Identifier: GPL-3.0-or-later
"""Evaluation of a temporary object in a scene of its own, apart from the user's data."""

from contextlib import contextmanager

import bpy


@contextmanager
def evaluated_apart(temporary):
    """Yield the evaluated mesh of an object in no scene, valid inside the block only.

    The object and its mesh, which no other object may use, are removed afterwards.
    """
    data = temporary.data
    scene = bpy.data.scenes.new("NICMM")
    try:
        scene.collection.objects.link(temporary)
        now = bpy.context.scene
        scene.frame_current, scene.frame_subframe = now.frame_current, now.frame_subframe
        layer = scene.view_layers[0]
        layer.update()
        evaluated = temporary.evaluated_get(layer.depsgraph)
        try:
            yield evaluated.to_mesh()
        finally:
            evaluated.to_mesh_clear()
    finally:
        bpy.data.scenes.remove(scene)
        bpy.data.objects.remove(temporary)
        bpy.data.meshes.remove(data)
