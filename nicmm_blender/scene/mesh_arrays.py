# SPDX-License-Identifier: GPL-3.0-or-later
"""Reads Blender's meshes as arrays, from whole attributes instead of single elements for speed."""

import numpy as np


def positions(mesh) -> np.ndarray:
    """Positions of the vertices, (V, 3), in local space."""
    return attribute(mesh, "position", "vector", 3, np.float32).astype(np.float64)


def corner_vertices(mesh) -> np.ndarray:
    """The vertex of each corner of the faces, (n,)."""
    return attribute(mesh, ".corner_vert", "value", 1, np.int32)


def triangle_corners(mesh) -> np.ndarray:
    """Corners of the triangles that Blender draws, (F, 3)."""
    mesh.calc_loop_triangles()
    return read(mesh.loop_triangles, "loops", 3, np.int32)


def triangle_faces(mesh) -> np.ndarray:
    """The face that each triangle belongs to, (F,)."""
    return read(mesh.loop_triangle_polygons, "value", 1, np.int32)


def attribute(mesh, name: str, field: str, width: int, kind) -> np.ndarray:
    """Values of an attribute; empty if it does not exist, as on a mesh without elements."""
    found = mesh.attributes.get(name)
    if found is None:
        return read((), field, width, kind)
    return read(found.data, field, width, kind)


def read(sequence, name: str, width: int, kind) -> np.ndarray:
    """Values of a property for all elements of a sequence, (n,) or (n, width)."""
    values = np.empty((len(sequence), width), dtype=kind)
    if len(sequence):
        sequence.foreach_get(name, values.ravel())
    return values if width > 1 else values[:, 0]
