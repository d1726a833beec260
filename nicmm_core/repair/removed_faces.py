"""Leads a curve across the faces that were removed from its mesh, and through its exact points.

On the repaired mesh the faces on both sides of a face without area meet, so a curve passes from one
to the other at one point. On the given mesh this point lies on different edges of the removed face,
and the curve has a point on each of them, at the same position or almost. A control point may lie
inside a removed face, or on one side of a gap that was closed.
"""

from __future__ import annotations

from functools import reduce
from itertools import pairwise

import numpy as np
from scipy.spatial import cKDTree

from ..geometry import tolerances
from ..geometry.array_types import BoolArray, FloatArray, IntArray
from ..geometry.crossings import meeting_segments
from ..geometry.curve import SurfaceCurve, points_of, with_points
from ..geometry.grouping import shortest_chain
from ..geometry.mesh import Mesh
from ..geometry.surface_points import (
    SurfacePoints,
    in_faces,
    joined,
    nearest_points,
    snapped,
    weights_at,
)


class RemovedFaces:
    """Faces of a mesh that were removed since they have no area, or are doubled.

    Parameters
    ----------
    mesh : Mesh
        The given mesh.
    faces : (F, 3) int array
        Its faces, with one index for all vertices that were joined.
    removed : (F,) bool array
        Which faces were removed.
    """

    def __init__(self, mesh: Mesh, faces: IntArray, removed: BoolArray) -> None:
        self._mesh, self._faces = mesh, faces
        which = np.flatnonzero(removed)
        order = np.argsort(faces[which], axis=None, kind="stable")
        self._vertices, self._at_vertex = faces[which].ravel()[order], which[order // 3]

    def led_across(self, curve: SurfaceCurve, given: SurfacePoints) -> SurfaceCurve:
        """Insert points so that a curve crosses removed faces from edge to edge.

        Where no removed face joins two faces, as at a seam or a T-junction, none are inserted.

        Parameters
        ----------
        curve : SurfaceCurve
            A curve on the mesh, with each point in the face of the segment that begins there.
        given : SurfacePoints
            The exact control points, in any order.
        """
        exact = self._with_exact_controls(curve, given)
        before, after = np.roll(curve.faces, 1), curve.faces.copy()
        if not curve.closed:
            before[0], after[-1] = exact.faces[[0, -1]]
        # Points that the face before them, or the face after them, does not hold.
        leaves = ~(self._hold(before, exact) & self._hold(after, exact)) | (exact.faces != after)
        parts: list[SurfacePoints] = []
        own: list[bool] = []
        for point in range(len(exact)):
            here, into, out = exact[point : point + 1], exact[:0], exact[:0]
            if leaves[point]:
                into = self._sides_passed(int(before[point]), here)[1]
                out, back = self._sides_passed(int(after[point]), here)
                here = self._in_face(here, int(np.append(after[point], back.faces)[-1]))
            parts += [into, here, out[::-1]]
            own += [False] * len(into) + [True] + [False] * len(out)
        passed = np.flatnonzero(own)[curve.control_index[curve.control_index >= 0]]
        polyline, number = self._without_repeats(joined(parts), passed, curve.closed)
        passed, number = number[passed], number[own]
        polyline, left = without_backtracking(self._mesh, polyline, passed, curve.closed)
        return with_points(self._mesh, curve, polyline, left[number])

    def is_simple(self, curve: SurfaceCurve) -> bool:
        """Whether a curve, led across, lies on the given mesh and does not meet itself.

        Vertices that were joined count as one. Where faces share no vertices, as at a T-junction,
        both ends of a segment lie on one face up to `tolerances.GAP`.
        """
        points = points_of(curve)
        one = np.arange(len(points) if curve.closed else len(points) - 1)
        other = (one + 1) % len(points)
        start, end = points[one], points[other]
        faces = np.where(self._hold(start.faces, end), start.faces, end.faces)
        apart = ~(self._hold(faces, start) & self._hold(faces, end))
        corners = self._faces[faces]
        weights = np.stack(
            [weights_at(self._faces[at.faces], at.barycentric, corners) for at in (start, end)]
        )
        for segment in np.flatnonzero(apart).tolist():
            found = self._near_both(points[np.array([one[segment], other[segment]])])
            if not len(found):
                return False
            faces[segment], weights[:, segment] = found.faces[0], found.barycentric
        meeting = meeting_segments(faces, *weights[:, :, :2])
        steps = np.abs(meeting[:, 0] - meeting[:, 1])
        neighbours = (steps == 1) | (curve.closed & (steps == len(one) - 1))
        return bool(neighbours.all()) and not self._passes_twice(points)

    def _near_both(self, ends: SurfacePoints) -> SurfacePoints:
        """The ends of a segment in one face on which both lie; empty if no face has both."""
        positions = ends.positions(self._mesh)
        most = max(tolerances.GAP * self._mesh.diagonal, tolerances.rounding(positions))
        used = self._faces[ends.faces][ends.barycentric > 0.0]
        with_all = (self._faces[:, :, None] == used).any(axis=1).all(axis=1)
        for face in [*np.flatnonzero(with_all).tolist(), *ends.faces.tolist()]:
            nearest, away = nearest_points(self._mesh, positions, np.array([face]))
            if (away <= most).all():
                return nearest
        return ends[:0]

    def _passes_twice(self, points: SurfacePoints) -> bool:
        """Whether two points are the same vertex, or the same place on one edge."""
        on_side = (points.barycentric == 0.0).any(axis=1)
        weights = points.barycentric[on_side]
        vertices = np.where(weights > 0.0, self._faces[points.faces[on_side]], -1)
        order = np.argsort(vertices, axis=1)
        key = [np.take_along_axis(each, order, axis=1) for each in (vertices, weights)]
        return len(np.unique(np.concatenate(key, axis=1), axis=0)) < len(weights)

    def _with_exact_controls(self, curve: SurfaceCurve, given: SurfacePoints) -> SurfacePoints:
        """The points of a curve, with exact control points where vertices were moved together."""
        passed = curve.control_index[curve.control_index >= 0]
        tree = cKDTree(given.positions(self._mesh))
        distance, nearest = tree.query(curve.points[passed])
        away = distance > tolerances.ROUNDED * self._mesh.diagonal
        faces, barycentric = curve.faces.copy(), curve.barycentric.copy()
        faces[passed[away]] = given.faces[nearest[away]]
        barycentric[passed[away]] = given.barycentric[nearest[away]]
        return SurfacePoints(faces, barycentric)

    def _sides_passed(
        self, first: int, point: SurfacePoints
    ) -> tuple[SurfacePoints, SurfacePoints]:
        """Where a curve passes from a face across removed faces to one that holds a point.

        Consecutive faces have a vertex or an edge at the position of the point in common. The place
        on each is given in the face that is left and in the face that is entered. Both are empty if
        the first face holds the point, or if no such chain of faces leads to the point.
        """
        position = point.positions(self._mesh)[0]
        chain = shortest_chain(
            first,
            lambda face: self._removed_beside(face, position),
            lambda face: bool(self._hold(np.array([face]), point)[0]),
        )
        weights = [self._removed_beside(face, position)[beyond] for face, beyond in pairwise(chain)]
        faces = np.array(chain, dtype=np.int64)
        left = SurfacePoints(faces[:-1], np.array(weights).reshape(-1, 3))
        corners = self._faces[faces]
        return left, SurfacePoints(
            faces[1:], weights_at(corners[:-1], left.barycentric, corners[1:])
        )

    def _removed_beside(self, face: int, position: FloatArray) -> dict[int, FloatArray]:
        """Removed faces at sides of a face on which a position lies, with its coordinates there."""
        corners = self._mesh.vertices[self._mesh.faces[face]]
        start, end = corners[[1, 2, 0]], corners[[2, 0, 1]]
        way, offset = end - start, position - start
        squared = (way * way).sum(axis=1)
        share = ((offset * way).sum(axis=1) / np.maximum(squared, tolerances.TINY)).clip(0.0, 1.0)
        share = np.where(np.minimum(share, 1.0 - share) <= tolerances.ROUNDED, share.round(), share)
        weights = np.stack([1.0 - share, share], axis=1)[:, :, None]
        weights = (weights * np.eye(3)[[[1, 2], [2, 0], [0, 1]]]).sum(axis=1)
        near = np.maximum(
            2.0 * tolerances.DEGENERATE_SINE * np.sqrt(squared),
            max(tolerances.GAP * self._mesh.diagonal, tolerances.rounding(corners)),
        )
        away = np.linalg.norm(offset - share[:, None] * way, axis=1)
        found: dict[int, FloatArray] = {}
        for of_side in weights[away <= near]:
            for beyond in self._removed_at(self._faces[face][of_side > 0.0]):
                found.setdefault(beyond, of_side)
        return found

    def _removed_at(self, vertices: IntArray) -> list[int]:
        """The removed faces with all of one or two vertices, ascending."""
        first, last = np.searchsorted(self._vertices, [vertices, vertices + 1])
        found = [self._at_vertex[slice(*each)] for each in zip(first, last, strict=True)]
        return np.unique(reduce(np.intersect1d, found)).tolist()

    def _in_face(self, point: SurfacePoints, face: int) -> SurfacePoints:
        """A point in another face if that has the same vertices; otherwise as it is."""
        there = in_faces(self._mesh, point, np.array([face]))
        support = self._mesh.faces[point.faces][point.barycentric > 0.0]
        return there if np.isin(support, self._mesh.faces[face]).all() else point

    def _hold(self, faces: IntArray, points: SurfacePoints) -> BoolArray:
        """Whether each face, (n,), has all vertices of the smallest simplex with its point."""
        own = self._faces[faces]
        corners = np.where(points.barycentric > 0.0, self._faces[points.faces], own)
        return (corners[:, :, None] == own[:, None]).any(axis=2).all(axis=1)

    def _without_repeats(
        self, polyline: SurfacePoints, controls: IntArray, closed: bool
    ) -> tuple[SurfacePoints, IntArray]:
        """Keep the last of consecutive points that are the same; also new indices of points.

        A control point, given by its index, also stays before a point at a vertex that was joined
        with its own.
        """
        n = len(polyline)
        following = polyline[(np.arange(n) + 1) % n]
        own = self._faces[polyline.faces]
        there = weights_at(self._faces[following.faces], following.barycentric, own)
        same = self._hold(polyline.faces, following) & (there == polyline.barycentric).all(axis=1)
        positions = polyline.positions(self._mesh)
        onward = np.roll(positions, -1, axis=0)
        same[controls] &= (positions[controls] == onward[controls]).all(axis=1)
        if not closed or same.all():
            same[-1] = False
        kept = np.flatnonzero(~same)
        # A point that is left out is the same as the next one that is kept.
        return polyline[kept], np.searchsorted(kept, np.arange(n)) % len(kept)


def points_at(mesh: Mesh, position: FloatArray, farthest: float) -> SurfacePoints:
    """The point of a mesh nearest to a position, (1, 3), in every face that contains it.

    So a point of a removed face is found on a mesh without that face. The result is empty if the
    nearest point is farther away than a face without area is wide.
    """
    nearest, distance = nearest_points(mesh, position)
    if not distance[0] <= farthest:
        return nearest[:0]
    nearest = snapped(nearest)
    faces = mesh.faces_with(mesh.faces[nearest.faces[0]][nearest.barycentric[0] > 0.0])
    return in_faces(mesh, nearest[np.zeros(len(faces), dtype=np.int64)], faces)


def without_backtracking(
    mesh: Mesh, polyline: SurfacePoints, kept: IntArray, closed: bool
) -> tuple[SurfacePoints, IntArray]:
    """Remove points at which a polyline turns back along an edge.

    Where it crosses thin faces in turn, several of its points lie on one edge, and rounding may
    change their order along it. The polyline would then touch itself.

    Parameters
    ----------
    mesh : Mesh
    polyline : SurfacePoints
        n points, each in the face of the segment that begins there.
    kept : (k,) int array
        Indices of points that stay, such as control points.
    closed : bool
        Whether the last point is joined to the first.

    Returns
    -------
    SurfacePoints
        The m points that remain.
    (n,) int array
        Index of each point among those that remain; that of the next one if it was removed.
    """
    which = np.arange(len(polyline))
    free = ~np.isin(which, kept)
    if not closed:
        free[[0, -1]] = False
    while len(which) > 3:
        turning = np.flatnonzero(_turns_back(mesh, polyline[which]) & free[which])
        if not len(turning):
            break
        which = np.delete(which, turning[0])
    return polyline[which], np.searchsorted(which, np.arange(len(polyline))) % len(which)


def _turns_back(mesh: Mesh, polyline: SurfacePoints) -> BoolArray:
    """Whether the polyline arrives at and leaves each point, (n,), on the same side of an edge."""
    corners, weights = mesh.faces[polyline.faces], polyline.barycentric
    triple = np.stack([np.roll(np.arange(len(corners)), shift) for shift in (1, 0, -1)])
    corners, weights = corners[triple], weights[triple]  # (3, n, 3)
    end = np.where(weights > 0.0, corners, -1).max(axis=(0, 2))
    start = np.where(weights > 0.0, corners, end[:, None]).min(axis=(0, 2))
    at_end = corners == end[:, None]
    on_edge = at_end | (corners == start[:, None]) | (weights <= 0.0)
    share = np.where(at_end, weights, 0.0).sum(axis=2)
    result: BoolArray = on_edge.all(axis=(0, 2)) & (
        (share[1] - share[0]) * (share[2] - share[1]) < 0.0
    )
    return result
