"""Computes evenly spaced points on a curve, as few as keep it within a tolerance.

Each leg, from one control point to the next, is divided evenly by arc length. At corners, even
spacing alone would need very many points. So corners become points too (anchors), and the pieces
between anchors are divided evenly.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from ..geometry.array_types import BoolArray, FloatArray, IntArray
from ..geometry.curve import SurfaceCurve, checked_curve, weights_in_faces
from ..geometry.distances import distance_to_segments
from ..geometry.mesh import Mesh
from ..geometry.surface_points import SurfacePoints
from ..geometry.tolerances import TINY
from .polyline import CutPolyline, cut_polyline

SHORTEST = 0.5
"""Least length of a segment, relative to the mean segment of its leg."""

NEIGHBOURS = 2.0
"""Greatest ratio of the spacings of neighbouring legs."""

MOST = 8
"""Greatest number of segments of a leg, relative to the number that it had."""

MOST_OF_A_SHORT_LEG = 64
"""Greatest number of segments of a leg that had so few that `MOST` would allow fewer than this."""

ANCHOR_GAP = 0.7
"""Least arc length between anchors, in spacings.

The spacings of the pieces between them vary from this to 1.5.
"""

NEAR, FAR = 1.0 / 8.0, 1.0 / 2.0
"""A corner turns within `NEAR` spacings by more than half of its turn within `FAR` spacings."""

ANCHOR_ROUNDS = 4
"""Number of times that anchors are added for one spacing."""

CLOSE_COUNT = 1.05
"""Ratio of two numbers of segments up to which the search does not distinguish them."""

ROOM = 2.0
"""Least length of a segment for a point beside a corner, relative to the distance of the point."""


@dataclass(frozen=True)
class SampledCurve:
    """Evenly spaced points of a curve, exactly on the surface.

    Unlike those of a `SurfaceCurve`, two consecutive points need not lie on a common face; the
    straight line between them may leave the surface.

    Attributes
    ----------
    closed : bool
        Whether the last point is joined to the first, which is not repeated.
    faces : (m,) int array
        The face of the mesh in which each point lies.
    barycentric : (m, 3) float array
        Coordinates in that face, not negative, with sum 1.
    points : (m, 3) float array
        Positions, ``sum_j barycentric[:, j] * vertices[faces[:, j]]``.
    control_index : (k,) int array
        The index of each control point among the points; -1 for one that the curve does not pass.
    """

    closed: bool
    faces: IntArray
    barycentric: FloatArray
    points: FloatArray
    control_index: IntArray


def even_curve(
    mesh: Mesh,
    curve: SurfaceCurve,
    tolerance: float,
    corners: IntArray | None = None,
    beside: float = 0.0,
) -> SampledCurve:
    """Evenly spaced points of a curve; see `even_places`.

    Parameters
    ----------
    mesh : Mesh
    curve : SurfaceCurve
    tolerance : float
        Greatest distance between the two curves, in mesh units.
    corners, beside
        As in `even_places`, in mesh units.

    Raises
    ------
    CurveError
        If the curve does not lie on this mesh.
    """
    curve, segment_faces = checked_curve(mesh, curve, across_gaps=True)
    places = even_places(
        curve.points, curve.closed, curve.control_index, tolerance, corners, beside
    )
    segment, share, control_index = places
    between = share > 0.0
    following = np.where(between, (segment + 1) % len(curve.faces), segment)
    faces = np.where(between, segment_faces[segment], curve.faces[segment])
    start, end = (
        weights_in_faces(mesh, curve.faces[point], curve.barycentric[point], faces)
        for point in (segment, following)
    )
    barycentric = (1.0 - share)[:, None] * start + share[:, None] * end
    positions = SurfacePoints(faces, barycentric).positions(mesh)
    return SampledCurve(curve.closed, faces, barycentric, positions, control_index)


def even_places(
    points: FloatArray,
    closed: bool,
    control_index: IntArray,
    tolerance: float,
    corners: IntArray | None = None,
    beside: float = 0.0,
) -> tuple[IntArray, FloatArray, IntArray]:
    """Find evenly spaced places on a polyline, as few as keep it within a tolerance.

    Control points, the ends of an open polyline, and most corners are among the places. No segment
    of a leg is shorter than half the mean segment of that leg. The spacings of neighbouring legs
    differ by at most a factor of 2, unless one of them has only one segment or the coarser one
    cannot be divided more finely (see below).

    Every vertex of the old polyline is within the tolerance of the chord that spans it, so every
    point of the old polyline is. The old polyline runs from one end of a chord to the other, so
    every point of the chord is the nearest point of the chord for some point of the old polyline.
    So the new polyline is within the tolerance of the old one too.

    A leg has at most eight times as many segments as before, or 64 if this is more. Where that is
    not enough, because the polyline turns sharply at places too close to each other or to a control
    point, the closest of the divisions that were tried is taken, and its distance exceeds the
    tolerance.

    A tube along the polyline is thinner at a corner, up to the next point. So at given corners, two
    further points can be placed beside the corner, before and after it.

    Parameters
    ----------
    points : (n, 3) float array
    closed : bool
        Whether the last point is joined to the first, which is not repeated.
    control_index : (k,) int array
        Indices of the control points among the points, in any order; -1 is ignored.
    tolerance : float
        Greatest distance between the two polylines, in units of the points.
    corners : (c,) int array, optional
        Indices among the points of control points that get points beside them.
    beside : float, default 0
        Distance of these points from the corner along the polyline, in units of the points. They
        are left out if it is 0, or where a segment is too short for them.

    Returns
    -------
    segment : (m,) int array
        Segment on which each place lies; segment i goes from point i to the next point. The end of
        an open polyline has the index of the last point.
    share : (m,) float array
        Position along that segment, in [0, 1); zero at control points.
    control_index : (k,) int array
        The index of each control point among the places; -1 where it was -1.
    """
    control_index = np.asarray(control_index, dtype=np.int64)
    line = cut_polyline(points, closed, control_index)
    legs = [line.leg(number) for number in range(len(line.bounds) - 1)]
    # A closed polyline has at least three points.
    fewest = max(1, 4 - len(legs)) if closed else 1
    divisions = [
        _divide(leg, fewest, tolerance) or _spread(leg, leg.bounds, leg.length / fewest)
        for leg in legs
    ]
    _limit_ratios(legs, divisions, closed, tolerance)
    if corners is not None and beside > 0.0:
        sharp = np.isin(line.vertex[line.bounds], corners)
        divisions = [
            _with_points_beside(division, start, end, beside, tolerance)
            for division, start, end in zip(divisions, sharp[:-1], sharp[1:], strict=True)
        ]

    places = [division.places for division in divisions]
    segment, share = (np.concatenate(of_legs) for of_legs in zip(*places, strict=True))
    at_bounds = np.cumsum([0, *(division.count for division in divisions)])
    if not closed:
        segment, share = np.append(segment, line.vertex[-1]), np.append(share, 0.0)
    place_of = np.full(len(points) + 1, -1)  # the last one for the index -1
    place_of[line.vertex[line.bounds]] = at_bounds
    place_of[line.vertex[0]] = 0
    return segment, share, place_of[control_index]


@dataclass(frozen=True)
class _Division:
    """A leg divided into `count` segments.

    Attributes
    ----------
    leg : CutPolyline
    ends : (p + 1,) int array
        Vertices of the leg that bound its evenly divided pieces: its ends and the anchors.
    at : (count + 1,) float array
        Arc lengths, ascending, of the points that divide it, including its ends.
    """

    leg: CutPolyline
    ends: IntArray
    at: FloatArray

    @property
    def count(self) -> int:
        return len(self.at) - 1

    @property
    def spacing(self) -> float:
        return self.leg.length / self.count

    @property
    def places(self) -> tuple[IntArray, FloatArray]:
        """Segments of the original polyline and shares along them, (count,), without the end."""
        arc, at = self.leg.arc, self.at[:-1]
        after = np.searchsorted(arc, at)
        before = np.maximum(after - 1, 0)
        share = (at - arc[before]) / np.maximum(arc[after] - arc[before], TINY)
        at_vertex = share >= 1.0  # exactly, or by rounding
        segment = self.leg.vertex[np.where(at_vertex, after, before)]
        return segment, np.where(at_vertex, 0.0, share)

    @cached_property
    def deviations(self) -> tuple[FloatArray, IntArray]:
        """Greatest distance of the leg from each chord, and the vertex there, (count,) each."""
        arc, places = self.leg.arc, self.leg.positions(self.at)
        span = np.clip(np.searchsorted(self.at, arc, side="right") - 1, 0, self.count - 1)
        distance = distance_to_segments(self.leg.points, places[span], places[span + 1])
        first = np.flatnonzero(np.diff(span, prepend=-1))
        greatest, worst = np.zeros(self.count), np.zeros(self.count, dtype=np.int64)
        greatest[span[first]] = np.maximum.reduceat(distance, first)
        at_greatest = np.flatnonzero(distance == greatest[span])
        worst[span[at_greatest]] = at_greatest
        return greatest, worst

    @cached_property
    def deviation(self) -> float:
        return float(self.deviations[0].max())

    def chords(self) -> FloatArray:
        return np.linalg.norm(np.diff(self.leg.positions(self.at), axis=0), axis=1)


def _most_segments(leg: CutPolyline) -> int:
    """Greatest number of segments of a leg."""
    return max(MOST * (len(leg.arc) - 1), MOST_OF_A_SHORT_LEG)


def _divide(leg: CutPolyline, fewest: int, tolerance: float) -> _Division | None:
    """The division of a leg with the fewest segments that keeps the tolerance.

    If no division keeps it, the closest one; None if each of them has a segment that is too short.
    """
    count, failed, most = fewest, fewest - 1, _most_segments(leg)
    nearest: _Division | None = None
    while True:
        division = _anchored(leg, count, tolerance)
        if division is not None and (nearest is None or division.deviation < nearest.deviation):
            nearest = division
        if nearest is not None and nearest.deviation <= tolerance:
            break
        if count >= most:
            return nearest
        failed, count = count, min(2 * count, most)
    while count - failed > 1 and count > CLOSE_COUNT * failed:
        middle = (count + failed) // 2
        division = _anchored(leg, middle, tolerance)
        if division is not None and division.deviation <= tolerance:
            nearest, count = division, middle
        else:
            failed = middle
    return nearest


def _anchored(leg: CutPolyline, count: int, tolerance: float) -> _Division | None:
    """Divide a leg into about `count` segments, with anchors at corners.

    None if a segment would be too short.
    """
    spacing = leg.length / count
    division = _spread(leg, leg.bounds, spacing)
    for _ in range(ANCHOR_ROUNDS):
        deviation, worst = division.deviations
        bad = deviation > tolerance
        corners = worst[bad][_are_corners(leg, worst[bad], spacing, tolerance)]
        strength = np.zeros(len(leg.arc))
        strength[worst] = deviation
        added = _far_apart(division, np.unique(corners), strength, ANCHOR_GAP * spacing)
        if len(added) == 0:
            break
        division = _spread(leg, np.union1d(division.ends, added), spacing)
    return _without_short_segments(division, spacing)


def _spread(leg: CutPolyline, ends: IntArray, spacing: float) -> _Division:
    """Evenly divide the pieces of a leg between given vertices."""
    pieces = np.diff(leg.arc[ends])
    counts = np.maximum(np.rint(pieces / max(spacing, TINY)), 1.0).astype(np.int64)
    piece = np.repeat(np.arange(len(pieces)), counts)
    number = np.arange(len(piece)) - (np.cumsum(counts) - counts)[piece]
    at = leg.arc[ends[piece]] + number / counts[piece] * pieces[piece]
    return _Division(leg, ends, np.append(at, leg.length))


def _are_corners(leg: CutPolyline, vertex: IntArray, spacing: float, tolerance: float) -> BoolArray:
    """Whether the polyline turns sharply at vertices, on the scale of one spacing."""
    near = leg.turns(leg.arc[vertex], NEAR * spacing)
    far = leg.turns(leg.arc[vertex], FAR * spacing)
    # A corner in the middle of a chord deviates by a quarter of the spacing times its turn.
    return (near > 0.5 * far) & (near * spacing / 4.0 > 0.5 * tolerance)


def _far_apart(
    division: _Division, corners: IntArray, strength: FloatArray, gap: float
) -> IntArray:
    """The corners that are at least a gap away from anchors, the ends and stronger corners."""
    arc = division.leg.arc
    taken, at = arc[division.ends], arc[corners]
    after = np.clip(np.searchsorted(taken, at), 1, len(taken) - 1)
    corners = corners[(at - taken[after - 1] >= gap) & (taken[after] - at >= gap)]
    close, height = np.diff(arc[corners]) < gap, strength[corners]
    beaten = np.zeros(len(corners), dtype=bool)
    beaten[1:] |= close & (height[:-1] >= height[1:])
    beaten[:-1] |= close & (height[:-1] < height[1:])
    return corners[~beaten]


def _without_short_segments(division: _Division, spacing: float) -> _Division | None:
    """Remove anchors until no segment is too short; None if one is even without anchors."""
    leg = division.leg
    while True:
        chords, ends = division.chords(), division.ends
        short = chords < SHORTEST * chords.mean()
        if not short.any():
            return division
        if len(ends) == 2:
            return None
        # Remove the nearest anchor on either side of each short segment.
        piece = np.searchsorted(leg.arc[ends], division.at[:-1][short], side="right") - 1
        kept = np.setdiff1d(ends, ends[[piece, piece + 1]])
        division = _spread(leg, np.union1d(kept, leg.bounds), spacing)


def _with_points_beside(
    division: _Division, start: bool, end: bool, beside: float, tolerance: float
) -> _Division:
    """A division with points near its start and end, if these are corners."""
    at, length = division.at, division.leg.length
    room = ROOM + 1.0 if division.count == 1 and start and end else ROOM
    added = []
    if start and at[1] - at[0] > room * beside:
        added.append(beside)
    if end and at[-1] - at[-2] > room * beside:
        added.append(length - beside)
    found = replace(division, at=np.union1d(at, added))
    return found if found.deviation <= max(division.deviation, tolerance) else division


def _limit_ratios(
    legs: list[CutPolyline], divisions: list[_Division], closed: bool, tolerance: float
) -> None:
    """Divide legs more finely if their spacing is too great compared with that of a neighbour."""
    number = len(legs)
    pairs = [(i, i + 1) for i in range(number - 1)] + ([(number - 1, 0)] if closed else [])
    pairs += [(j, i) for i, j in pairs]
    # A new spacing is at least that of the finer neighbour, so the least spacing does not change,
    # and the number of rounds is bounded. A leg of one segment sets no limit to its neighbours.
    changed = number > 1
    while changed:
        changed = False
        for coarse, fine in pairs:
            leg, old, limit = legs[coarse], divisions[coarse], NEIGHBOURS * divisions[fine].spacing
            if divisions[fine].count == 1 or old.spacing <= limit:
                continue
            fewest = min(int(np.ceil(leg.length / limit)), _most_segments(leg))
            new = _divide(leg, fewest, tolerance) if fewest > old.count else None
            if new is None or new.count <= old.count:
                continue
            # The tolerance takes precedence over the ratio.
            if new.deviation <= max(old.deviation, tolerance):
                divisions[coarse], changed = new, True
