"""Leads a curve across the faces without area that were removed from its mesh.

On the repaired mesh the faces on both sides of a removed face meet, so a curve passes from one to
the other at one point. On the given mesh this point lies on different edges of the removed face,
and the curve has a point on each of them, at the same position or almost.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from ..geometry import tolerances
from ..geometry.array_types import BoolArray, FloatArray, IntArray
from ..geometry.grouping import path_between
from ..geometry.mesh import Mesh
from ..geometry.surface_points import SurfacePoints, joined, weights_at

WIDEST = 2.0 * tolerances.DEGENERATE_SINE
"""Greatest distance of a point from an edge that a curve crosses there, in lengths of the edge."""


class RemovedFaces:
    """Faces of a mesh that were removed since they have no area.

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
        self._at_edge: dict[frozenset[int], list[int]] = {}
        for face in np.flatnonzero(removed).tolist():
            for side in range(3):
                self._at_edge.setdefault(self._ends(face, side), []).append(face)

    def led_across(
        self, polyline: SurfacePoints, closed: bool, exact: Mapping[int, SurfacePoints]
    ) -> tuple[SurfacePoints, IntArray]:
        """Insert points so that a polyline crosses removed faces from edge to edge.

        Parameters
        ----------
        polyline : SurfacePoints
            n points of the given mesh, each in the face of the segment that begins there.
        closed : bool
            Whether the last point is joined to the first.
        exact : mapping of int to SurfacePoints
            Points of the given mesh that take the places of some points of the polyline.

        Returns
        -------
        SurfacePoints
            The polyline with inserted points. Where no removed face joins two faces, as at a seam
            or a T-junction, none are inserted.
        (n,) int array
            New index of each point.
        """
        n = len(polyline)
        before = np.roll(polyline.faces, 1)
        if not closed:
            before[0] = polyline.faces[0]
        leaves = ~self._hold(before, polyline)
        parts: list[SurfacePoints] = []
        index = np.empty(n, dtype=np.int64)
        size = 0
        for number in range(n):
            here = polyline[number : number + 1]
            way, across = [], []
            if number in exact:
                after = int(here.faces[0])
                here = exact[number]
                own = int(here.faces[0])
                if closed or number > 0:
                    way = self._way(int(before[number]), own, here)
                if closed or number < n - 1:
                    across = self._way(own, after, here)
            elif leaves[number]:
                way = self._way(int(before[number]), int(here.faces[0]), here)[:-1]
            index[number] = size + len(way)
            parts += [*way, here, *across]
            size = index[number] + 1 + len(across)
        return self._without_repeats(joined(parts), index, closed)

    def _way(self, first: int, last: int, point: SurfacePoints) -> list[SurfacePoints]:
        """Places of a point on the edges between two faces, each in the face entered there.

        Between the two faces there are only removed faces. There is no edge if the first face holds
        the point, or if no such chain of faces joins the two.
        """
        if self._hold(np.array([first]), point)[0]:
            return []
        position = point.positions(self._mesh)[0]
        last_edges = {self._ends(last, side) for side in range(3)}
        previous = {first: first}
        through: dict[int, SurfacePoints] = {}
        queue = [first]
        for face in queue:
            if face == last:
                break
            for side in range(3):
                ends = self._ends(face, side)
                share = self._share_along(face, side, position)
                if share is None:
                    continue
                beyond = [*([last] if ends in last_edges else []), *self._at_edge.get(ends, [])]
                for other in beyond:
                    if other not in previous:
                        previous[other] = face
                        through[other] = self._on_side(face, side, share, other)
                        queue.append(other)
        if last not in previous:
            return []
        return [through[face] for face in path_between(previous, first, last)[1:]]

    def _ends(self, face: int, side: int) -> frozenset[int]:
        return frozenset((int(self._faces[face, side - 2]), int(self._faces[face, side - 1])))

    def _share_along(self, face: int, side: int, position: FloatArray) -> float | None:
        """Place of a position on a side, as a fraction; None if it does not lie on the side."""
        start, end = self._mesh.vertices[self._mesh.faces[face, [side - 2, side - 1]]]
        way, offset = end - start, position - start
        squared = float(way @ way)
        share = min(max(float(offset @ way) / squared, 0.0), 1.0) if squared > 0.0 else 0.0
        if min(share, 1.0 - share) <= tolerances.ROUNDED:
            share = float(round(share))
        away = float(np.linalg.norm(offset - share * way))
        near = max(WIDEST * np.sqrt(squared), tolerances.GAP * self._mesh.diagonal)
        return share if away <= near else None

    def _on_side(self, face: int, side: int, share: float, other: int) -> SurfacePoints:
        """A point on a side of a face, in another face with the same edge."""
        weights = np.zeros((1, 3))
        weights[0, side - 2], weights[0, side - 1] = 1.0 - share, share
        corners, others = self._faces[[face]], self._faces[[other]]
        return SurfacePoints(np.array([other]), weights_at(corners, weights, others))

    def _hold(self, faces: IntArray, points: SurfacePoints) -> BoolArray:
        """Whether each face, (n,), has all vertices of the smallest simplex with its point."""
        own = self._faces[faces]
        corners = np.where(points.barycentric > 0.0, self._faces[points.faces], own)
        return (corners[:, :, None] == own[:, None]).any(axis=2).all(axis=1)

    def _without_repeats(
        self, polyline: SurfacePoints, index: IntArray, closed: bool
    ) -> tuple[SurfacePoints, IntArray]:
        """Keep the last of consecutive points that are the same; also new indices of points."""
        n = len(polyline)
        following = polyline[(np.arange(n) + 1) % n]
        own = self._faces[polyline.faces]
        there = weights_at(self._faces[following.faces], following.barycentric, own)
        same = self._hold(polyline.faces, following) & (there == polyline.barycentric).all(axis=1)
        if not closed or same.all():
            same[-1] = False
        kept = np.flatnonzero(~same)
        # A point that is left out is the same as the next one that is kept.
        return polyline[kept], np.searchsorted(kept, index) % len(kept)
