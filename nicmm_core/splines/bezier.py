"""Fits cubic Bézier splines to a polyline, with as few knots as keep them within a tolerance.

Each leg, from one control point to the next, starts as one cubic. Cubics too far from the polyline
are split, and in the end neighbouring cubics are merged where one is enough. Cubics are fitted by
the method of Schneider (1990): tangents at the knots are given, the lengths of the handles solve a
least-squares problem, and then each point of the polyline moves to a nearer parameter.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..geometry.array_types import BoolArray, FloatArray, IntArray
from ..geometry.distances import distance_to_segments
from ..geometry.tolerances import TINY
from .polyline import CORNER, CutPolyline, angles, cut_polyline

SAMPLES = 16
"""Number of points of the polyline to which each cubic is fitted, besides its vertices."""

ROUNDS = 6
"""Number of times that handles and parameters are solved for in turn."""

LEAST_HANDLE, GREATEST_HANDLE = 0.01, 0.6
"""Limits on the length of a handle, relative to the arc length of its cubic.

On an arc of a circle the handles are about a third. On a straight line, a cubic with two handles of
0.6 still runs forward only.
"""

TANGENT_REACH, TANGENT_REACH_AT_END = 0.4, 0.25
"""Arc length over which the tangent at a knot is measured, on either side or on one side only.

