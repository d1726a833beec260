"""Canonical copies of components: numbered by position, in the coordinates of the principal frame.

Which of several paths of about the same length is found depends on the order in which vertices and
faces are visited, and on the last bit of their coordinates. In the copy, vertices and faces are
sorted by position in the principal frame of the vertices of the component, in whose unit its area
is about 1, and coordinates are rounded. Each axis of this frame points to where the vertices reach
farther, even if the frame is then left-handed. Faces are oriented so that the surface encloses a
positive volume with its centre. So a mesh that is renumbered, rotated, translated, scaled, mirrored
or turned over has exactly the same copy, and one with other faces between the same vertices has the
same vertices, unless a coordinate is within a rounding error of the middle between two multiples of
the resolution. Vertices without a unique principal frame, such as those of a sphere, are an
exception. Other components of the mesh make no difference.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import igl
import numpy as np

from ..progress import checkpoint
from .array_types import BoolArray, FloatArray, IntArray
from .curve import SurfaceCurve, points_of, with_points
from .grouping import distinct_rows
from .mesh import Mesh, area_vectors
from .surface_points import SurfacePoints, in_first_faces
from .tolerances import TINY

RESOLUTIONS = (1e-5, 3e-6, 1e-6, 1e-7, 1e-9)
"""Units to which coordinates are rounded, in units of the frame.

The coarser they are, the fewer coordinates of a mesh far away, or with gaps, are rounded to another
value. Finer ones are for meshes with tiny or thin faces.
"""

FINE = RESOLUTIONS[3:]
"""Those for meshes whose vertices have been moved apart by a thousandth of an edge."""

SOUND = 0.05
"""Greatest change of the area vector of a face by rounding, relative to the area of the face.

If the area vector of any face changes more, the resolution is too coarse.
"""

FARTHEST = 2.0**60
"""Bound at which rounded coordinates are clipped, in units of the resolution."""

DISTINCT = 1e-3
"""Least difference of the variances along two principal axes, relative to the total variance.

If they are closer, both axes depend on rounding errors and not only on the surface.
"""

VOLUME = 1e-6
"""Volume up to which it does not determine the orientation, as of a plane; the area is about 1.

