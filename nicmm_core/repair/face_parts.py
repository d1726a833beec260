"""Triangles that are faces of a mesh or parts of such faces, and the maps between both."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..geometry import tolerances
from ..geometry.array_types import BoolArray, FloatArray, IntArray
from ..geometry.curve import SurfaceCurve, weights_in_faces, without_small_weights
from ..geometry.grouping import distinct_rows, occurrences
from ..geometry.mesh import Mesh, corners_differ, edge_keys, side_keys
from ..geometry.surface_points import SurfacePoints


@dataclass(frozen=True)
class FaceParts:
    """Triangles, each a face of a given mesh or a part of one.

    Attributes
    ----------
    faces : (f, 3) int array
        Corner indices of each triangle.
    parent : (f,) int array
        The given face that contains each triangle.
    corners : (f, 3, 3) float array
        Barycentric coordinates of the corners of each triangle in its parent.
    """

    faces: IntArray
    parent: IntArray
    corners: FloatArray

    def taken(self, which: IntArray | BoolArray) -> FaceParts:
        """Some of the triangles, by indices or a mask."""
        return FaceParts(self.faces[which], self.parent[which], self.corners[which])

    def joined(self, others: FaceParts) -> FaceParts:
        """These triangles, followed by others."""
        return FaceParts(
            np.concatenate([self.faces, others.faces]),
            np.concatenate([self.parent, others.parent]),
            np.concatenate([self.corners, others.corners]),
        )

    def with_faces(self, faces: IntArray) -> FaceParts:
        """The triangles with other corner indices."""
        return FaceParts(faces, self.parent, self.corners)

    def distinct(self) -> FaceParts:
        """The triangles with three different corners, each set of corners once, the first one."""
        faces = np.sort(self.faces, axis=1)
        whole = np.flatnonzero(corners_differ(faces))
        first = np.sort(distinct_rows(faces[whole])[0])
        return self if len(first) == len(faces) else self.taken(whole[first])

    def turned(self, which: BoolArray) -> FaceParts:
        """The triangles, some of them with the opposite orientation."""
        order = np.where(which[:, None], [0, 2, 1], [0, 1, 2])
        faces = np.take_along_axis(self.faces, order, axis=1)
        corners = np.take_along_axis(self.corners, order[:, :, None], axis=1)
        return FaceParts(faces, self.parent, corners)

    def at_edges(self, start: IntArray, end: IntArray) -> tuple[IntArray, IntArray]:
        """Find the triangles at edges, (k,): index of the edge and triangle of each."""
        size = int(self.faces.max()) + 1
        at_ends = np.zeros(size, dtype=bool)
        at_ends[start] = at_ends[end] = True
        near = np.flatnonzero(at_ends[self.faces].sum(axis=1) >= 2)
        keys = side_keys(self.faces[near], size)
        which, side = occurrences(keys, edge_keys(start, end, size))
        return which, near[side // 3]

    def divided(
        self, which: IntArray, start: IntArray, end: IntArray, middle: IntArray, share: FloatArray
    ) -> FaceParts:
        """Divide sides of some triangles at vertices, which divides each triangle into two.

        Parameters
        ----------
        which : (k,) int array
            Triangles to divide, each at most once.
        start, end : (k,) int array
            Vertices at the two ends of the side of each.
        middle : (k,) int array
            Vertices at which the sides are divided.
        share : (k,) float array
            Position of these vertices on the sides, as fractions from the start to the end.

        Returns
        -------
        FaceParts
            The parts at the starts take the places of the triangles; those at the ends follow at
            the end.
        """
        old = self.taken(which)
        rows = np.arange(len(which))
        at_start, at_end = ((old.faces == of[:, None]).argmax(axis=1) for of in (start, end))
        weights = np.stack([1.0 - share, share], axis=1)[:, :, None]
        point = (weights * old.corners[rows[:, None], np.stack([at_start, at_end], 1)]).sum(axis=1)
        faces, corners = self.faces.copy(), self.corners.copy()
        faces[which, at_end], corners[which, at_end] = middle, point
        old.faces[rows, at_start], old.corners[rows, at_start] = middle, point
        return FaceParts(faces, self.parent, corners).joined(old)

    def in_parents(self, points: SurfacePoints) -> SurfacePoints:
        """Points of the triangles as points of the given faces."""
        weights = np.einsum("nc,ncd->nd", points.barycentric, self.corners[points.faces])
        weights /= weights.sum(axis=1, keepdims=True)
        return SurfacePoints(self.parent[points.faces], weights)

    def in_parts(self, points: SurfacePoints) -> tuple[SurfacePoints, IntArray]:
        """Points of the given faces in every triangle of their face that contains them.

        The second result is the index of the point of each, ascending.
        """
        which, part, inverse = self._inverses(points.faces)
        weights = np.einsum("nd,ndc->nc", points.barycentric[which], inverse)
        inside = weights.min(axis=1) >= -tolerances.ROUNDED
        there = SurfacePoints(part[inside], without_small_weights(weights[inside]))
        return there, which[inside]

    def through(self, mesh: Mesh, curve: SurfaceCurve) -> tuple[SurfacePoints, IntArray]:
        """Divide the segments of a curve at the sides of the triangles.

        Parameters
        ----------
        mesh : Mesh
            The given mesh.
        curve : SurfaceCurve
            A curve on it, with each point in the face of the segment that begins there.

        Returns
        -------
        SurfacePoints
            The start of each segment and each crossing, in the triangle in which the segment
            continues there. There is nothing for a segment in a face without triangles.
        (m,) int array
            Index of the segment of each of these points, ascending.
        """
        n = len(curve.faces)
        following = np.append(np.arange(1, n), 0 if curve.closed else n - 1)
        ends = weights_in_faces(
            mesh, curve.faces[following], curve.barycentric[following], curve.faces
        )
        which, part, inverse = self._inverses(curve.faces)
        first, last = (
            np.einsum("nd,ndc->nc", weights[which], inverse)
            for weights in (curve.barycentric, ends)
        )
        change = last - first
        with np.errstate(divide="ignore", invalid="ignore"):
            zero = -first / change
        outside = np.where(first < -tolerances.ROUNDED, np.inf, 0.0)
        enters = np.where(change > 0.0, zero, outside).max(axis=1).clip(0.0)
        leaves = np.where(change < 0.0, zero, np.inf).min(axis=1).clip(max=1.0)
        rows, shares = [], []
        _, begin = np.unique(which, return_index=True)
        for segment in np.split(np.arange(len(which)), begin)[1:]:
            here, nearest = 0.0, segment[first[segment].min(axis=1).argmax()]
            while True:
                ahead = segment[enters[segment] <= here + tolerances.SNAP]
                row = ahead[leaves[ahead].argmax()] if len(ahead) else nearest
                rows.append(int(row))
                shares.append(here)
                if leaves[row] >= 1.0 - tolerances.SNAP or leaves[row] <= here:
                    break
                here = float(leaves[row])
        weights = (first[rows] + np.array(shares)[:, None] * change[rows]).clip(0.0)
        return SurfacePoints(part[rows], without_small_weights(weights)), which[rows]

    def clipped(
        self, faces: IntArray, start: FloatArray, end: FloatArray
    ) -> tuple[IntArray, IntArray, FloatArray, FloatArray]:
        """The pieces of segments of the given faces in every triangle of their face.

        Parameters
        ----------
        faces : (s,) int array
            The given face of each segment.
        start, end : (s, 3) float array
            Barycentric coordinates of its ends.

        Returns
        -------
        (p,) int array
            Index of the segment of each piece, ascending.
        (p,) int array
            The triangle that contains it.
        (p, 3) float array
            Barycentric coordinates of its start in the triangle.
        (p, 3) float array
            Those of its end.
        """
        which, part, inverse = self._inverses(faces)
        first, last = (np.einsum("nd,ndc->nc", weights[which], inverse) for weights in (start, end))
        change = last - first
        with np.errstate(divide="ignore", invalid="ignore"):
            zero = -first / change
        outside = (np.abs(change) <= tolerances.ROUNDED) & (first < -tolerances.ROUNDED)
        enters = np.where(change > tolerances.ROUNDED, zero, 0.0).max(axis=1).clip(0.0)
        leaves = np.where(change < -tolerances.ROUNDED, zero, 1.0).min(axis=1).clip(max=1.0)
        inside = (enters <= leaves + tolerances.ROUNDED) & ~outside.any(axis=1)
        ends = (
            without_small_weights((first + share[:, None] * change)[inside].clip(0.0))
            for share in (enters, leaves)
        )
        return which[inside], part[inside], *ends

    def _inverses(self, faces: IntArray) -> tuple[IntArray, IntArray, FloatArray]:
        """The triangles of some given faces: index of the face, triangle, inverse of its corners.

        Triangles without area in their face are left out.
        """
        which, part = occurrences(self.parent, faces)
        corners = self.corners[part]
        sound = np.abs(np.linalg.det(corners)) > tolerances.ROUNDED
        return which[sound], part[sound], np.linalg.inv(corners[sound])


def whole_faces(faces: IntArray) -> FaceParts:
    """Faces as parts of themselves."""
    return FaceParts(faces, np.arange(len(faces)), np.broadcast_to(np.eye(3), (len(faces), 3, 3)))
