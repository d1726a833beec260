"""Exact distances along the surface from segments that lie in faces, up to a limit.

Shortest paths from a segment are straight lines across unfolded faces. Faces on the way from a
segment are unfolded into one plane, with the interval of the last edge through which such lines
pass, as in Mitchell, Mount and Papadimitriou ("The discrete geodesic problem", 1987). Intervals of
different segments may overlap: they are not trimmed against each other, and the least of their
distances counts. Intervals that no shortest path enters are removed with the criterion of Xin and
Wang ("Improving Chen and Han's algorithm on the discrete geodesic problem", 2009). All intervals
that are equally many faces away from their segments are extended together. The cost follows the
surface within the limit, not the size of the mesh.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ..progress import checkpoint
from . import tolerances
from .array_types import BoolArray, FloatArray, IntArray
from .grouping import occurrences
from .mesh import Mesh
from .surface_points import SurfacePoints

MOST_FACES = 4096
"""Maximum number of faces on the way of a line; a longer line spirals around a point."""


@dataclass(frozen=True)
class FaceSegments:
    """Segments, each in one face.

    Attributes
    ----------
    faces : (s,) int array
    start, end : (s, 3) float array
        Barycentric coordinates of the two ends.
    """

    faces: IntArray
    start: FloatArray
    end: FloatArray

    def __len__(self) -> int:
        return len(self.faces)

    def taken(self, which: BoolArray) -> FaceSegments:
        """Some of the segments."""
        return FaceSegments(self.faces[which], self.start[which], self.end[which])

    def positions(self, mesh: Mesh) -> tuple[FloatArray, FloatArray]:
        """Positions of both ends, (s, 3)."""
        start, end = (SurfacePoints(self.faces, ends) for ends in (self.start, self.end))
        return start.positions(mesh), end.positions(mesh)


def joined_segments(parts: Sequence[FaceSegments]) -> FaceSegments:
    """Concatenate segments."""
    return FaceSegments(
        np.concatenate([np.zeros(0, np.int64), *(part.faces for part in parts)]),
        np.concatenate([np.zeros((0, 3)), *(part.start for part in parts)]),
        np.concatenate([np.zeros((0, 3)), *(part.end for part in parts)]),
    )


@dataclass(frozen=True)
class _Intervals:
    """Intervals of edges, each seen from a segment in the plane of the face beyond the edge.

    The edge is opposite a corner of this face. It runs along the x axis from the next corner, at
    the origin, to the one after. The face has y > 0, the segment y <= 0.

    Attributes
    ----------
    side : (n,) int array
        Side 3 f + j of the face beyond.
    start, end : (n, 2) float array
        Ends of the segment, which coincide for a point.
    before : (n,) float array
        Distance of the segment itself.
    low, high : (n,) float array
        Ends of the interval on the edge.
    """

    side: IntArray
    start: FloatArray
    end: FloatArray
    before: FloatArray
    low: FloatArray
    high: FloatArray

    def __len__(self) -> int:
        return len(self.side)

    def taken(self, which: IntArray | BoolArray) -> _Intervals:
        """Some of the intervals."""
        return _Intervals(*(values[which] for values in vars(self).values()))


def _joined(parts: list[_Intervals]) -> _Intervals:
    """The intervals of a list that is not empty."""
    return _Intervals(*map(np.concatenate, zip(*(vars(p).values() for p in parts), strict=True)))


class SegmentDistances:
    """Distances from segments on a manifold.

    Parameters
    ----------
    mesh : Mesh
        A manifold whose faces all have an area.
    segments : FaceSegments
    limit : float
        Distance up to which distances are computed, in mesh units.

    Attributes
    ----------
    at_vertices : (V,) float array
        Distance of each vertex. Greater distances than the limit may be too great or infinite.
    """

    def __init__(self, mesh: Mesh, segments: FaceSegments, limit: float) -> None:
        self.mesh, self.segments, self.limit = mesh, segments, limit
        self.at_vertices = np.full(len(mesh.vertices), np.inf)
        self._scale = 64.0 * float(np.finfo(np.float64).eps) * mesh.diagonal
        self._found: list[_Intervals] = []
        self._propagate()
        self._intervals = _joined(self._found)

    @property
    def faces_reached(self) -> BoolArray:
        """Whether each face may have points within the limit, (F,)."""
        reached = (self.at_vertices < self.limit)[self.mesh.faces].any(axis=1)
        reached[self.segments.faces] = reached[self._intervals.side // 3] = True
        return reached

    def at(self, points: SurfacePoints) -> FloatArray:
        """Distance of points, (n,); greater ones than the limit may be too great or infinite."""
        checkpoint()
        mesh, segments, intervals = self.mesh, self.segments, self._intervals
        corners = mesh.faces[points.faces]
        positions = points.positions(mesh)
        to_corner = np.linalg.norm(mesh.vertices[corners] - positions[:, None], axis=2)
        distance = (self.at_vertices[corners] + to_corner).min(axis=1)

        point, segment = occurrences(segments.faces, points.faces)
        start, end = (ends[segment] for ends in segments.positions(mesh))
        away = positions[point] - _nearest(positions[point], start, end)
        np.minimum.at(distance, point, np.linalg.norm(away, axis=1))

        point, which = occurrences(intervals.side // 3, points.faces)
        seen = intervals.taken(which)
        flat = _placed(_triangles(mesh, seen.side), seen.side, points.barycentric[point])
        np.minimum.at(distance, point, self._distance_if_seen(seen, flat))
        return distance

    def _propagate(self) -> None:
        """Find all intervals, and the distances of the vertices."""
        mesh, distance = self.mesh, self.at_vertices
        intervals = self._from_segments()
        # Lines also begin at ends of segments that are vertices.
        bent = self._bent_vertices() | (distance <= self._scale)
        begun = np.full(len(distance), np.inf)  # distances at which lines begin at vertices
        for _ in range(MOST_FACES):
            checkpoint()
            while True:
                begins = bent & (distance < np.minimum(begun - self._scale, self.limit))
                before = distance.copy()
                self._lower_around(np.flatnonzero(begins))
                if not (bent & (distance < before - self._scale)).any():
                    break
            begun[begins] = distance[begins]
            intervals = _joined([intervals, self._from_vertices(np.flatnonzero(begins))])
            intervals = self._useful(intervals)
            self._found.append(intervals)
            if not len(intervals):
                break
            before = distance.copy()
            triangles = _triangles(mesh, intervals.side)
            apex = mesh.faces.ravel()[intervals.side]
            np.minimum.at(distance, apex, self._distance_if_seen(intervals, triangles[:, 2]))
            self._lower_around(np.flatnonzero(distance < before - self._scale))
            intervals = self._beyond(intervals, triangles)
        # Corners that no line reaches get a finite distance along edges.
        reached = np.unique(mesh.faces[np.unique(_joined(self._found).side // 3)])
        while len(reached):
            before = distance.copy()
            self._lower_around(reached)
            reached = np.flatnonzero(distance < before - self._scale)
            reached = reached[distance[reached] < 2.0 * self.limit]

    def _from_segments(self) -> _Intervals:
        """The sides of the faces of the segments, and the distances of the corners."""
        mesh, segments = self.mesh, self.segments
        corners = mesh.faces[segments.faces]
        start, end = segments.positions(mesh)
        for corner in corners.T:
            place = mesh.vertices[corner]
            away = np.linalg.norm(place - _nearest(place, start, end), axis=1)
            np.minimum.at(self.at_vertices, corner, away)
        parts = [
            self._across(
                3 * segments.faces + side,
                segments.start,
                segments.end,
                np.zeros(len(segments)),
            )
            for side in range(3)
        ]
        return _joined(parts)

    def _from_vertices(self, vertices: IntArray) -> _Intervals:
        """The sides opposite some vertices, with the vertices as segments of length zero."""
        mesh = self.mesh
        around = mesh.vertex_faces[vertices]
        vertex = vertices.repeat(np.diff(around.indptr))
        faces = around.indices.astype(np.int64)
        weights = (mesh.faces[faces] == vertex[:, None]).astype(np.float64)
        return self._across(
            3 * faces + weights.argmax(axis=1), weights, weights, self.at_vertices[vertex]
        )

    def _across(
        self, side: IntArray, start: FloatArray, end: FloatArray, before: FloatArray
    ) -> _Intervals:
        """Whole sides of faces as intervals in the faces beyond, seen from segments in them."""
        mesh = self.mesh
        triangles = _triangles(mesh, side)
        ends = np.stack([_placed(triangles, side, weights) for weights in (start, end)], axis=1)
        low, high = np.zeros(len(side)), triangles[:, 1, 0]
        # In the frame of the face itself, its interior has y > 0.
        return self._entered(side, triangles[:, :2], triangles[:, 2], ends, before, low, high)

    def _beyond(self, intervals: _Intervals, triangles: FloatArray) -> _Intervals:
        """The intervals on the other two sides of the faces that intervals lead into."""
        low = np.stack([intervals.low, np.zeros(len(intervals))], axis=1)
        high = np.stack([intervals.high, np.zeros(len(intervals))], axis=1)
        left, right = ((_nearest(at, intervals.start, intervals.end), at) for at in (low, high))
        face, own = np.divmod(intervals.side, 3)
        parts = []
        for first, last in ((1, 2), (2, 0)):
            begin, end = triangles[:, first], triangles[:, last]
            from_low, to_high = np.zeros(len(face)), np.ones(len(face))
            for (source, through), sign in ((left, -1.0), (right, 1.0)):
                along = through - source
                # A line from a point of the edge itself may have any direction.
                free = np.abs(along).max(axis=1) <= self._scale
                one, other = (
                    np.where(free, 1.0, sign * _cross(along, at - source)) for at in (begin, end)
                )
                crossing = one / np.where(one != other, one - other, 1.0)
                from_low = np.where((one < 0.0) & (other > 0.0), crossing, from_low)
                to_high = np.where((one > 0.0) & (other < 0.0), crossing, to_high)
                to_high = np.where((one <= 0.0) & (other <= 0.0), -1.0, to_high)
            seen = np.flatnonzero(from_low < to_high)
            # The corner at the end of the side after the next one, in the order of the triangle.
            side = 3 * face + (own + (1 if first == 1 else 2)) % 3
            edge = np.stack([begin, end], axis=1)[seen]
            length = np.linalg.norm(edge[:, 1] - edge[:, 0], axis=1)
            third = triangles[seen, 0 if first == 1 else 1]
            source = np.stack([intervals.start, intervals.end], axis=1)[seen]
            parts.append(
                self._entered(
                    side[seen],
                    edge,
                    third,
                    source,
                    intervals.before[seen],
                    from_low[seen] * length,
                    to_high[seen] * length,
                )
            )
        return _joined(parts)

    def _entered(
        self,
        side: IntArray,
        edge: FloatArray,
        third: FloatArray,
        source: FloatArray,
        before: FloatArray,
        low: FloatArray,
        high: FloatArray,
    ) -> _Intervals:
        """Intervals on sides of faces, in the frames of the faces beyond; none at a boundary.

        Parameters
        ----------
        side : (n,) int array
            Side of the face that is left.
        edge : (n, 2, 2) float array
            Its ends, in the order of the face.
        third : (n, 2) float array
            The third corner of the face.
        source : (n, 2, 2) float array
            Ends of the segment.
        before, low, high : (n,) float array
        """
        mesh = self.mesh
        beyond = mesh.opposite_sides[side]
        inside = np.flatnonzero(beyond != side)
        side, beyond = side[inside], beyond[inside]
        edge, third, source = edge[inside], third[inside], source[inside]
        before, low, high = before[inside], low[inside], high[inside]
        # Two faces of a consistently oriented mesh traverse the edge in opposite directions.
        first = mesh.faces[side // 3, (side % 3 + 1) % 3]
        turned = first != mesh.faces[beyond // 3, (beyond % 3 + 1) % 3]
        origin, other = (np.where(turned[:, None], edge[:, 1 - k], edge[:, k]) for k in (0, 1))
        along = other - origin
        length = np.linalg.norm(along, axis=1)
        along /= length[:, None]
        upward = np.stack([-along[:, 1], along[:, 0]], axis=1)
        height = ((third - origin) * upward).sum(axis=1)
        upward *= np.where(height > 0.0, -1.0, 1.0)[:, None]
        offset = source - origin[:, None]
        ends = np.stack(
            [
                (offset * along[:, None]).sum(axis=2),
                (offset * upward[:, None]).sum(axis=2).clip(max=0.0),
            ],
            axis=2,
        )
        low, high = np.where(turned, length - high, low), np.where(turned, length - low, high)
        return _Intervals(
            beyond, ends[:, 0], ends[:, 1], before, low.clip(0.0), np.minimum(high, length)
        )

    def _useful(self, intervals: _Intervals) -> _Intervals:
        """The intervals through which a shortest path up to the limit may pass."""
        mesh = self.mesh
        length = _triangles(mesh, intervals.side)[:, 1, 0]
        low, high = (
            np.stack([at, np.zeros(len(at))], axis=1) for at in (intervals.low, intervals.high)
        )
        at_low, at_high = (
            intervals.before
            + np.linalg.norm(at - _nearest(at, intervals.start, intervals.end), axis=1)
            for at in (low, high)
        )
        from_ends = [
            intervals.before + np.linalg.norm(end - _nearest(end, low, high), axis=1)
            for end in (intervals.start, intervals.end)
        ]
        nearest = np.minimum.reduce([at_low, at_high, *from_ends])
        face, own = np.divmod(intervals.side, 3)
        first = self.at_vertices[mesh.faces[face, (own + 1) % 3]]
        second = self.at_vertices[mesh.faces[face, (own + 2) % 3]]
        # Where a path through a vertex is as short at the far end, it is everywhere.
        useful = at_high < first + intervals.high - self._scale
        useful &= at_low < second + length - intervals.low - self._scale
        return intervals.taken(np.flatnonzero(useful & (nearest < self.limit)))

    def _distance_if_seen(self, intervals: _Intervals, flat: FloatArray) -> FloatArray:
        """Distance of a point of the face of each interval, (n, 2); inf where it is not seen."""
        nearest = _nearest(flat, intervals.start, intervals.end)
        away = flat - nearest
        rise = np.where(away[:, 1] > 0.0, away[:, 1], 1.0)
        crossing = nearest[:, 0] - away[:, 0] * nearest[:, 1] / rise
        crossing = np.where(away[:, 1] > 0.0, crossing, flat[:, 0])
        seen = (crossing >= intervals.low - self._scale) & (
            crossing <= intervals.high + self._scale
        )
        return np.where(seen, intervals.before + np.linalg.norm(away, axis=1), np.inf)

    def _lower_around(self, vertices: IntArray) -> None:
        """Lower distances of vertices by paths along edges from some vertices."""
        mesh = self.mesh
        faces = mesh.faces[mesh.faces_at(vertices)]
        for one, other in ((0, 1), (1, 2), (2, 0), (1, 0), (2, 1), (0, 2)):
            start, end = faces[:, one], faces[:, other]
            length = np.linalg.norm(mesh.vertices[start] - mesh.vertices[end], axis=1)
            np.minimum.at(self.at_vertices, end, self.at_vertices[start] + length)

    def _bent_vertices(self) -> BoolArray:
        """Vertices at which a shortest path may bend: saddles, and those on the boundary, (V,)."""
        mesh = self.mesh
        sides = mesh.vertices[mesh.faces[:, [1, 2, 0]]] - mesh.vertices[mesh.faces]
        sides /= np.linalg.norm(sides, axis=2, keepdims=True)
        cosine = -(sides * sides[:, [2, 0, 1]]).sum(axis=2)
        angles = np.bincount(
            mesh.faces.ravel(), np.arccos(cosine.clip(-1.0, 1.0)).ravel(), len(mesh.vertices)
        )
        bent = angles > 2.0 * np.pi + tolerances.ROUNDED
        bent[mesh.unpaired_edges[0]] = True
        return bent


def _triangles(mesh: Mesh, side: IntArray) -> FloatArray:
    """Faces in the plane, seen from one of their sides, (n, 3, 2).

    The side runs along the x axis from the origin; the third point is the corner opposite to it.
    """
    face, own = np.divmod(side, 3)
    apex, first, last = (mesh.vertices[mesh.faces[face, (own + k) % 3]] for k in range(3))
    along, offset = last - first, apex - first
    length = np.linalg.norm(along, axis=1)
    x = (offset * along).sum(axis=1) / length
    height = np.linalg.norm(np.cross(along, offset), axis=1) / length
    zero = np.zeros(len(side))
    return np.stack([zero, zero, length, zero, x, height], axis=1).reshape(-1, 3, 2)


def _placed(triangles: FloatArray, side: IntArray, weights: FloatArray) -> FloatArray:
    """Points of faces, by barycentric coordinates, in the planes of `_triangles`, (n, 2)."""
    own = side[:, None] % 3
    turned = np.take_along_axis(weights, (own + np.array([1, 2, 0])) % 3, axis=1)
    return np.einsum("nk,nkd->nd", turned, triangles)


def _nearest(points: FloatArray, start: FloatArray, end: FloatArray) -> FloatArray:
    """The nearest point of a segment to each point, (n, d)."""
    along = end - start
    squared = np.maximum((along * along).sum(axis=1), tolerances.TINY)
    share = (((points - start) * along).sum(axis=1) / squared).clip(0.0, 1.0)
    return start + share[:, None] * along


def _cross(one: FloatArray, other: FloatArray) -> FloatArray:
    """Cross products of vectors of the plane, (n,)."""
    return one[:, 0] * other[:, 1] - one[:, 1] * other[:, 0]
