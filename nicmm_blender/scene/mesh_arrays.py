# SPDX-License-Identifier: GPL-3.0-or-later
"""Reads Blender's meshes as arrays, from whole attributes instead of single elements for speed."""

from __future__ import annotations

import bpy
import numpy as np
from numpy.typing import DTypeLike


def positions(mesh: bpy.types.Mesh) -> np.ndarray:
    """Positions of the vertices, (V, 3), in local space."""
    return attribute(mesh, "position", "vector", 3, np.float32).astype(np.float64)


def corner_vertices(mesh: bpy.types.Mesh) -> np.ndarray:
    """The vertex of each corner of the faces, (n,)."""
    return attribute(mesh, ".corner_vert", "value", 1, np.int32)


def triangle_corners(mesh: bpy.types.Mesh) -> np.ndarray:
    """Corners of the triangles that Blender draws, (F, 3)."""
    mesh.calc_loop_triangles()
    return read(mesh.loop_triangles, "loops", 3, np.int32)


def triangle_faces(mesh: bpy.types.Mesh) -> np.ndarray:
    """The face that each triangle belongs to, (F,)."""
    return read(mesh.loop_triangle_polygons, "value", 1, np.int32)


def attribute(
    mesh: bpy.types.Mesh, name: str, field: str, width: int, kind: DTypeLike
) -> np.ndarray:
    """Values of an attribute; empty if it does not exist, as on a mesh without elements."""
    found = mesh.attributes.get(name)
    return read(None if found is None else found.data, field, width, kind)


def read(
    sequence: bpy.types.bpy_prop_collection | None, name: str, width: int, kind: DTypeLike
) -> np.ndarray:
    """Values of a property for all elements of a sequence, (n,) or (n, width).

    None stands for an empty sequence.
    """
    values = np.empty((len(sequence or ()), width), dtype=kind)
    if sequence:
        sequence.foreach_get(name, values.ravel())
    return values if width > 1 else values[:, 0]
