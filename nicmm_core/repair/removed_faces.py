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
        self._removed = np.flatnonzero(removed)
        corners = faces[self._removed].ravel()
        self._by_vertex = np.argsort(corners, kind="stable")
        self._vertices = corners[self._by_vertex]

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
            way: list[SurfacePoints] = []
            across: list[SurfacePoints] = []
            if number in exact:
                after, here = int(here.faces[0]), exact[number]
                if closed or number > 0:
                    way = [entered for _, entered in self._way(int(before[number]), here)]
                if closed or number < n - 1:
                    back = self._way(after, here)
                    across = [left for left, _ in back[::-1]]
                    face = int(back[-1][1].faces[0]) if back else after
                    support = self._mesh.faces[here.faces[0]][here.barycentric[0] > 0.0]
                    if not np.setdiff1d(support, self._mesh.faces[face]).size:
                        here = self._in_face(here, face)
            elif leaves[number]:
                way = [entered for _, entered in self._way(int(before[number]), here)]
            index[number] = size + len(way)
            parts += [*way, here, *across]
            size = index[number] + 1 + len(across)
        return self._without_repeats(joined(parts), index, closed)

    def _way(self, first: int, point: SurfacePoints) -> list[tuple[SurfacePoints, SurfacePoints]]:
        """Places of a point in the removed faces between a face and one that holds the point.

        Consecutive faces have a vertex or an edge at the position of the point in common. Each
        place on it is given in both of them, first in the face that is left. The list is empty if
        the first face holds the point, or if no such chain of faces leads to the point.
        """
        position = point.positions(self._mesh)[0]
        previous = {first: first}
        places: dict[int, tuple[SurfacePoints, SurfacePoints]] = {}
        queue = [first]
        for face in queue:
            if self._hold(np.array([face]), point)[0]:
                return [places[each] for each in path_between(previous, first, face)[1:]]
            for side in range(3):
                weights = self._weights_on_side(face, side, position)
                if weights is None:
                    continue
                place = SurfacePoints(np.array([face]), weights[None])
                for beyond in self._removed_at(self._faces[face][weights > 0.0].tolist()):
                    if beyond not in previous:
                        previous[beyond] = face
                        places[beyond] = place, self._in_face(place, beyond)
                        queue.append(beyond)
        return []

    def _removed_at(self, vertices: list[int]) -> list[int]:
        """The removed faces with all of one or two vertices, ascending."""
        found: list[set[int]] = []
        for vertex in vertices:
            first, last = np.searchsorted(self._vertices, [vertex, vertex + 1])
            found.append(set(self._removed[self._by_vertex[first:last] // 3].tolist()))
        return sorted(set.intersection(*found))

    def _weights_on_side(self, face: int, side: int, position: FloatArray) -> FloatArray | None:
        """Barycentric coordinates of a position on a side, (3,); None if it does not lie there."""
        start, end = self._mesh.vertices[self._mesh.faces[face, [side - 2, side - 1]]]
        way, offset = end - start, position - start
        squared = float(way @ way)
        share = min(max(float(offset @ way) / squared, 0.0), 1.0) if squared > 0.0 else 0.0
        if min(share, 1.0 - share) <= tolerances.ROUNDED:
            share = float(round(share))
        rounding = tolerances.rounding(self._mesh.vertices[self._mesh.faces[face]])
        near = max(
            2.0 * tolerances.DEGENERATE_SINE * np.sqrt(squared),
            tolerances.GAP * self._mesh.diagonal,
            rounding,
        )
        if float(np.linalg.norm(offset - share * way)) > near:
            return None
        weights = np.zeros(3)
        weights[side - 2], weights[side - 1] = 1.0 - share, share
        return weights

    def _in_face(self, point: SurfacePoints, face: int) -> SurfacePoints:
        """The same point in another face that holds it."""
        corners = self._faces[point.faces]
        weights = weights_at(corners, point.barycentric, self._faces[[face]])
        return SurfacePoints(np.array([face]), weights)

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
