"""Converts meshes of other libraries whose attributes have other names.

Meshes of trimesh have `vertices` and `faces`, and need no conversion.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from ..errors import ArgumentError, MeshError
from ..geometry.mesh import Mesh


def from_open3d(mesh: Any) -> Mesh:
    """The mesh of an `open3d.geometry.TriangleMesh`.

    Parameters
    ----------
    mesh : object with `vertices` and `triangles`

    Raises
    ------
    ArgumentError
        If the object has no such attributes.
    MeshError
        If its arrays are not those of a triangle mesh.
    """
    vertices, triangles = _attributes(mesh, "vertices", "triangles", "from_open3d")
    return Mesh(np.asarray(vertices), np.asarray(triangles))


def from_meshio(mesh: Any) -> Mesh:
    """The triangles and quadrilaterals of a `meshio.Mesh`, the latter divided into two triangles.

    Cells of other kinds, such as lines and tetrahedra, are left out.

    Parameters
    ----------
    mesh : object with `points` and `cells`
        The cells are blocks with a `type` and an array `data`.

    Raises
    ------
    ArgumentError
        If the object has no such attributes.
    MeshError
        If there are no triangles or quadrilaterals, or the arrays are not those of a mesh.
    """
    points, cells = _attributes(mesh, "points", "cells", "from_meshio")
    parts = []
    for block in cells:
        data = np.asarray(block.data)
        if block.type == "triangle":
            parts.append(data)
        elif block.type == "quad":
            parts += [data[:, [0, 1, 2]], data[:, [0, 2, 3]]]
    if not parts:
        kinds = ", ".join(sorted({block.type for block in cells})) or "none"
        raise MeshError(
            f"mesh has no cells of type triangle or quad (its types: {kinds}); extract its surface"
        )
    points = np.asarray(points)
    if points.ndim == 2 and points.shape[1] == 2:  # a mesh in the plane
        points = np.pad(points, ((0, 0), (0, 1)))
    return Mesh(points, np.concatenate(parts))


def _attributes(mesh: Any, first: str, second: str, adapter: str) -> tuple[Any, Any]:
    try:
        return getattr(mesh, first), getattr(mesh, second)
    except AttributeError:
        raise ArgumentError(
            f"mesh is a {type(mesh).__name__} without {first} or {second}; {adapter} takes an "
            f"object with both"
        ) from None
