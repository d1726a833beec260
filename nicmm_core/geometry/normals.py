"""Normals of the surface at its vertices."""

from __future__ import annotations

import igl
import numpy as np

from ..progress import checkpoint
from .array_types import FloatArray, IntArray


def vertex_normals(vertices: FloatArray, faces: IntArray) -> FloatArray:
    """Unit normals weighted by corner angle, shape (n, 3); zero where they cancel."""
    checkpoint()
    normals = igl.per_vertex_normals(vertices, faces, igl.PER_VERTEX_NORMALS_WEIGHTING_TYPE_ANGLE)
    checkpoint()
    return np.nan_to_num(normals)
