"""Computes evenly spaced points on a curve, as few as keep it within a tolerance.

Each leg, from one control point to the next, is divided evenly by arc length. At corners, even
spacing alone would need very many points. So corners become points too (anchors), and the pieces
between anchors are divided evenly.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from ..geometry.array_types import BoolArray, FloatArray, IntArray
from ..geometry.curve import SurfaceCurve, checked_curve, weights_in_faces
from ..geometry.distances import distance_to_segments
from ..geometry.mesh import Mesh
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

NO_ANCHORS: IntArray = np.zeros(0, dtype=np.int64)


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


def even_curve(mesh: Mesh, curve: SurfaceCurve, tolerance: float) -> SampledCurve:
    """Evenly spaced points of a curve; see `even_places`.

    Parameters
    ----------
    mesh : Mesh
    curve : SurfaceCurve
    tolerance : float
        Greatest distance between the two curves, in mesh units.

    Raises
    ------
    CurveError
        If the curve does not lie on this mesh.
    """
    curve, segment_faces = checked_curve(mesh, curve, across_gaps=True)
    places = even_places(curve.points, curve.closed, curve.control_index, tolerance)
    segment, share, control_index = places
    following = (segment + 1) % len(curve.faces)
    between = share > 0.0
    faces = np.where(between, segment_faces[segment], curve.faces[segment])
    end_of = np.where(between, following, segment)
    start, end = (
        weights_in_faces(mesh, curve.faces[point], curve.barycentric[point], faces)
        for point in (segment, end_of)
    )
    weights = (1.0 - share)[:, None] * start + share[:, None] * end
    barycentric = np.where(between[:, None], weights, curve.barycentric[segment])
    positions = (barycentric[:, :, None] * mesh.vertices[mesh.faces[faces]]).sum(axis=1)
    return SampledCurve(curve.closed, faces, barycentric, positions, control_index)


def even_places(
    points: FloatArray, closed: bool, control_index: IntArray, tolerance: float
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

    Parameters
    ----------
    points : (n, 3) float array
    closed : bool
        Whether the last point is joined to the first, which is not repeated.
    control_index : (k,) int array
        Indices of the control points among the points, in any order; -1 is ignored.
    tolerance : float
        Greatest distance between the two polylines, in units of the points.

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
    legs = [_Leg(line, *ends) for ends in zip(line.bounds[:-1], line.bounds[1:], strict=True)]
    # A closed polyline has at least three points.
    fewest = max(1, 4 - len(legs)) if closed and len(legs) < 3 else 1
    divisions = [
        _divide(leg, fewest, tolerance) or _spread(leg, NO_ANCHORS, leg.length / fewest)
        for leg in legs
    ]
    _limit_ratios(legs, divisions, closed, tolerance)

    segment, share = np.concatenate([places.on_line(line) for places in divisions], axis=1)
    at_bounds = np.cumsum([0, *(places.count for places in divisions)])
    if not closed:
        segment, share = np.append(segment, line.bounds[-1]), np.append(share, 0.0)
    place_of = np.full(len(points) + 1, -1)  # the last one for the index -1
    place_of[line.vertex[line.bounds]] = at_bounds
    place_of[line.vertex[0]] = 0
    return line.vertex[segment.astype(np.int64)], share, place_of[control_index]


class _Leg:
    """The part of a polyline from one control point to the next, with m points."""

    def __init__(self, line: CutPolyline, first: int, last: int) -> None:
        self.first = first
        self.points = line.points[first : last + 1]
        self.arc = line.arc[first : last + 1] - line.arc[first]
        self.length = float(self.arc[-1])
        self.most = max(MOST * (last - first), MOST_OF_A_SHORT_LEG)
        self.alone = CutPolyline(self.points, self.arc, False, np.arange(0), np.arange(0))


@dataclass(frozen=True)
class _Division:
    """A leg divided at `count` + 1 arc lengths, both ends included."""

    leg: _Leg
    at: FloatArray
    """(count + 1,) arc lengths, ascending."""
    vertex: IntArray
    """(count + 1,) the vertex of the leg at each end or anchor, -1 elsewhere."""

    @property
    def count(self) -> int:
        return len(self.at) - 1

    @property
    def spacing(self) -> float:
        return self.leg.length / self.count

    def on_line(self, line: CutPolyline) -> FloatArray:
        """Segments of the line and shares along them, (2, count), without the end of the leg."""
        arc, at, vertex = self.leg.arc, self.at[:-1], self.vertex[:-1]
        segment = np.clip(np.searchsorted(arc, at, side="right") - 1, 0, len(arc) - 2)
        width = arc[segment + 1] - arc[segment]
        share = np.divide(at - arc[segment], width, out=np.zeros(len(at)), where=width > 0.0)
        # Rounding may give a share of 1; that place is the next vertex.
        over = share >= 1.0
        segment, share = np.where(over, segment + 1, segment), np.where(over, 0.0, share)
        anchored = vertex >= 0
        segment, share = np.where(anchored, vertex, segment), np.where(anchored, 0.0, share)
        return np.stack([segment + self.leg.first, share])

    @cached_property
    def deviations(self) -> tuple[FloatArray, IntArray]:
        """Greatest distance of the leg from each chord, and the vertex there, (count,) each."""
        arc, places = self.leg.arc, self.leg.alone.positions(self.at)
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
        return np.linalg.norm(np.diff(self.leg.alone.positions(self.at), axis=0), axis=1)


def _divide(leg: _Leg, fewest: int, tolerance: float) -> _Division | None:
    """The division of a leg with the fewest segments that keeps the tolerance.

    If no division keeps it, the closest one; None if each of them has a segment that is too short.
    """
    count, failed = fewest, fewest - 1
    nearest: _Division | None = None
    while True:
        division = _anchored(leg, count, tolerance)
        if division is not None and (nearest is None or division.deviation < nearest.deviation):
            nearest = division
        if nearest is not None and nearest.deviation <= tolerance:
            break
        if count >= leg.most:
            return nearest
        failed, count = count, min(2 * count, leg.most)
    while count - failed > 1 and count > CLOSE_COUNT * failed:
        middle = (count + failed) // 2
        division = _anchored(leg, middle, tolerance)
        if division is not None and division.deviation <= tolerance:
            nearest, count = division, middle
        else:
            failed = middle
    return nearest


def _anchored(leg: _Leg, count: int, tolerance: float) -> _Division | None:
    """Divide a leg into about `count` segments, with anchors at corners.

    None if a segment would be too short.
    """
    anchors = NO_ANCHORS
    spacing = leg.length / count
    division = _spread(leg, anchors, spacing)
    for _ in range(ANCHOR_ROUNDS):
        deviation, worst = division.deviations
        bad = deviation > tolerance
        corners = worst[bad][_are_corners(leg, worst[bad], spacing, tolerance)]
        strength = np.zeros(len(leg.arc))
        strength[worst] = deviation
        added = _far_apart(leg, np.unique(corners), anchors, strength, ANCHOR_GAP * spacing)
        if len(added) == 0:
            break
        anchors = np.sort(np.concatenate([anchors, added]))
        division = _spread(leg, anchors, spacing)
    return _without_short_segments(leg, division, anchors, spacing)


def _spread(leg: _Leg, anchors: IntArray, spacing: float) -> _Division:
    """Evenly divide the pieces of a leg between its anchors."""
    ends = np.concatenate([[0], anchors, [len(leg.arc) - 1]])
    pieces = np.diff(leg.arc[ends])
    counts = np.ones(len(pieces), dtype=np.int64)
    if spacing > 0.0:
        counts = np.maximum(np.rint(pieces / spacing), 1.0).astype(np.int64)
    piece = np.repeat(np.arange(len(pieces)), counts)
    number = np.arange(len(piece)) - (np.cumsum(counts) - counts)[piece]
    at = leg.arc[ends[piece]] + number / counts[piece] * pieces[piece]
    vertex = np.where(number == 0, ends[piece], -1)
    return _Division(leg, np.append(at, leg.length), np.append(vertex, ends[-1]))


def _are_corners(leg: _Leg, vertex: IntArray, spacing: float, tolerance: float) -> BoolArray:
    """Whether the polyline turns sharply at vertices, on the scale of one spacing."""
    near = leg.alone.turns(leg.arc[vertex], NEAR * spacing)
    far = leg.alone.turns(leg.arc[vertex], FAR * spacing)
    # A corner in the middle of a chord deviates by a quarter of the spacing times its turn.
    return (near > 0.5 * far) & (near * spacing / 4.0 > 0.5 * tolerance)


def _far_apart(
    leg: _Leg, corners: IntArray, anchors: IntArray, strength: FloatArray, gap: float
) -> IntArray:
    """The corners that are at least a gap away from anchors, the ends and stronger corners."""
    taken = leg.arc[np.concatenate([[0], anchors, [len(leg.arc) - 1]])]
    after = np.clip(np.searchsorted(taken, leg.arc[corners]), 1, len(taken) - 1)
    at = leg.arc[corners]
    corners = corners[(at - taken[after - 1] >= gap) & (taken[after] - at >= gap)]
    at, height = leg.arc[corners], strength[corners]
    close = np.diff(at) < gap
    beaten = np.zeros(len(corners), dtype=bool)
    beaten[1:] |= close & (height[:-1] >= height[1:])
    beaten[:-1] |= close & (height[:-1] < height[1:])
    return corners[~beaten]


def _without_short_segments(
    leg: _Leg, division: _Division, anchors: IntArray, spacing: float
) -> _Division | None:
    """Remove anchors until no segment is too short; None if one is even without anchors."""
    for number in range(ANCHOR_ROUNDS + 1):
        chords = division.chords()
        short = chords < SHORTEST * chords.mean()
        if not short.any():
            return division
        if len(anchors) == 0:
            break
        # Remove the nearest anchor on either side of each short segment; in the end, all anchors.
        ends = np.concatenate([[0], anchors, [len(leg.arc) - 1]])
        piece = np.searchsorted(leg.arc[ends], division.at[:-1][short], side="right") - 1
        sides = np.concatenate([ends[piece], ends[np.minimum(piece + 1, len(ends) - 1)]])
        anchors = anchors[~np.isin(anchors, sides)] if number < ANCHOR_ROUNDS - 1 else NO_ANCHORS
        division = _spread(leg, anchors, spacing)
    return None


def _limit_ratios(
    legs: list[_Leg], divisions: list[_Division], closed: bool, tolerance: float
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
            fewest = min(int(np.ceil(leg.length / limit)), leg.most)
            new = _divide(leg, fewest, tolerance) if fewest > old.count else None
            # The tolerance takes precedence over the ratio.
            if new is None or new.deviation > max(old.deviation, tolerance):
                continue
            if new.count > old.count:
                divisions[coarse], changed = new, True
