"""Triangles that are faces of a mesh or parts of such faces."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..geometry.array_types import BoolArray, FloatArray, IntArray
from ..geometry.grouping import distinct_rows
from ..geometry.mesh import corners_differ


@dataclass(frozen=True)
class FaceParts:
    """Triangles, each a face of a given mesh or a part of one.

    Attributes
    ----------
    faces : (f, 3) int array
        Corner indices of each triangle.
    parent : (f,) int array
        The given face that contains each triangle.
    corners : (f, 3, 3) float array or None
        Barycentric coordinates of the corners of each triangle in its parent. None if every
        triangle is a whole face, with its corners in the same order.
    """

    faces: IntArray
    parent: IntArray
    corners: FloatArray | None = None

    @property
    def all_corners(self) -> FloatArray:
        """`corners`, also where they are None."""
        if self.corners is None:
            return np.broadcast_to(np.eye(3), (len(self.faces), 3, 3))
        return self.corners

    def taken(self, which: IntArray | BoolArray) -> FaceParts:
        """Some of the triangles, by indices or a mask."""
        corners = None if self.corners is None else self.corners[which]
        return FaceParts(self.faces[which], self.parent[which], corners)

    def joined(self, others: FaceParts) -> FaceParts:
        """These triangles, followed by others."""
        corners = None
        if self.corners is not None or others.corners is not None:
            corners = np.concatenate([self.all_corners, others.all_corners])
        return FaceParts(
            np.concatenate([self.faces, others.faces]),
            np.concatenate([self.parent, others.parent]),
            corners,
        )

    def renumbered(self, number: IntArray) -> FaceParts:
        """The triangles with other vertices, given the new index of each vertex."""
        return FaceParts(number[self.faces], self.parent, self.corners)

    def distinct(self) -> FaceParts:
        """The triangles with three different corners, each set of corners once, the first one."""
        faces = np.sort(self.faces, axis=1)
        whole = np.flatnonzero(corners_differ(faces))
        first = np.sort(distinct_rows(faces[whole])[0])
        return self if len(first) == len(faces) else self.taken(whole[first])

    def turned(self, which: BoolArray) -> FaceParts:
        """The triangles, some of them with the opposite orientation."""
        if not which.any():
            return self
        order = np.where(which[:, None], [0, 2, 1], [0, 1, 2])
        faces = np.take_along_axis(self.faces, order, axis=1)
        corners = np.take_along_axis(self.all_corners, order[:, :, None], axis=1)
        return FaceParts(faces, self.parent, corners)

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
        rows = np.arange(len(which))
        at_start = (self.faces[which] == start[:, None]).argmax(axis=1)
        at_end = (self.faces[which] == end[:, None]).argmax(axis=1)
        old = self.all_corners[which]
        point = (1.0 - share)[:, None] * old[rows, at_start] + share[:, None] * old[rows, at_end]
        faces, corners = self.faces.copy(), self.all_corners.copy()
        faces[which, at_end], corners[which, at_end] = middle, point
        beyond, beyond_corners = self.faces[which], old.copy()
        beyond[rows, at_start], beyond_corners[rows, at_start] = middle, point
        return FaceParts(
            np.concatenate([faces, beyond]),
            np.concatenate([self.parent, self.parent[which]]),
            np.concatenate([corners, beyond_corners]),
        )