The volume is that between the surface and its centre."""

SYMMETRIC = 1e-6
"""Skewness along an axis up to which the surface counts as symmetric in that direction."""


@dataclass(frozen=True)
class PrincipalFrame:
    """The centroid and the principal axes of a surface, or of points.

    Attributes
    ----------
    centre : (3,) float array
        Centroid.
    axes : (3, 3) float array
        Unit vectors along the axes, one in each column, each pointing to where the surface reaches
        farther. If the surface is symmetric along an axis, its largest component is positive.
    unit : float
        Square root of the area of the surface; for points, that of the sphere of the same variance.
    """

    centre: FloatArray
    axes: FloatArray
    unit: float

    def coordinates(self, positions: FloatArray) -> FloatArray:
        """Coordinates of positions, (n, 3), along the axes, in units of the frame."""
        return (positions - self.centre) @ self.axes / self.unit

    def rounded_coordinates(self, positions: FloatArray) -> IntArray:
        """The same, rounded to the first of `RESOLUTIONS`, as integers, (n, 3)."""
        with np.errstate(over="ignore"):  # vertices without faces may be anywhere
            return rounded_to_integers(self.coordinates(positions) / RESOLUTIONS[0])

    def positions(self, coordinates: FloatArray) -> FloatArray:
        """Positions from coordinates, (n, 3)."""
        return self.unit * coordinates @ self.axes.T + self.centre


@dataclass(frozen=True)
class Renumbered:
    """A mesh and the canonical copy of one of its components, with V' vertices and F' faces.

    Attributes
    ----------
    original : Mesh
        The given mesh.
    mesh : Mesh
        The copy.
    vertex : (V',) int array
        Original vertex of each vertex of the copy.
    face : (F',) int array
        Original face of each face of the copy.
    corner : (F', 3) int array
        Index, in the original face, of each corner of each face of the copy.
    frame : PrincipalFrame
        The frame in which the coordinates of the copy are given.
    """

    original: Mesh
    mesh: Mesh
    vertex: IntArray
    face: IntArray
    corner: IntArray
    frame: PrincipalFrame

    def in_original(self, positions: FloatArray) -> FloatArray:
        """Map positions on the copy, (n, 3), to the original, up to the rounding of coordinates."""
        return self.frame.positions(positions)

    def from_original(self, positions: FloatArray) -> FloatArray:
        """Map positions in the space of the original, (n, 3), to that of the copy."""
        return self.frame.coordinates(positions)

    def points_to(self, points: SurfacePoints) -> SurfacePoints:
        """Map points of the component to the copy, each in the first face that contains it."""
        return in_first_faces(self.mesh, self._in_copy(points))

    def points_back(self, points: SurfacePoints) -> SurfacePoints:
        """Map points of the copy to the original."""
        barycentric = np.empty_like(points.barycentric)
        np.put_along_axis(barycentric, self.corner[points.faces], points.barycentric, axis=1)
        return SurfacePoints(self.face[points.faces], barycentric)

    @cached_property
    def unrounded(self) -> Mesh:
        """The copy with coordinates that are not rounded, on which mirror images are exact."""
        places = self.frame.coordinates(self.original.vertices[self.vertex])
        return Mesh(places, self.mesh.faces)

    def weights_to(self, weights: FloatArray) -> FloatArray:
        """Map weights at the vertices of the original, (V,), to the vertices of the copy, (V',)."""
        return weights[self.vertex]

    def field_back(self, values: FloatArray) -> FloatArray:
        """Map lengths at the vertices of the copy, (V',), to the vertices of the original, (V,).

        Vertices outside the component get the greatest value.
        """
        result = np.full(len(self.original.vertices), values.max())
        result[self.vertex] = values
        return self.frame.unit * result

    def curve_to(self, curve: SurfaceCurve) -> SurfaceCurve | None:
        """Map a curve on the original to the copy; None if it is on another component."""
        if (self._place[curve.faces] < 0).any():
            return None
        return with_points(self.mesh, curve, self._in_copy(points_of(curve)))

    def curve_back(self, curve: SurfaceCurve) -> SurfaceCurve:
        """Map a curve on the copy to the original."""
        return with_points(self.original, curve, self.points_back(points_of(curve)))

    @cached_property
    def _place(self) -> IntArray:
        """Face of the copy of each original face, or -1, (F,)."""
        place = np.full(len(self.original.faces), -1)
        place[self.face] = np.arange(len(self.face))
        return place

    def _in_copy(self, points: SurfacePoints) -> SurfacePoints:
        """Points of the component in the faces of the copy that replace theirs."""
        faces = self._place[points.faces]
        weights = np.take_along_axis(points.barycentric, self.corner[faces], axis=1)
        return SurfacePoints(faces, weights)


def renumbered(mesh: Mesh, component: int = 0, apart: bool = False) -> Renumbered:
    """Make the canonical copy of a component of a mesh.

    Parameters
    ----------
    mesh : Mesh
    component : int
    apart : bool
        Whether vertices have been moved by so little that coarse rounding would undo it.
    """
    inside = np.flatnonzero(mesh.face_component == component)
    used = np.bincount(mesh.faces[inside].ravel(), minlength=len(mesh.vertices)) > 0
    vertex, faces = np.flatnonzero(used), (np.cumsum(used) - 1)[mesh.faces[inside]]
    frame = frame_of_points(mesh.vertices[vertex])
    checkpoint()
    places = frame.coordinates(mesh.vertices[vertex])
    places, integers = _rounded_soundly(places, faces, apart)
    order = np.lexsort(integers.T[::-1])
    checkpoint()
    faces = np.argsort(order)[faces]
    corner = (np.arange(3) + faces.argmin(axis=1)[:, None]) % 3
    low, middle, high = np.sort(faces, axis=1).T
    face = np.lexsort((high, low * len(order) + middle))
    places, faces, corner = places[order], faces[face], corner[face]
    turned = _turned(mesh, places, np.take_along_axis(faces, corner, axis=1))
    corner[turned] = corner[turned][:, [0, 2, 1]]
    copy = Mesh(places, np.take_along_axis(faces, corner, axis=1))
    return Renumbered(mesh, copy, vertex[order], inside[face], corner, frame)


def _turned(mesh: Mesh, vertices: FloatArray, faces: IntArray) -> BoolArray:
    """Faces of a copy to turn over, so that its orientation depends only on the surface, (F',).

    Parameters
    ----------
    mesh : Mesh
        The given mesh, whose orientable components are consistently oriented.
    vertices, faces : (V', 3) float array, (F', 3) int array
        The copy in the orientation of the given mesh. The area is about 1. Each face begins at its
        vertex of lowest index.
    """
    rising = faces[:, 1] < faces[:, 2]
    wanted = rising
    if not mesh.is_oriented:
        # The component may not be orientable. The result has to be the same for any given faces.
        found = igl.bfs_orient(np.sort(faces, axis=1))[0]
        after_lowest = (found.argmin(axis=1) + 1) % 3
        wanted = found[np.arange(len(found)), after_lowest] == np.sort(faces, axis=1)[:, 1]
    heights = np.einsum("fd,fd->f", area_vectors(vertices, faces), vertices[faces[:, 0]])
    volume = float(np.where(wanted == rising, heights, -heights).sum()) / 6.0
    inward = volume < 0.0 if abs(volume) > VOLUME else not wanted[0]
    return rising == wanted if inward else rising != wanted


def _rounded_soundly(
    places: FloatArray, faces: IntArray, apart: bool
) -> tuple[FloatArray, IntArray]:
    """Coordinates, (n, 3), rounded as coarsely as the faces allow; the same as integers.

    They are not rounded if the faces allow no resolution. If vertices have been moved apart, only
    the finest resolutions that keep them apart are allowed.
    """
    before = area_vectors(places, faces)
    greatest = SOUND * np.linalg.norm(before, axis=1)
    for resolution in FINE if apart else RESOLUTIONS:
        integers = rounded_to_integers(places / resolution)
        rounded = resolution * integers
        change = area_vectors(rounded, faces) - before
        if (np.linalg.norm(change, axis=1) > greatest).any():
            continue
        if not apart or len(distinct_rows(rounded)[0]) == len(distinct_rows(places)[0]):
            return rounded, integers
    return places, integers


def rounded_to_integers(coordinates: FloatArray) -> IntArray:
    """Coordinates, of any shape, rounded to integers; those beyond a far bound are clipped."""
    return np.round(coordinates.clip(-FARTHEST, FARTHEST)).astype(np.int64)


def principal_frame(
    vertices: FloatArray, faces: IntArray, face_areas: FloatArray
) -> PrincipalFrame:
    """Compute the principal frame of a surface from the first three moments of its area."""
    area = face_areas.sum()
    share = face_areas / area
    at_vertices = np.bincount(faces.ravel(), np.repeat(share / 3.0, 3), len(vertices))
    centre = at_vertices @ vertices
    offset = vertices - centre
    total = sum(np.take(offset, corner, axis=0) for corner in faces.T)
    # The mean of x xᵀ over a face with the corners a, b, c is (aaᵀ + bbᵀ + ccᵀ + ttᵀ) / 12, where
    # t = a + b + c.
    moments = 0.25 * (offset.T @ (at_vertices[:, None] * offset))
    moments += total.T @ (share[:, None] * total) / 12.0
    squares, eigenvectors = np.linalg.eigh(moments)
    axes = _settled(squares, eigenvectors)
    deviation = float(np.sqrt(squares.sum()))
    along, total = offset @ axes / max(deviation, TINY), total @ axes / max(deviation, TINY)
    # Likewise, the mean of x³ is (t³ + 3 t (a² + b² + c²) + 2 (a³ + b³ + c³)) / 60.
    squared = along * along
    at_corners = sum(np.take(squared, corner, axis=0) for corner in faces.T)
    skewness = share @ (total * (total * total + 3.0 * at_corners)) / 60.0
    skewness += 0.1 * (at_vertices @ (squared * along))
    return PrincipalFrame(centre, _pointing(axes, skewness), max(float(np.sqrt(area)), TINY))


def frame_of_points(positions: FloatArray) -> PrincipalFrame:
    """Compute the principal frame of points, (n, 3), all with the same weight."""
    centre = positions.mean(axis=0)
    offset = positions - centre
    squares, eigenvectors = np.linalg.eigh(offset.T @ offset / len(positions))
    axes, deviation = _settled(squares, eigenvectors), float(np.sqrt(squares.sum()))
    skewness = ((offset @ axes / max(deviation, TINY)) ** 3).mean(axis=0)
    return PrincipalFrame(
        centre, _pointing(axes, skewness), max(float(np.sqrt(4.0 * np.pi)) * deviation, TINY)
    )


def _pointing(axes: FloatArray, skewness: FloatArray) -> FloatArray:
    """Axes, one in each column, each in the direction in which the skewness is positive.

    Without skewness, the largest component is positive.
    """
    largest = axes[np.abs(axes).round(6).argmax(axis=0), np.arange(3)]
    signs = np.where(np.abs(skewness) > SYMMETRIC, skewness, largest)
    return axes * np.where(signs < 0.0, -1.0, 1.0)


def _settled(squares: FloatArray, axes: FloatArray) -> FloatArray:
    """Principal axes, (3, 3), from ascending variances, (3,), and eigenvectors in the columns.

    If variances are equal, any axes in the space of their eigenvectors are principal axes. Those
    nearest to the coordinate axes are taken, so the numbering of the mesh makes no difference.
    """
    apart = np.diff(squares) > DISTINCT * squares.sum()
    result = np.empty((3, 3))
    for space in np.split(np.arange(3), np.flatnonzero(apart) + 1):
        projector = axes[:, space] @ axes[:, space].T
        for column in space:
            longest = np.linalg.norm(projector, axis=0).round(6).argmax()
            axis = projector[:, longest] / np.linalg.norm(projector[:, longest])
            result[:, column] = axis
            projector = projector - np.outer(axis, axis @ projector)
    return result


def uniform_hash(coordinates: IntArray) -> FloatArray:
    """A pseudo-random number between 0 and 1 for each row of integers, (n,)."""
    mixed = np.zeros(len(coordinates), dtype=np.uint64)
    for column in coordinates.astype(np.uint64).T:
        mixed = (mixed ^ column) * np.uint64(0x9E3779B97F4A7C15)
        for shift, factor in ((30, 0xBF58476D1CE4E5B9), (27, 0x94D049BB133111EB)):
            mixed = (mixed ^ (mixed >> np.uint64(shift))) * np.uint64(factor)
        mixed ^= mixed >> np.uint64(31)
    return ((mixed >> np.uint64(11)).astype(np.float64) + 0.5) * 2.0**-53
