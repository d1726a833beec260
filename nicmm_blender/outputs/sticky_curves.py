# SPDX-License-Identifier: GPL-3.0-or-later
"""Writes a curve as a hair curves object that follows its deforming mesh.

Each point stores as attributes its polygon, the three vertices of its triangle and its barycentric
coordinates. A Geometry Nodes group (`sticky_nodes`) reads the positions of these vertices after all
modifiers.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import bpy
import numpy as np

from ..scene.surface import Surface
from . import sticky_nodes
from .clean_curves import Drawing, on_surface
from .curve_object import is_reflected, parent_to_mesh, scale_of, to_object_space

if TYPE_CHECKING:
    from ...nicmm_core import SurfaceCurve

RADIUS = "nicmm_radius"
"""Custom property that keeps the radius of a drawing while it has no curve."""


def are_drawn_with_all_points() -> bool:
    """Whether Blender draws hair curves with all their points, in the viewport and in EEVEE.

    Before Blender 5.0 it draws every strand with 8 points, or with 16, 32 or 64 if the scene has
    Additional Subdivision. Versions that draw all points also have the hair shape Cylinder.
    """
    shapes = bpy.types.RenderSettings.bl_rna.properties["hair_type"].enum_items
    return "CYLINDER" in shapes


def add(
    mesh_object: bpy.types.Object,
    surface: Surface,
    curves: list[SurfaceCurve],
    drawing: Drawing,
    corners: np.ndarray,
    tube: bool,
) -> bpy.types.Object:
    """Create the hair curves object without linking it to a collection."""
    name = f"{mesh_object.name} Curve"
    curve_object = bpy.data.objects.new(name, bpy.data.hair_curves.new(name))
    parent_to_mesh(curve_object, mesh_object, surface)
    try:
        write(curve_object, surface, curves, drawing, corners)
    except BaseException:
        data = curve_object.data
        bpy.data.objects.remove(curve_object)
        bpy.data.hair_curves.remove(data)
        raise
    radius = np.full(
        len(curve_object.data.points), drawing.radius / scale_of(curve_object, surface)
    )
    _set(curve_object.data, "radius", "FLOAT", "POINT", radius)
    sticky_nodes.add_modifier(curve_object, mesh_object, tube)
    return curve_object


def write(
    curve_object: bpy.types.Object,
    surface: Surface,
    curves: list[SurfaceCurve],
    drawing: Drawing,
    corners: np.ndarray,
) -> None:
    """Replace the curves of a hair curves object; the radii along them are kept.

    `corners`, (k,), tells which of their control points are corners.
    """
    data = curve_object.data
    radii = _radii(data)
    if not len(data.points):
        radii = np.zeros(1), np.array([drawing.radius / scale_of(curve_object, surface)])
    shown = on_surface(surface, curves, drawing, corners)
    if len(data.curves):
        data.remove_curves()
    if not shown:
        data[RADIUS] = float(radii[1].max())
        return
    data.add_curves([len(curve.faces) for curve in shown])
    faces = np.concatenate([curve.faces for curve in shown])
    barycentric = np.concatenate([curve.barycentric for curve in shown])
    points = to_object_space(curve_object, surface.points(faces, barycentric))
    data.points.foreach_set("position", points.astype(np.float32).ravel())
    shares = (np.arange(len(faces)) + 0.5) / len(faces)
    _set(data, "radius", "FLOAT", "POINT", np.interp(shares, *radii))
    _set(data, "cyclic", "BOOLEAN", "CURVE", np.array([curve.closed for curve in shown]))
    _set(data, "face", "INT", "POINT", surface.polygons[faces])
    vertices = np.full(len(faces), len(surface.local_positions))
    _set(data, sticky_nodes.VERTICES, "INT", "POINT", vertices)
    _set(data, sticky_nodes.BARYCENTRIC, "FLOAT_VECTOR", "POINT", barycentric)
    # A reflection of a mesh in Blender leaves the order of corners, so normals point inwards.
    outwards = -1.0 if is_reflected(curve_object) else 1.0
    height = outwards * drawing.offset / scale_of(curve_object, surface)
    offset = np.full(len(faces), height)
    _set(data, sticky_nodes.OFFSET, "FLOAT", "POINT", offset)
    cage_corners, cage_offset = on_cage(surface, faces, barycentric)
    _set(data, sticky_nodes.CAGE_OFFSET, "FLOAT_VECTOR", "POINT", cage_offset)
    for corner in range(3):
        _set(data, sticky_nodes.CORNERS[corner], "INT", "POINT", surface.faces[faces, corner])
        _set(data, sticky_nodes.CAGE_CORNERS[corner], "INT", "POINT", cage_corners[:, corner])


def radius_of(data: bpy.types.Curves) -> float:
    """The largest radius of the points; without points, the radius that was kept."""
    return float(_radii(data)[1].max()) if len(data.points) else float(data.get(RADIUS, 0.0))


def set_radius(data: bpy.types.Curves, radius: float) -> None:
    """Scale the radii of the points so that the largest has this value."""
    if not len(data.points):
        data[RADIUS] = radius
        return
    _, values = _radii(data)
    greatest = float(values.max())
    values = values * (radius / greatest) if greatest > 0.0 else np.full(len(data.points), radius)
    _set(data, "radius", "FLOAT", "POINT", values)


def _radii(data: bpy.types.Curves) -> tuple[np.ndarray, np.ndarray]:
    """Radii along all curves: position of each point as a fraction of all points, and its radius.

    Without points, both are a single zero.
    """
    attribute = data.attributes.get("radius")
    if attribute is None or not len(attribute.data):
        return np.zeros(1), np.zeros(1)
    values = np.empty(len(attribute.data), dtype=np.float32)
    attribute.data.foreach_get("value", values)
    return (np.arange(len(values)) + 0.5) / len(values), values


def on_cage(
    surface: Surface, faces: np.ndarray, barycentric: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Express points relative to three vertices of the cage.

    Parameters
    ----------
    surface : Surface
        The surface that the points lie on.
    faces, barycentric : (n,) int array, (n, 3) float array
        Triangle and barycentric coordinates of each point.

    Returns
    -------
    corners : (n, 3) int array
        Three vertices of the cage near each point; -1 if the modifiers do not keep these vertices
        at the start of the vertex list, with the same indices.
    offsets : (n, 3) float array
        Coordinates of each point relative to the first vertex, along the two sides from there and
        along the normal, scaled to the length of the first side.
    """
    if surface.cage is None:
        flat = np.zeros(len(faces))
        return surface.faces[faces], np.stack([*barycentric.T[1:], flat], axis=1)
    cage = surface.cage
    polygons = cage.faces[faces]
    known = np.flatnonzero(polygons >= 0)
    corners = np.full((len(faces), 3), -1)
    corners[known] = cage.corners[polygons[known]]
    in_front = np.zeros(len(faces), dtype=bool)
    in_front[known] = (cage.vertices[corners[known]] == corners[known]).all(axis=1)
    first, second, last = np.moveaxis(
        surface.local_positions[np.where(in_front[:, None], corners, 0)], 1, 0
    )
    along, across = second - first, last - first
    normal = np.cross(along, across)
    length = np.linalg.norm(normal, axis=1, keepdims=True)
    normal *= np.linalg.norm(along, axis=1, keepdims=True) / np.where(length > 0.0, length, 1.0)
    axes = np.stack([along, across, normal], axis=2)
    away = surface.points(faces, barycentric) - first
    places = np.einsum("nij,nj->ni", np.linalg.pinv(axes), away)
    return np.where(in_front[:, None], corners, -1), places


def _set(
    data: bpy.types.Curves, name: str, data_type: str, domain: str, values: np.ndarray
) -> None:
    attribute = data.attributes.get(name) or data.attributes.new(name, data_type, domain)
    kinds = {"INT": np.int32, "BOOLEAN": bool}
    values = np.ascontiguousarray(values, dtype=kinds.get(data_type, np.float32))
    attribute.data.foreach_set("vector" if data_type == "FLOAT_VECTOR" else "value", values.ravel())