The first is relative to the shorter of the two adjacent cubics, the second to the cubic on that
side. A shorter length would show the zigzag at mesh edges; a fit on one side alone follows the
curve over less of it.
"""

TANGENT_SAMPLES = 12
"""Number of points on either side of a knot to which its tangent is fitted."""

MEASURED = 0.97
"""Part of the tolerance that the fit uses, since it measures distances at finitely many places."""

CORNER_REACH = 4.0
"""Distance on either side within which the turn of a corner is measured, in tolerances."""

ORDER = 6.0
"""The distance of a fitted cubic from a smooth curve falls with this power of its length."""

MOST_PARTS = 4
"""Greatest number of parts into which a cubic is split in one round."""


@dataclass(frozen=True)
class BezierSpline:
    """A cubic Bézier spline as Blender has it: knots, each with a handle on either side.

    Attributes
    ----------
    closed : bool
        Whether the last knot is joined to the first, which is not repeated.
    knots : (m, 3) float array
        Positions of the knots, which are vertices of the polyline.
    left, right : (m, 3) float array
        Positions of the handles towards the previous and the next knot. The handle beyond an end
        of an open spline mirrors the other one.
    control_index : (k,) int array
        The index of each control point among the knots; -1 for one that the curve does not pass.
    """

    closed: bool
    knots: FloatArray
    left: FloatArray
    right: FloatArray
    control_index: IntArray


def fit_bezier(
    points: FloatArray,
    closed: bool,
    control_index: IntArray,
    tolerance: float,
    corners: IntArray | None = None,
) -> BezierSpline:
    """Fit a Bézier spline to a polyline, with as few knots as keep it within a tolerance.

    Control points, corners and the ends of an open polyline are knots. A knot and its two handles
    lie on one line, except at corners: where the polyline turns by more than 30° within a few
    tolerances, and at the given corners, however little it turns there. The distance is measured at
    many places, from the polyline to the spline and from the spline to the polyline.

    Splitting stops at the vertices of the polyline. A cubic over a single segment keeps any
    tolerance, but only with short handles, so the spline bends as sharply there as the polyline.

    Parameters
    ----------
    points : (n, 3) float array
    closed : bool
        Whether the last point is joined to the first, which is not repeated.
    control_index : (k,) int array
        Indices of the control points among the points, in any order; -1 is ignored.
    tolerance : float
        Greatest distance between the spline and the polyline, in units of the points.
    corners : (c,) int array, optional
        Indices among the points of corners, besides those that are found.
    """
    control_index = np.asarray(control_index, dtype=np.int64)
    corners = np.zeros(0, dtype=np.int64) if corners is None else corners
    given = cut_polyline(points, closed, np.append(control_index, corners))
    line, kept = _without_repeats(given)
    if len(line.points) < 2:
        place = points[:1]
        index = np.where(control_index >= 0, 0, -1)
        return BezierSpline(closed, place.copy(), place.copy(), place.copy(), index)

    fitter = _Fitter(line, MEASURED * tolerance, kept[np.isin(given.vertex, corners)])
    knots = _split(fitter)
    knots, tangents, handles = _merge(fitter, knots)

    count = len(knots) - 1 if closed else len(knots)
    places = line.points[knots]
    before, after = tangents
    right = places[:-1] + handles[:, :1] * after[:-1]
    left = places[1:] - handles[:, 1:] * before[1:]
    if closed:
        left = np.roll(left, 1, axis=0)
    else:
        right = np.concatenate([right, 2.0 * places[-1:] - left[-1:]])
        left = np.concatenate([2.0 * places[:1] - right[:1], left])
    knot_of = np.full(len(points) + 1, -1)  # the last one for the index -1
    knot_of[given.vertex[given.bounds]] = np.searchsorted(knots, kept[given.bounds]) % count
    return BezierSpline(closed, places[:count], left, right, knot_of[control_index])


Fits = tuple[FloatArray, FloatArray]
"""Lengths of the handles of s cubics at the start and at the end, (s, 2), and the greatest distance
of each cubic from its span of the polyline, (s,), which is infinite where the cubic runs backward.
"""


@dataclass(frozen=True)
class _Spans:
    """Spans of a polyline, to each of which a cubic with given ends and tangents is fitted.

    Attributes
    ----------
    start, end : (s, 3) float array
        Ends of each span.
    first, last : (s, 3) float array
        Forward unit tangents at these ends.
    length : (s,) float array
        Arc length of each span.
    first_row : (s,) int array
        Index of the first target of each span.
    span : (n,) int array
        The span of each target, ascending.
    target : (n, 3) float array
        Points to which the cubics are fitted: all vertices, and others evenly between the ends.
    weight : (n,) float array
        Weight of each target, since vertices may be close together: arc length.
    """

    start: FloatArray
    end: FloatArray
    first: FloatArray
    last: FloatArray
    length: FloatArray
    first_row: IntArray
    span: IntArray
    target: FloatArray
    weight: FloatArray

    def cubics(self, handles: FloatArray) -> FloatArray:
        """Control points of the cubics with handles of given lengths, (s, 2), shape (s, 4, 3)."""
        out, back = handles[:, :1] * self.first, handles[:, 1:] * self.last
        return np.stack([self.start, self.start + out, self.end - back, self.end], axis=1)

    def least_squares(self, parameter: FloatArray) -> FloatArray:
        """Lengths of both handles of each cubic, (s, 2), within their limits."""
        span, first, last = self.span, self.first, self.last
        basis = _bernstein(parameter)
        base = self.target - basis[:, :2].sum(axis=1)[:, None] * self.start[span]
        base -= basis[:, 2:].sum(axis=1)[:, None] * self.end[span]
        out, back = basis[:, 1], -basis[:, 2]
        terms = [
            out * out,
            back * back,
            out * back,
            out * (base * first[span]).sum(axis=1),
            back * (base * last[span]).sum(axis=1),
        ]
        sums = [np.add.reduceat(self.weight * term, self.first_row) for term in terms]
        out_out, back_back, out_back, out_target, back_target = sums
        out_back *= (first * last).sum(axis=1)

        low, high = LEAST_HANDLE * self.length, GREATEST_HANDLE * self.length
        determinant = np.maximum(out_out * back_back - out_back**2, TINY)
        out = np.clip((back_back * out_target - out_back * back_target) / determinant, low, high)
        for _ in range(2):  # where one handle is at its limit, find the best other handle
            back = (back_target - out_back * out) / np.maximum(back_back, TINY)
            back = np.clip(back, low, high)
            out = (out_target - out_back * back) / np.maximum(out_out, TINY)
            out = np.clip(out, low, high)
        return np.stack([out, back], axis=1)


class _Fitter:
    """A polyline with the data that fits require, and the fits of cubics to its spans."""

    def __init__(self, line: CutPolyline, tolerance: float, corners: IntArray) -> None:
        self.line = line
        self.tolerance = tolerance
        self.turn = line.turns(line.arc, CORNER_REACH * tolerance)
        self.sharp = self._corners(corners)
        self.fixed = np.union1d(line.bounds, np.flatnonzero(self.sharp))
        self.sharp[[0, -1]] |= not line.closed
        if line.closed and len(self.fixed) == 2:  # one cubic would end where it starts
            halfway = np.searchsorted(line.arc, 0.5 * line.arc[-1])
            self.fixed = np.union1d(self.fixed, np.clip([halfway], 1, len(line.arc) - 2))

    def _corners(self, given: IntArray) -> BoolArray:
        """Which vertices are corners, (n,): the given ones, and one at each other sharp turn."""
        reach, arc = CORNER_REACH * self.tolerance, self.line.arc
        found = np.zeros(len(arc), dtype=bool)
        # The turn of a given corner is also measured at the vertices near it.
        taken = (np.abs(arc[:, None] - arc[given]) <= reach).any(axis=1)
        at = np.flatnonzero((self.turn > CORNER) & ~taken)
        # The same turn is measured at vertices close together; it counts where it is greatest.
        for group in np.split(at, np.flatnonzero(np.diff(arc[at]) > reach) + 1):
            if len(group):
                found[group[self.turn[group].argmax()]] = True
        found[given] = True
        if self.line.closed:
            found[[0, -1]] = found[0] | found[-1]
        return found

    def tangents(self, knots: IntArray) -> FloatArray:
        """Forward unit tangents before and after k knots, (2, k, 3); they differ only at corners.

        They are measured over a part of the spans next to each knot.
        """
        arc = self.line.arc[knots]
        spans = np.diff(arc)
        outer = spans[[-1, 0]] if self.line.closed else spans[[0, -1]]
        back, ahead = np.append(outer[0], spans), np.append(spans, outer[1])
        both = self._directions(arc, TANGENT_REACH * np.minimum(back, ahead), True)
        sharp = self.sharp[knots][:, None]
        before = np.where(sharp, -self._directions(arc, -TANGENT_REACH_AT_END * back, False), both)
        after = np.where(sharp, self._directions(arc, TANGENT_REACH_AT_END * ahead, False), both)
        return np.stack([_unit(before, after), _unit(after, before)])

    def _directions(self, arc: FloatArray, reach: FloatArray, both_sides: bool) -> FloatArray:
        """Tangent directions at arc lengths, from cubics fitted to the polyline there.

        The cubics are fitted on both sides, or only on the side of `reach`, which may be negative.
        """
        share = np.arange(1, TANGENT_SAMPLES + 1) / TANGENT_SAMPLES
        powers = (1, 3) if both_sides else (1, 2, 3)
        weights = np.linalg.pinv(np.stack([share**power for power in powers], axis=1))[0]
        at, steps = arc[:, None], share * reach[:, None]
        chord_start = self.line.positions(at - steps if both_sides else at)
        return np.einsum("s,ksd->kd", weights, self.line.positions(at + steps) - chord_start)

    def fit(self, start: IntArray, end: IntArray, first: FloatArray, last: FloatArray) -> Fits:
        """Fit cubics over spans of the polyline.

        Parameters
        ----------
        start, end : (s,) int array
            Vertices of the polyline at which the spans start and end.
        first, last : (s, 3) float array
            Forward unit tangents at these vertices.
        """
        handles, deviation = self._fit(start, end, first, last, None)
        far = np.flatnonzero(deviation > self.tolerance)
        if len(far):
            start, end, first, last = start[far], end[far], first[far], last[far]
            short = self._short_handles(start, end, first, last)
            _, straight = self._fit(start, end, first, last, short)
            better = straight < deviation[far]
            handles[far[better]], deviation[far[better]] = short[better], straight[better]
        return handles, deviation

    def _short_handles(
        self, start: IntArray, end: IntArray, first: FloatArray, last: FloatArray
    ) -> FloatArray:
        """Handle lengths, (s, 2), with which cubics stay within the tolerance of their chords.

        At a weak corner the tangent lies between the directions of both sides. A straight side then
        needs short handles, to which least squares converge only slowly.
        """
        chord = self.line.points[end] - self.line.points[start]
        length = np.linalg.norm(chord, axis=1)[:, None]
        turn = np.stack([angles(first, chord), angles(chord, last)], axis=1)
        # The two handles move a cubic by at most three quarters of their distance from the chord.
        sine = np.sin(np.minimum(turn, np.pi / 2.0))
        return np.minimum(length / 3.0, self.tolerance / np.maximum(sine, TINY))

    def _fit(
        self,
        start: IntArray,
        end: IntArray,
        first: FloatArray,
        last: FloatArray,
        handles: FloatArray | None,
    ) -> Fits:
        """Fit cubics with handles of given lengths, (s, 2), or by least squares if None."""
        spans, parameter = self._spans(start, end, first, last)
        if handles is not None:
            parameter = _parameters_at(spans.cubics(handles), spans.span, parameter)
        for _ in range(ROUNDS):
            lengths = spans.least_squares(parameter) if handles is None else handles
            cubic = spans.cubics(lengths)
            parameter = _nearer(cubic, spans.span, parameter, spans.target)
        parameter[spans.first_row] = 0.0
        parameter[spans.first_row[1:] - 1] = parameter[-1] = 1.0
        deviation = _deviations(cubic, spans, parameter)
        # A cubic over one segment cannot be split; if necessary, its handles are short.
        deviation[_turns_back(cubic, first, last) & (end - start > 1)] = np.inf
        return lengths, deviation

    def _spans(
        self, start: IntArray, end: IntArray, first: FloatArray, last: FloatArray
    ) -> tuple[_Spans, FloatArray]:
        """Data of spans, and the share of its span's arc length at which each target lies, (n,)."""
        line, share = self.line, (np.arange(SAMPLES) + 0.5) / SAMPLES
        arcs = []
        for a, b in zip(start.tolist(), end.tolist(), strict=True):
            between = (1.0 - share) * line.arc[a] + share * line.arc[b]
            arcs.append(np.sort(np.append(line.arc[a : b + 1], between)))
        count, arc = np.array([len(of_span) for of_span in arcs]), np.concatenate(arcs)
        span = np.repeat(np.arange(len(start)), count)
        length = line.arc[end] - line.arc[start]
        spans = _Spans(
            line.points[start],
            line.points[end],
            first,
            last,
            length,
            np.cumsum(count) - count,
            span,
            line.positions(arc),
            np.gradient(arc),
        )
        return spans, (arc - line.arc[start][span]) / length[span]

    def splits(self, start: IntArray, end: IntArray, deviation: FloatArray) -> IntArray:
        """Vertices at which to split spans, (s,), whose cubics are too far from the polyline."""
        arc, tolerance = self.line.arc, self.tolerance
        length = arc[end] - arc[start]
        spans = zip(start.tolist(), end.tolist(), strict=True)
        sharpest = np.array([a + 1 + self.turn[a + 1 : b].argmax() for a, b in spans])
        turn, reach = self.turn[sharpest], length / 8.0
        # Most of the turn is at one vertex, so no smooth cubic fits there.
        kink = turn > 0.5 * self.line.turns(arc[sharpest], reach)
        kink &= turn * reach > 0.5 * tolerance
        parts = np.ceil(np.minimum(deviation / tolerance, MOST_PARTS**ORDER) ** (1.0 / ORDER))
        parts = np.clip(parts, 2, MOST_PARTS)
        found = [sharpest[kink]]
        for number in range(1, MOST_PARTS):
            here = ~kink & (number < parts)
            at = arc[start[here]] + number / parts[here] * length[here]
            after = np.searchsorted(arc, at)
            nearest = after - (at - arc[after - 1] < arc[after] - at)
            found.append(np.clip(nearest, start[here] + 1, end[here] - 1))
        return np.concatenate(found)


