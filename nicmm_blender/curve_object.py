# SPDX-License-Identifier: GPL-3.0-or-later
"""Writes a polyline on a mesh as a Blender curve object."""

import bpy
import numpy as np


def add(context, mesh_object, polylines, thickness: float):
    """Add a curve object with one POLY spline for each (points, closed) pair and return it.

    POLY splines stay on the surface, where NURBS and Bézier splines would leave it. The points are
    in the mesh's own space, and the mesh is the parent, so the curve follows the object.
    """
    name = f"{mesh_object.name} Curve"
    curve = bpy.data.curves.new(name, "CURVE")
    curve.dimensions = "3D"
    curve.bevel_depth = thickness
    curve.use_fill_caps = True
    for points, closed in polylines:
        spline = curve.splines.new("POLY")
        spline.points.add(len(points) - 1)
        homogeneous = np.ones((len(points), 4), dtype=np.float32)
        homogeneous[:, :3] = points
        spline.points.foreach_set("co", homogeneous.ravel())
        spline.use_cyclic_u = closed

    curve_object = bpy.data.objects.new(name, curve)
    curve_object.parent = mesh_object
    for collection in _collections(context, mesh_object):
        collection.objects.link(curve_object)
    if getattr(context.space_data, "local_view", None):
        curve_object.local_view_set(context.space_data, True)
    _select(context, curve_object)
    return curve_object


def _collections(context, mesh_object):
    """The mesh's collections; the scene's own where all of them are linked from another file."""
    editable = [found for found in mesh_object.users_collection if found.library is None]
    return editable or [context.scene.collection]


def _select(context, curve_object) -> None:
    """Select the curve. It becomes active too, unless the mesh is being edited and must stay so."""
    if context.mode == "OBJECT":
        for selected in context.selected_objects:
            selected.select_set(False)
        context.view_layer.objects.active = curve_object
    curve_object.select_set(True)
