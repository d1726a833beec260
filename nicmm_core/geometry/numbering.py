"""A numbering of vertices and faces that the surface decides, whatever numbers a file gives them.

Which path is found among several of about the same length depends on the order in which vertices
and faces are visited. Here they are sorted by their places in the surface's principal frame. So a
mesh that is renumbered, turned, moved or scaled gets the same numbers, up to rounding, unless the
surface has no such frame, as a ball.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TypeVar

import numpy as np

from .array_types import FloatArray, IntArray
from .curve import SurfaceCurve, curve_on_mesh
from .mesh import Mesh
from .surface_points import SurfacePoints
from .tolerances import TINY

RESOLUTION = 1e-7
"""Of coordinates that are compared, in square roots of the area: far coarser than rounding."""

FARTHEST = 2.0**60
"""Greatest coordinate that is told from others."""

SYMMETRIC = 1e-6
"""Skewness along an axis up to which the surface is symmetric about the plane across it."""


@dataclass(frozen=True)
class Renumbered:
    """A mesh with other numbers.

    Attributes
    ----------
    original : Mesh
    mesh : Mesh
        Its first corners are those with the smallest numbers; orientations stay.
    number : (V,) int array
        The number of each original vertex.
    face : (F,) int array
        The original face of each face.
    shift : (F,) int array
        How far the corners of each face are rotated.
    """

    original: Mesh
    mesh: Mesh
    number: IntArray
    face: IntArray
    shift: IntArray

    def points(self, points: SurfacePoints) -> SurfacePoints:
        """Points of the original."""
        place = np.empty(len(self.face), dtype=np.int64)
        place[self.face] = np.arange(len(self.face))
        faces = place[points.faces]
        return SurfacePoints(faces, _rotated(points.barycentric, self.shift[faces]))

    def values(self, values: FloatArray | None) -> FloatArray | None:
        """Values at the vertices of the original, (V,)."""
        if values is None:
            return None
        result = np.empty_like(values)
        result[self.number] = values
        return result

    def curve(self, curve: SurfaceCurve) -> SurfaceCurve:
        """A curve of the mesh as one of the original."""
        faces = self.face[curve.faces]
        barycentric = _rotated(curve.barycentric, -self.shift[curve.faces])
        return curve_on_mesh(self.original, curve.closed, faces, barycentric, curve.control_index)


def renumbered(mesh: Mesh) -> Renumbered:
    """A mesh with the numbers that its surface gives."""
    order = np.lexsort(frame_coordinates(mesh).T[::-1])
    number = np.empty(len(order), dtype=np.int64)
    number[order] = np.arange(len(order))
    faces = number[mesh.faces]
    shift = faces.argmin(axis=1)
    faces = _rotated(faces, shift)
    face = np.lexsort(faces.T[::-1])
    return Renumbered(mesh, Mesh(mesh.vertices[order], faces[face]), number, face, shift[face])


def frame_coordinates(mesh: Mesh) -> IntArray:
    """Places of the vertices in the principal frame, in units of `RESOLUTION`, shape (V, 3)."""
    frame = principal_frame(mesh.vertices, mesh.faces, mesh.face_areas)
    axes = frame.axes
    # A symmetric surface does not say which way an axis points; the given coordinates do.
    largest = axes[np.abs(axes).argmax(axis=0), np.arange(3)]
    signs = np.where(np.abs(frame.skewness) > SYMMETRIC, frame.skewness, largest)
    axes = axes * np.where(signs < 0.0, -1.0, 1.0)
    unit = max(RESOLUTION * float(np.sqrt(mesh.face_areas.sum())), TINY)
    with np.errstate(over="ignore", invalid="ignore"):  # vertices without faces may be anywhere
        places = np.nan_to_num((mesh.vertices - frame.centre) @ axes / unit)
    return np.round(places.clip(-FARTHEST, FARTHEST)).astype(np.int64)


@dataclass(frozen=True)
class PrincipalFrame:
    """The surface's centroid, standard deviation and principal axes.

    Attributes
    ----------
    centre : (3,) float array
    deviation : float
        Root mean square distance of the surface from it.
    axes : (3, 3) float array
        An axis in each column, of either sign.
    skewness : (3,) float array
        Along each axis; positive where the surface reaches farther in its direction.
    """

    centre: FloatArray
    deviation: float
    axes: FloatArray
    skewness: FloatArray


def principal_frame(
    vertices: FloatArray, faces: IntArray, face_areas: FloatArray
) -> PrincipalFrame:
    """The frame of a surface, by the centroids and areas of its faces."""
    centroids = vertices[faces].mean(axis=1)
    share = face_areas / face_areas.sum()
    centre = share @ centroids
    offset = centroids - centre
    squares, axes = np.linalg.eigh(offset.T @ (share[:, None] * offset))
    deviation = float(np.sqrt(squares.sum()))
    skewness = share @ (offset @ axes / max(deviation, TINY)) ** 3
    return PrincipalFrame(centre, deviation, axes, skewness)


def uniform_hash(coordinates: IntArray) -> FloatArray:
    """A number between 0 and 1 for each row of whole numbers, (n,), as good as random."""
    mixed = np.zeros(len(coordinates), dtype=np.uint64)
    for column in coordinates.astype(np.uint64).T:
        mixed = (mixed ^ column) * np.uint64(0x9E3779B97F4A7C15)
        for shift, factor in ((30, 0xBF58476D1CE4E5B9), (27, 0x94D049BB133111EB)):
            mixed = (mixed ^ (mixed >> np.uint64(shift))) * np.uint64(factor)
        mixed ^= mixed >> np.uint64(31)
    return ((mixed >> np.uint64(11)).astype(np.float64) + 0.5) * 2.0**-53


Rows = TypeVar("Rows", FloatArray, IntArray)


def _rotated(rows: Rows, shift: IntArray) -> Rows:
    """Rows of three that begin with another entry."""
    place = (np.arange(3) + shift[:, None]) % 3
    return np.take_along_axis(rows, place, axis=1)
