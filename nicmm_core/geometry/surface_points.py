"""Points on a mesh, each as a face and barycentric coordinates.

`locate_control_points` and `locate_points` convert all forms in which callers give points, and
check them. `nearest_points` and `first_hits` project positions and rays onto the mesh.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import igl
import numpy as np
from numpy.typing import ArrayLike
from scipy.spatial import cKDTree

from ..errors import ControlPointError, PointName, UnreachableError
from ..options import FEWEST_CLOSED, FEWEST_OPEN
from . import tolerances
from .array_types import BoolArray, FloatArray, IntArray
from .mesh import Mesh, face_tree, real_array
from .vectors import dot


@dataclass(frozen=True)
class SurfacePoints:
    """Points on a mesh, each in one of its faces.

    Attributes
    ----------
    faces : (k,) int array
        Face in which each point lies.
    barycentric : (k, 3) float array
        Coordinates in that face, in the order of its corners; not negative, with sum 1.
    """

    faces: IntArray
    barycentric: FloatArray

    def positions(self, mesh: Mesh) -> FloatArray:
        """Positions of the points in space, shape (k, 3)."""
        corners = mesh.vertices.take(mesh.faces.take(self.faces, axis=0), axis=0)
        # The axes become corner, component and point.
        corners = corners.transpose(1, 2, 0).copy()
        return dot(self.barycentric.T[:, None], corners).T

    @property
    def for_kernels(self) -> tuple[IntArray, FloatArray]:
        """Faces and coordinates as compiled kernels read them."""
        # Where integers have 32 bits by default, as in NumPy 1 on Windows, indices may have, too.
        return np.ascontiguousarray(self.faces, np.int64), np.ascontiguousarray(self.barycentric)

    def __len__(self) -> int:
        return len(self.faces)

    def __repr__(self) -> str:
        return f"<SurfacePoints: {len(self)} points>"

    def __getitem__(self, index: IntArray | BoolArray | slice) -> SurfacePoints:
        """A subset of the points, by an array of indices, a mask or a slice."""
        if isinstance(index, slice):
            return SurfacePoints(self.faces[index], self.barycentric[index])
        which = np.flatnonzero(index) if index.dtype == bool else index
        return SurfacePoints(self.faces.take(which), self.barycentric.take(which, axis=0))


def locate_control_points(
    mesh: Mesh, control_points: ArrayLike | SurfacePoints, closed: bool, connected: bool = True
) -> SurfacePoints:
    """Convert any accepted form of control points to `SurfacePoints`, and check them.

    Parameters
    ----------
    mesh : Mesh
    control_points : (k,) int array_like, (k, 3) float array_like or SurfacePoints
        Vertex indices, points on the surface, or faces with barycentric coordinates.
    closed : bool
        Whether the curve is closed. A closed curve needs three points, an open curve two.
    connected : bool
        Whether points on different components of the mesh are refused.

    Returns
    -------
    SurfacePoints
        The points, with coordinates below `tolerances.SNAP` set to exactly zero, and all rounded to
        multiples of `tolerances.BARYCENTRIC_UNIT`.

    Raises
    ------
    ControlPointError
        If there are too few points, or a point is repeated, out of range or off the surface.
    UnreachableError
        If the points lie on different components of the mesh.
    """
    points = locate_points(mesh, control_points, "control_points")
    check_count(len(points), closed)
    check_distinct(mesh, points, control_point_names(np.arange(len(points))))
    if connected:
        check_connected(mesh, points)
    return points


def control_point_names(controls: IntArray) -> list[PointName]:
    """Names of control points in error messages, from their indices."""
    return [PointName("control_points", index) for index in controls.tolist()]


def check_connected(mesh: Mesh, points: SurfacePoints) -> None:
    """Raise UnreachableError if control points lie on different components."""
    check_one_component(mesh, points, control_point_names(np.arange(len(points))))


def locate_points(mesh: Mesh, given: ArrayLike | SurfacePoints, name: str) -> SurfacePoints:
    """Convert any number of points to `SurfacePoints`, and check each of them.

    Parameters
    ----------
    mesh : Mesh
    given : (k,) int array_like, (k, 3) float array_like or SurfacePoints
        Vertex indices, points on the surface, or faces with barycentric coordinates.
    name : str
        Name of the argument in error messages.

    Returns
    -------
    SurfacePoints
        The points, with coordinates below `tolerances.SNAP` set to exactly zero, and all rounded to
        multiples of `tolerances.BARYCENTRIC_UNIT`.

    Raises
    ------
    ControlPointError
        If a point is out of range or off the surface.
    """
    if isinstance(given, SurfacePoints):
        return snapped(_checked_surface_points(mesh, given, name))
    try:
        values = np.asarray(given)
    except ValueError as error:
        raise ControlPointError(f"{name} is ragged ({error}); {_FORMS}") from error
    if values.size == 0:
        return SurfacePoints(np.zeros(0, np.int64), np.zeros((0, 3)))
    if values.ndim == 1 and np.issubdtype(values.dtype, np.integer):
        return snapped(_points_at_vertices(mesh, values.astype(np.int64), name))
    if values.ndim == 2 and values.shape[1] == 3 and values.dtype.kind in "iuf":
        return snapped(_points_in_space(mesh, values.astype(np.float64), name))
    raise ControlPointError(f"{name} has shape {values.shape} and type {values.dtype}; {_FORMS}")


_FORMS = "pass vertex indices (k,), points on the surface (k, 3) or SurfacePoints"


def _checked_surface_points(mesh: Mesh, given: SurfacePoints, name: str) -> SurfacePoints:
    try:
        faces = np.asarray(given.faces)
        barycentric = real_array(given.barycentric)
    except (TypeError, ValueError) as error:
        raise ControlPointError(f"{name} cannot be read ({error}); {_FORMS}") from error
    if faces.ndim != 1 or not (faces.size == 0 or np.issubdtype(faces.dtype, np.integer)):
        raise ControlPointError(
            f"{name}.faces has shape {faces.shape} and type {faces.dtype}; pass face "
            "indices of shape (k,)"
        )
    if barycentric.shape != (len(faces), 3):
        raise ControlPointError(
            f"{name}.barycentric has shape {barycentric.shape}; pass ({len(faces)}, 3), "
            "one row per point"
        )
    _check_range(f"{name}.faces", faces, len(mesh.faces), "faces")
    with np.errstate(over="ignore", invalid="ignore"):  # such values are refused below
        sums = barycentric.sum(axis=1)
    bad = (
        ~np.isfinite(barycentric).all(axis=1)
        | (barycentric < -tolerances.SNAP).any(axis=1)
        | ~(np.abs(sums - 1.0) <= tolerances.BARYCENTRIC_SUM)
    )
    if bad.any():
        first = int(bad.argmax())
        raise ControlPointError(
            f"{name}.barycentric[{first}] = {barycentric[first].tolist()} is not a point of "
            "its face; coordinates must not be negative and must sum to 1"
        )
    return SurfacePoints(faces.astype(np.int64), barycentric)


def _points_at_vertices(mesh: Mesh, indices: IntArray, name: str) -> SurfacePoints:
    _check_range(name, indices, len(mesh.vertices), "vertices")
    loose = ~mesh.referenced[indices]
    if loose.any():
        first = PointName(name, int(loose.argmax()))
        raise ControlPointError(
            f"{first} = {indices[loose][0]} is a vertex that no face uses, so it is off the "
            "surface; choose a vertex of a face",
            first,
        )
    around = mesh.vertex_faces
    faces = around.indices[around.indptr[indices]].astype(np.int64)
    barycentric = (mesh.faces[faces] == indices[:, None]).astype(np.float64)
    return SurfacePoints(faces, barycentric)


def _points_in_space(mesh: Mesh, positions: FloatArray, name: str) -> SurfacePoints:
    bad = ~np.isfinite(positions).all(axis=1)
    if bad.any():
        first = PointName(name, int(bad.argmax()))
        raise ControlPointError(f"{first} is NaN or infinite; pass finite positions", first)
    # A point far outside the bounding box is far from the surface. Its nearest point is not
    # computed, since its squared distances might overflow.
    corners = mesh.vertices[mesh.referenced]
    beyond = np.maximum(corners.min(axis=0) - positions, positions - corners.max(axis=0))
    distance = beyond.max(axis=1)
    if (distance <= tolerances.ON_SURFACE * mesh.diagonal).all():
        points, distance = nearest_points(mesh, positions)
    off = distance > tolerances.ON_SURFACE * mesh.diagonal
    if off.any():
        first = PointName(name, int(off.argmax()))
        raise ControlPointError(
            f"{first} is off the surface by at least {distance[first.index]:.3g}, more than "
            f"{tolerances.ON_SURFACE:g} of the mesh's diagonal; project it onto the mesh first",
            first,
        )
    return points


def nearest_points(
    mesh: Mesh, positions: FloatArray, among: IntArray | None = None
) -> tuple[SurfacePoints, FloatArray]:
    """Find the points of a mesh nearest to positions.

    Parameters
    ----------
    mesh : Mesh
    positions : (k, 3) float array
        Positions in space.
    among : (q,) int array, optional
        Faces to search, by default all.

    Returns
    -------
    SurfacePoints
        Nearest points. In a face without area, they are on its longest edge.
    (k,) float array
        Distances, in mesh units; infinite where their squares overflow.
    """
    trees = (
        mesh.face_trees if among is None else [(among, face_tree(mesh.vertices, mesh.faces[among]))]
    )
    squared = np.full(len(positions), np.inf)
    faces = np.zeros(len(positions), dtype=np.int64)
    places = np.zeros((len(positions), 3))
    for part, tree in trees:
        found = tree.squared_distance(mesh.vertices, mesh.faces[part], positions)
        nearer = np.atleast_1d(found[0]) < squared
        squared[nearer] = np.atleast_1d(found[0])[nearer]
        faces[nearer] = part[np.atleast_1d(found[1])[nearer]]
        places[nearer] = np.atleast_2d(found[2])[nearer]
    corners = mesh.vertices[mesh.faces[faces]]
    barycentric = igl.barycentric_coordinates(places, *np.ascontiguousarray(corners.swapaxes(0, 1)))
    for flat in np.flatnonzero(~np.isfinite(barycentric).all(axis=1)):
        barycentric[flat] = _on_longest_edge(corners[flat], positions[flat])
    barycentric = np.clip(barycentric, 0.0, None)
    return SurfacePoints(faces, barycentric / barycentric.sum(axis=1, keepdims=True)), np.sqrt(
        squared
    )


def _on_longest_edge(corners: FloatArray, position: FloatArray) -> FloatArray:
    """Barycentric coordinates of the nearest point on the longest edge of a degenerate triangle."""
    sides = np.roll(corners, -1, axis=0) - corners
    start = int(np.linalg.norm(sides, axis=1).argmax())
    squared = max(sides[start] @ sides[start], tolerances.TINY)
    along = np.clip((position - corners[start]) @ sides[start] / squared, 0.0, 1.0)
    barycentric = np.zeros(3)
    barycentric[start], barycentric[(start + 1) % 3] = 1.0 - along, along
    return barycentric


def first_hits(
    mesh: Mesh, origins: FloatArray, directions: FloatArray
) -> tuple[SurfacePoints, FloatArray]:
    """Find the first intersections of rays with a mesh, from either side of its faces.

    Parameters
    ----------
    mesh : Mesh
    origins, directions : (k, 3) float array
        Starting points and directions of the rays.

    Returns
    -------
    SurfacePoints
        Points hit; the face is -1 if a ray misses the mesh.
    (k,) float array
        Distances along the rays, in lengths of their directions; infinite if a ray misses the mesh.
    """
    rays = [np.ascontiguousarray(ends, dtype=np.float64) for ends in (origins, directions)]
    faces, along = np.full(len(origins), -1), np.full(len(origins), np.inf)
    places = np.zeros((len(origins), 2))
    for part, tree in mesh.face_trees:
        of_part = tree.intersect_ray_first(mesh.vertices, mesh.faces[part], *rays)
        sooner = (of_part[0] >= 0) & (of_part[1] < along)
        faces[sooner] = part[of_part[0][sooner]]
        along[sooner], places[sooner] = of_part[1][sooner], of_part[2][sooner]
    barycentric = np.stack([1.0 - places.sum(axis=1), *places.T], axis=1).clip(0.0)
    barycentric /= barycentric.sum(axis=1, keepdims=True)
    return SurfacePoints(faces, barycentric), along


def _check_range(name: str, indices: IntArray, limit: int, kind: str) -> None:
    outside = (indices < 0) | (indices >= limit)
    if outside.any():
        first = PointName(name, int(outside.argmax()))
        raise ControlPointError(
            f"{first} = {indices[first.index]} is out of range; the mesh has {limit} {kind}, "
            f"so indices must lie in 0 … {limit - 1}",
            first,
        )


def check_count(count: int, closed: bool, kind_of_points: str = "") -> None:
    """Raise ControlPointError if a curve needs more points."""
    fewest = FEWEST_CLOSED if closed else FEWEST_OPEN
    if count < fewest:
        kind = "a closed" if closed else "an open"
        number = f"{count} point" if count == 1 else f"{count} points"
        raise ControlPointError(
            f"control_points has {number}{kind_of_points}, too few; {kind} curve needs at least "
            f"{fewest}"
        )


def snapped(points: SurfacePoints) -> SurfacePoints:
    """The points, with coordinates below `tolerances.SNAP` set to exactly zero, and all rounded."""
    barycentric = np.where(points.barycentric < tolerances.SNAP, 0.0, points.barycentric)
    barycentric /= barycentric.sum(axis=1, keepdims=True)
    unit = tolerances.BARYCENTRIC_UNIT
    barycentric = np.rint(barycentric / unit) * unit
    row, greatest = np.arange(len(barycentric)), barycentric.argmax(axis=1)
    barycentric[row, greatest] += 1.0 - barycentric.sum(axis=1)  # exact, so the sum is exactly 1
    return SurfacePoints(points.faces, barycentric)


def check_distinct(mesh: Mesh, points: SurfacePoints, names: list[PointName]) -> None:
    """Raise ControlPointError if two points coincide."""
    same, nearest = _nearest_others(mesh, points)
    if same.any():
        first = int(same.argmax())
        second = int(nearest[first])
        raise ControlPointError(
            f"{names[first]} and {names[second]} are the same point; "
            "remove one of them (a closed curve returns to its first point by itself)",
            names[first],
            names[second],
        )


def coincide(mesh: Mesh, points: SurfacePoints) -> bool:
    """Whether any two points coincide."""
    return bool(_nearest_others(mesh, points)[0].any())


def _nearest_others(mesh: Mesh, points: SurfacePoints) -> tuple[BoolArray, IntArray]:
    """Whether each point, (k,), coincides with another one, and the index of the nearest other."""
    # The nearest point is the point itself, so two are requested.
    positions = points.positions(mesh)
    distance, found = cKDTree(positions).query(positions, k=2)
    nearest = np.where(found[:, 0] == np.arange(len(points)), found[:, 1], found[:, 0])
    return distance[:, 1] <= tolerances.COINCIDENT * mesh.diagonal, nearest.astype(np.int64)


def check_one_component(mesh: Mesh, points: SurfacePoints, names: list[PointName]) -> None:
    """Raise UnreachableError if points lie on different components."""
    component = mesh.face_component[points.faces]
    other = component != component[0]
    if other.any():
        apart = names[int(other.argmax())]
        raise UnreachableError(
            f"{names[0]} and {apart} lie on different components of the mesh, so no curve joins "
            "them; join the components, or merge vertices by distance if only tiny gaps separate "
            "them",
            names[0],
            apart,
        )


def joined(parts: Sequence[SurfacePoints]) -> SurfacePoints:
    """Concatenate sequences of points."""
    return SurfacePoints(
        np.concatenate([np.zeros(0, np.int64), *(part.faces for part in parts)]),
        np.concatenate([np.zeros((0, 3)), *(part.barycentric for part in parts)]),
    )


def in_faces(mesh: Mesh, points: SurfacePoints, faces: IntArray) -> SurfacePoints:
    """The same points, expressed in other faces that contain them."""
    weights = weights_at(mesh.faces[points.faces], points.barycentric, mesh.faces[faces])
    return SurfacePoints(faces, weights)


def in_first_faces(mesh: Mesh, points: SurfacePoints) -> SurfacePoints:
    """The same points, each in the face of lowest index that contains it."""
    faces = points.faces.copy()
    for number in np.flatnonzero((points.barycentric == 0.0).any(axis=1)).tolist():
        support = mesh.faces[faces[number]][points.barycentric[number] > 0.0]
        faces[number] = mesh.faces_with(support)[0]
    return in_faces(mesh, points, faces)


def weights_at(corners: IntArray, barycentric: FloatArray, others: IntArray) -> FloatArray:
    """Barycentric coordinates of points with respect to other vertices.

    Parameters
    ----------
    corners : (n, 3) int array
        Vertices of a face that contains each point.
    barycentric : (n, 3) float array
        Coordinates with respect to these vertices.
    others : (n, m) int array
        Vertices for which coordinates are wanted.

    Returns
    -------
    (n, m) float array
        Coordinates with respect to ``others``; zero at vertices that are not among the corners,
        and at repetitions of a vertex, as faces have whose vertices were joined.
    """
    columns = others.T
    same = corners.T[:, None] == columns
    for apart in range(1, len(columns)):
        same[:, apart:] &= columns[:-apart] != columns[apart:]
    return dot(barycentric.T[:, None], same).T
