"""Delaunay triangulation of a surface: the same vertices, joined by better diagonals.

A quadrilateral face of a modelling program may be divided along either diagonal, and a nearly flat
surface may be triangulated in many ways. Flips of edges lead from nearly all of them to the same
triangulation, in which the two angles opposite an edge sum up to at most 180°.
"""

from __future__ import annotations

import nicmm_kernels
import numpy as np

from ..progress import checkpoint
from .array_types import IntArray
from .mesh import Mesh, opposite_sides

FLATTEST = (30.0, 60.0)
"""Greatest angles between normals of the faces on both diagonals, in degrees. Sharper edges stay.

The flattest quadrilaterals come first. Otherwise more of the others would keep their diagonals.
"""

TIE = 5e-3
"""Difference of the sums of opposite angles, in radians, up to which both diagonals are as good.

It exceeds the errors of rounded coordinates.
"""


def delaunay_faces(mesh: Mesh) -> IntArray:
    """The faces of a Delaunay triangulation of the vertices of a mesh, (F, 3).

    Of two equally good diagonals of a rectangle, that with the vertex of least index is taken, so
    pass a canonical copy (`numbering`). The faces are sorted (`sorted_faces`).
    """
    faces = sorted_faces(mesh.faces)
    for angle in FLATTEST:
        flipped = nicmm_kernels.flip_diagonals(
            np.ascontiguousarray(mesh.vertices),
            faces,
            np.ascontiguousarray(opposite_sides(faces), np.int64),
            float(np.cos(np.radians(angle))),
            TIE,
            checkpoint,
        )
        faces = sorted_faces(flipped)
    return faces


def sorted_faces(faces: IntArray) -> IntArray:
    """Faces, (F, 3), each from its vertex of least index, in ascending order."""
    first = (np.arange(3) + faces.argmin(axis=1)[:, None]) % 3
    faces = np.take_along_axis(faces, first, axis=1)
    low, middle, high = faces.T
    order = np.lexsort((high, low * (int(faces.max(initial=0)) + 1) + middle))
    return np.ascontiguousarray(faces[order], np.int64)