def _split(fitter: _Fitter) -> IntArray:
    """Knots between which every cubic keeps the tolerance or has no vertex to split at."""
    knots, count = fitter.fixed, len(fitter.line.arc)
    # For the start of each cubic that keeps the tolerance: its end, and its tangents, which later
    # knots may change.
    known_end, known = np.full(count, -1), np.zeros((count, 2, 3))
    while True:
        before, after = fitter.tangents(knots)
        start, end = knots[:-1], knots[1:]
        both = np.stack([after[:-1], before[1:]], axis=1)
        new = (known_end[start] != end) | (known[start] != both).any(axis=(1, 2))
        start, end, both = start[new], end[new], both[new]
        _, deviation = fitter.fit(start, end, both[:, 0], both[:, 1])
        bad = (deviation > fitter.tolerance) & (end - start > 1)
        if not bad.any():
            return knots
        known_end[start], known[start] = np.where(bad, -1, end), both
        knots = np.union1d(knots, fitter.splits(start[bad], end[bad], deviation[bad]))


def _merge(fitter: _Fitter, knots: IntArray) -> tuple[IntArray, FloatArray, FloatArray]:
    """Remove knots where one cubic is enough, keeping the tangents at the remaining knots."""
    tangents = fitter.tangents(knots)
    untested = ~np.isin(knots, fitter.fixed)
    while untested.any():
        at = np.flatnonzero(untested)
        before, after = tangents
        _, found = fitter.fit(knots[at - 1], knots[at + 1], after[at - 1], before[at + 1])
        deviation = np.full(len(knots), np.inf)
        deviation[at] = np.where(found <= fitter.tolerance, found, np.inf)
        # Of two neighbouring knots only the better one is removed, as this changes the spans at the
        # other one.
        padded = np.pad(deviation, 1, constant_values=np.inf)
        removed = (deviation < padded[:-2]) & (deviation <= padded[2:])
        beside = np.pad(removed, 1)
        untested = (beside[:-2] | beside[2:]) & ~np.isin(knots, fitter.fixed)
        knots, tangents, untested = knots[~removed], tangents[:, ~removed], untested[~removed]
    before, after = tangents
    handles, _ = fitter.fit(knots[:-1], knots[1:], after[:-1], before[1:])
    return knots, tangents, handles


