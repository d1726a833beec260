"""Finds faces that are turned over, so that a surface can be given a consistent orientation."""

from __future__ import annotations

import numpy as np

from .array_types import BoolArray, IntArray
from .mesh import Mesh
from .sides import two_sides


def turned_faces(mesh: Mesh) -> BoolArray:
    """Faces whose turning makes every orientable part of a mesh consistently oriented, (F,).

    In each part, in which edges with two faces join the faces, these are the fewer ones. Faces of
    parts that are not orientable, such as a Möbius strip, are not turned.
    """
    if mesh.is_oriented:
        return np.zeros(len(mesh.faces), dtype=bool)
    one = np.flatnonzero(mesh.opposite_sides > np.arange(mesh.faces.size))
    other = mesh.opposite_sides[one]
    alike = mesh.faces[one // 3, one % 3 - 2] == mesh.faces[other // 3, other % 3 - 2]
    part, side = two_sides(len(mesh.faces), np.stack([one // 3, other // 3], axis=1), alike)
    more = np.bincount(part, weights=side, minlength=2 * len(mesh.faces))[part]
    return side * np.where(more < 0.0, -1, 1) < 0


def turned(faces: IntArray, which: BoolArray) -> IntArray:
    """Faces, (F, 3), some of them with the opposite orientation."""
    return np.where(which[:, None], faces[:, [0, 2, 1]], faces)
