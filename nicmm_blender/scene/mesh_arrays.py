# SPDX-License-Identifier: GPL-3.0-or-later
"""Blender's meshes as arrays, read by the fastest way: attributes are copied, not looked up."""

import numpy as np


def positions(mesh) -> np.ndarray:
    """Positions of the vertices, (V, 3)."""
    return attribute(mesh, "position", "vector", 3, np.float32).astype(np.float64)


def corner_vertices(mesh) -> np.ndarray:
    """The vertex of each corner of the faces, (n,)."""
    return attribute(mesh, ".corner_vert", "value", 1, np.int32)


def triangle_corners(mesh) -> np.ndarray:
    """Corners of the triangles as Blender draws them, (F, 3)."""
    mesh.calc_loop_triangles()
    return read(mesh.loop_triangles, "loops", 3, np.int32)


def triangle_faces(mesh) -> np.ndarray:
    """The face that each triangle is a part of, (F,)."""
    return read(mesh.loop_triangle_polygons, "value", 1, np.int32)


def attribute(mesh, name: str, field: str, width: int, kind) -> np.ndarray:
    """Values of an attribute; without elements, Blender may not have it."""
    found = mesh.attributes.get(name)
    if found is None:
        return read((), field, width, kind)
    return read(found.data, field, width, kind)


def read(sequence, name: str, width: int, kind) -> np.ndarray:
    """A property of all elements, (n,) or (n, width)."""
    values = np.empty((len(sequence), width), dtype=kind)
    if len(sequence):
        sequence.foreach_get(name, values.ravel())
    return values if width > 1 else values[:, 0]
