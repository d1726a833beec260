# SPDX-License-Identifier: GPL-3.0-or-later
"""Evaluates a temporary object in a separate scene, without touching the user's data."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

import bpy

SIMPLIFICATION = ("use_simplify", "simplify_subdivision")
"""Settings of a scene that limit the subdivision levels in its viewports."""


@contextmanager
def evaluated_in_isolation(temporary: bpy.types.Object) -> Iterator[bpy.types.Mesh]:
    """Yield the evaluated mesh of an object that is in no scene; it is valid inside the block only.

    The object and its mesh are removed afterwards, so no other object may use that mesh.
    """
    data = temporary.data
    scene = bpy.data.scenes.new("NICMM")
    try:
        scene.collection.objects.link(temporary)
        now = bpy.context.scene
        scene.frame_current, scene.frame_subframe = now.frame_current, now.frame_subframe
        for name in SIMPLIFICATION:
            setattr(scene.render, name, getattr(now.render, name))
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