def _without_repeats(line: CutPolyline) -> tuple[CutPolyline, IntArray]:
    """The polyline without steps of length zero, and the new index of each of its points."""
    moves = np.concatenate([[True], np.diff(line.arc) > 0.0])
    kept = np.cumsum(moves) - 1
    points = line.points[moves].copy()
    if line.closed:
        points[-1] = points[0]
    bounds = np.unique(kept[line.bounds])
    return CutPolyline(points, line.arc[moves], line.closed, line.vertex[moves], bounds), kept


def _unit(vectors: FloatArray, others: FloatArray) -> FloatArray:
    """Unit vectors; where a vector is zero, that of the other, or the x axis if both are zero."""
    vectors = np.where((vectors == 0.0).all(axis=1, keepdims=True), others, vectors)
    length = np.linalg.norm(vectors, axis=1, keepdims=True)
    return np.where(length > 0.0, vectors / np.maximum(length, TINY), [1.0, 0.0, 0.0])


def _bernstein(parameter: FloatArray) -> FloatArray:
    """Cubic Bernstein polynomials at parameters, (n,), shape (n, 4)."""
    t, u = parameter, 1.0 - parameter
    return np.stack([u**3, 3.0 * u * u * t, 3.0 * u * t * t, t**3], axis=1)


def _at(cubic: FloatArray, span: IntArray, parameter: FloatArray) -> FloatArray:
    """Points of cubics, (s, 4, 3), at parameters, each on a given span, shape (n, 3)."""
    return np.einsum("nb,nbd->nd", _bernstein(parameter), cubic[span])


