# SPDX-License-Identifier: GPL-3.0-or-later
"""Writes a polyline on a mesh as a Blender curve object, and links new objects to the scene."""

import bpy
import numpy as np


def polyline_object(mesh_object, polylines, thickness: float):
    """Make a curve object with one POLY spline for each (points, closed) pair.

    POLY splines lie on the surface; NURBS and Bézier splines would not. The points are in the
    mesh's local space.
    """
    name = f"{mesh_object.name} Curve"
    curve = bpy.data.curves.new(name, "CURVE")
    curve.dimensions = "3D"
    curve.bevel_depth = thickness
    curve.use_fill_caps = True
    write_polylines(curve, polylines)
    return bpy.data.objects.new(name, curve)


def write_polylines(curve, polylines) -> None:
    """Replace the splines of a curve, with one for each (points, closed) pair."""
    materials = [spline.material_index for spline in curve.splines]
    curve.splines.clear()
    for number, (points, closed) in enumerate(polylines):
        spline = curve.splines.new("POLY")
        spline.points.add(len(points) - 1)
        homogeneous = np.ones((len(points), 4), dtype=np.float32)
        homogeneous[:, :3] = points
        spline.points.foreach_set("co", homogeneous.ravel())
        spline.use_cyclic_u = closed
        if number < len(materials):
            spline.material_index = materials[number]


def place(context, mesh_object, curve_object) -> None:
    """Link a new curve to the scene as a child of the mesh object, so that it moves with it."""
    curve_object.parent = mesh_object
    link(context, mesh_object, curve_object)
    _select(context, curve_object)


def link(context, mesh_object, new_object) -> None:
    """Link a new object to the collections of the mesh, and to the local view."""
    for collection in _collections(context, mesh_object):
        collection.objects.link(new_object)
    if getattr(context.space_data, "local_view", None):
        new_object.local_view_set(context.space_data, True)


def _collections(context, mesh_object):
    """The mesh's collections, or the scene's one if all are linked from another file."""
    editable = [found for found in mesh_object.users_collection if found.library is None]
    return editable or [context.scene.collection]


def remove(curve_object) -> None:
    """Delete a curve object, and its data unless it has other users."""
    data = curve_object.data
    bpy.data.objects.remove(curve_object, do_unlink=True)
    if not data.users:
        bpy.data.batch_remove([data])


def select_only(context, chosen) -> None:
    """Make an object active and the only selected one; in Object Mode only."""
    for selected in context.selected_objects:
        selected.select_set(False)
    context.view_layer.objects.active = chosen
    chosen.select_set(True)


def _select(context, curve_object) -> None:
    """Select the curve. In Object Mode it becomes active; in Edit Mode the mesh stays active."""
    if context.mode == "OBJECT":
        select_only(context, curve_object)
    curve_object.select_set(True)
