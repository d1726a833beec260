# SPDX-License-Identifier: GPL-3.0-or-later
"""Writes a curve as a hair curves object that follows its deforming mesh.

The attributes of each point are its polygon, the three vertices of its triangle and its barycentric
coordinates. A Geometry Nodes group (`sticky_nodes`) reads the positions of these vertices after all
modifiers.
"""

import bpy
import numpy as np

from . import sticky_nodes


def are_drawn_with_all_points() -> bool:
    """Whether Blender draws hair curves point by point, in the viewport and in EEVEE.

    Before Blender 5.0 it draws every strand with 8 points, or 16, 32 or 64 with the scene's
    Additional Subdivision. Versions that draw all points also have the shape Cylinder.
    """
    shapes = bpy.types.RenderSettings.bl_rna.properties["hair_type"].enum_items
    return "CYLINDER" in shapes


def add(mesh_object, surface, curves, radius: float, tube: bool):
    """Create the object without linking it to a collection."""
    name = f"{mesh_object.name} Curve"
    data = bpy.data.hair_curves.new(name)
    write(data, surface, curves, radius)
    curves_object = bpy.data.objects.new(name, data)
    sticky_nodes.add_modifier(curves_object, mesh_object, tube)
    return curves_object


def write(data, surface, curves, radius: float | None = None) -> None:
    """Replace the curves of a hair curves data-block; without a `radius`, keep the present one."""
    if radius is None:
        before = data.attributes.get("radius")
        radius = before.data[0].value if before is not None and len(before.data) else 0.0
    if len(data.curves):
        data.remove_curves()
    data.add_curves([len(curve.faces) for curve in curves])
    faces = np.concatenate([curve.faces for curve in curves])
    barycentric = np.concatenate([curve.barycentric for curve in curves])
    points = surface.points(faces, barycentric)
    data.points.foreach_set("position", points.astype(np.float32).ravel())
    _set(data, "radius", "FLOAT", "POINT", np.full(len(faces), radius))
    _set(data, "cyclic", "BOOLEAN", "CURVE", np.array([curve.closed for curve in curves]))
    _set(data, "face", "INT", "POINT", surface.polygons[faces])
    for corner, attribute in enumerate(sticky_nodes.CORNERS):
        _set(data, attribute, "INT", "POINT", surface.faces[faces, corner])
    _set(data, "barycentric", "FLOAT_VECTOR", "POINT", barycentric)


def _set(data, name: str, data_type: str, domain: str, values: np.ndarray) -> None:
    attribute = data.attributes.get(name) or data.attributes.new(name, data_type, domain)
    kinds = {"INT": np.int32, "BOOLEAN": bool}
    values = np.ascontiguousarray(values, dtype=kinds.get(data_type, np.float32))
    attribute.data.foreach_set("vector" if data_type == "FLOAT_VECTOR" else "value", values.ravel())