def _parameters_at(cubic: FloatArray, span: IntArray, share: FloatArray) -> FloatArray:
    """Parameters at which cubics reach given shares of their lengths, (n,)."""
    parameter = np.linspace(0.0, 1.0, SAMPLES + 1)
    places = np.einsum("tb,sbd->std", _bernstein(parameter), cubic)
    reached = np.cumsum(np.linalg.norm(np.diff(places, axis=1), axis=2), axis=1)
    reached /= np.maximum(reached[:, -1:], TINY)
    # One table for all cubics: the integer part of a key is the index of the cubic.
    number = np.arange(len(cubic))[:, None]
    keys = np.concatenate([number, number + reached], axis=1).ravel()
    values = (number + parameter).ravel()
    return np.clip(np.interp(span + share, keys, values) - span, 0.0, 1.0)


def _nearer(
    cubic: FloatArray, span: IntArray, parameter: FloatArray, target: FloatArray
) -> FloatArray:
    """Parameters after a Gauss–Newton step towards the nearest points of the cubics.

    A parameter whose point does not come nearer stays the same.
    """
    t, u = parameter[:, None], 1.0 - parameter[:, None]
    step = 3.0 * np.diff(cubic, axis=1)[span]
    slope = u * u * step[:, 0] + 2.0 * u * t * step[:, 1] + t * t * step[:, 2]
    offset = target - _at(cubic, span, parameter)
    move = (offset * slope).sum(axis=1) / np.maximum((slope**2).sum(axis=1), TINY)
    moved = np.clip(parameter + move, 0.0, 1.0)
    there = np.linalg.norm(target - _at(cubic, span, moved), axis=1)
    return np.where(there < np.linalg.norm(offset, axis=1), moved, parameter)


def _deviations(cubic: FloatArray, spans: _Spans, parameter: FloatArray) -> FloatArray:
    """Greatest distance between each cubic and its part of the polyline, (s,).

    All vertices are among the targets, so the polyline is straight from one target to the next. The
    parameters of the targets begin with 0 and end with 1, so the parts between them cover the whole
    cubic.
    """
    span, target = spans.span, spans.target
    distance = np.linalg.norm(target - _at(cubic, span, parameter), axis=1)
    middle = _at(cubic, span[:-1], 0.5 * (parameter[:-1] + parameter[1:]))
    off = distance_to_segments(middle, target[:-1], target[1:])
    off[spans.first_row[1:] - 1] = 0.0  # from one span to the next
    distance[:-1] = np.maximum(distance[:-1], off)
    return np.maximum.reduceat(distance, spans.first_row)


def _turns_back(cubic: FloatArray, first: FloatArray, last: FloatArray) -> BoolArray:
    """Whether no direction leads forward along the whole control polygon, (s,).

    If a direction does, it leads forward along the whole cubic, which then has no loop or cusp.
    """
    middle = _unit(cubic[:, 2] - cubic[:, 1], first)
    forward = first + middle + last
    least = [(forward * side).sum(axis=1) for side in (first, middle, last)]
    return np.min(least, axis=0) <= 0.0
