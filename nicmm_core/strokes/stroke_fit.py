"""Finds few control points whose curve follows a stroke: a dense, noisy polyline near the surface.

The stroke is smoothed by a spline, and control points are places on it:

1. The first guess has the fewest points whose natural cubic spline stays near the stroke, since the
   curve of a design bends like this spline.
2. They are often more than needed. So with only some of them, a curve is relaxed from the smoothed
   stroke, which is fast and keeps its course. Where it leaves the tolerance, a control point is
   added, until it does not.
3. The curve through these is designed without a start, as the caller will do. This ends as soon as
   a curve away from the stroke is fairer than the one along it. Control points are then added where
   they differ. If that does not help, or the second step needs as many points as the first guess
   has, the first guess is tried instead.
"""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from scipy.interpolate import splev, splprep
from scipy.spatial import cKDTree

from ..arguments import checked_number
from ..errors import ArgumentError, ControlPointError, CurveError, UnreachableError
from ..geometry.array_types import FloatArray, IntArray
from ..geometry.curve import SurfaceCurve, arc_lengths
from ..geometry.mesh import Mesh, real_array
from ..geometry.surface_points import SurfacePoints, nearest_points, snapped
from ..geometry.tolerances import COINCIDENT
from ..options import FEWEST_CLOSED, FEWEST_OPEN
from ..path.spline_path import interpolating_spline
from ..progress import checkpoint
from ..repair.surface_normals import surface_normals

SMOOTHING = 0.35
"""Root mean square distance of the smoothed stroke from the stroke, in tolerances. Noise of about
this size is removed."""

CORNERS, SMOOTHINGS = 0.75, 4
"""Greatest distance of the smoothed stroke from the stroke, as at corners, in tolerances; and how
often it is smoothed less until that is so."""

AT_ENDS = 10.0
"""Weight of the ends of an open stroke, relative to its other points, when it is smoothed."""

PLACES, MOST_PLACES = 400, 3000
"""Least and greatest number of places on the smoothed stroke among which control points are chosen.
They are at most half a tolerance apart, if that is possible."""

MARGIN = 0.6
"""Distance that the spline of the first step keeps from the smoothed stroke, in tolerances. The
curve of a design differs from it, and the stroke from the smoothed one."""

SPARSE = 2
"""The second step begins with one of so many control points of the first guess."""

DENSE = 0.1
"""Distance of the samples between which distances of lines are measured, in tolerances."""

WITHIN = 0.99
"""Greatest distance of a sample, in tolerances; points between samples may be farther away."""

WORST = 0.5
"""Share of the greatest distance between a curve and the stroke from which control points are
added. Where the distance is less, the curve often changes with them."""

MOST_SAMPLES = 20_000
"""Greatest number of these samples on a line."""

MOST_RELAXED, MOST_DESIGNED = 8, 6
"""Greatest number of curves that are relaxed from the smoothed stroke in the second step, and that
are designed without a start in each part of the third one."""

MOST_POINTS = 48
"""Greatest number of control points that are tried, unless the first guess has more than half of
them. More would take long, and the stroke is then most likely one that no curve can follow."""

APART = 3
"""Least number of places between two control points."""


class Line(NamedTuple):
    """A line near the surface, (n, 3), and which of its points are control points, (k,)."""

    positions: FloatArray
    control_index: IntArray


RelaxAlong = Callable[[SurfacePoints, Line], SurfaceCurve | None]
"""Relaxes the curve through control points from a line; None if there is no curve along it."""

Differs = Callable[[FloatArray], bool]
"""Whether a curve, given by its points, (n, 3), leaves the stroke."""

DesignCurve = Callable[[SurfacePoints, Line, Differs], SurfaceCurve]
"""Designs the curve through control points, or finds one that differs and is fairer than the one
along the line."""


def checked_stroke(
    mesh: Mesh, points: Any, tolerance: Any, closed: bool
) -> tuple[FloatArray, float]:
    """Check a stroke and its tolerance.

    Returns
    -------
    (n, 3) float array
        Points of the stroke, without repetitions.
    float

    Raises
    ------
    ArgumentError
        If the points or the tolerance cannot be used.
    """
    wanted = "a positive length"
    within = checked_number("tolerance", tolerance, wanted)
    if within <= 0.0:
        raise ArgumentError(f"tolerance is {tolerance!r}; pass {wanted}")
    try:
        stroke = real_array(points)
    except (TypeError, ValueError, OverflowError) as error:
        raise ArgumentError(f"points cannot be read as numbers ({error})") from error
    if stroke.ndim != 2 or stroke.shape[1] != 3:
        raise ArgumentError(f"points has shape {stroke.shape}; pass the points of a stroke, (n, 3)")
    if not np.isfinite(stroke).all():
        raise ArgumentError("points has NaN or infinite coordinates; pass finite positions")
    same = COINCIDENT * mesh.diagonal
    with np.errstate(over="ignore"):  # the square of a distance may be infinite
        kept = np.append(True, np.linalg.norm(np.diff(stroke, axis=0), axis=1) > same)
        stroke = stroke[kept]
        if closed and len(stroke) > 1 and np.linalg.norm(stroke[0] - stroke[-1]) <= same:
            stroke = stroke[:-1]
    fewest = FEWEST_CLOSED if closed else FEWEST_OPEN
    if len(stroke) < fewest:
        raise ArgumentError(
            f"points has {len(stroke)} different points; pass at least {fewest}, from one end of "
            "the stroke to the other"
        )
    return stroke, within


def fitted_points(
    mesh: Mesh,
    stroke: FloatArray,
    tolerance: float,
    closed: bool,
    relax_along: RelaxAlong,
    design: DesignCurve,
) -> SurfacePoints:
    """Few control points whose curve stays within the tolerance of a stroke.

    Parameters
    ----------
    mesh : Mesh
    stroke : (n, 3) float array
        From `checked_stroke`.
    tolerance : float
        In mesh units.
    closed : bool
    relax_along, design : callable
        See `RelaxAlong` and `DesignCurve`.

    Raises
    ------
    ControlPointError
        If the stroke is farther from the surface than the tolerance.
    UnreachableError
        If no curve stays within the tolerance of the stroke.
    """
    _, away = nearest_points(mesh, stroke)
    if not away.max() <= tolerance:
        worst = int(away.argmax())
        raise ControlPointError(
            f"points[{worst}] is {away[worst]:g} off the surface, more than the tolerance "
            f"({tolerance:g}); move the stroke onto the surface, or use a greater tolerance"
        )
    samples = _sampled(stroke, tolerance, closed)
    for places in _smoothed_lines(stroke, tolerance, closed):
        on_surface = nearest_points(mesh, places)[0]
        normals = surface_normals(mesh, on_surface.faces, on_surface.barycentric)
        fit = _Fit(mesh, places, samples, tolerance, closed, relax_along, design)
        guess = _fewest_knots(places, normals, tolerance, closed)
        most = max(MOST_POINTS, 2 * len(guess))
        few = fit.refined(_some_of(guess, closed), most, MOST_RELAXED, along=True)
        found = None
        if few is not None and len(few) < len(guess):
            found = fit.refined(few, most, MOST_DESIGNED, along=False)
        if found is None:
            found = fit.refined(guess, most, MOST_DESIGNED, along=False)
        if found is not None:
            return fit.points(found)
    raise UnreachableError(
        f"no curve was found that stays within the tolerance ({tolerance:g}) of the stroke, "
        "which may cross itself or leave the surface; draw it again, or use a greater tolerance"
    )


@dataclass(frozen=True)
class _Fit:
    """A stroke, its places, and how curves through some of these are designed."""

    mesh: Mesh
    places: FloatArray
    stroke: FloatArray
    tolerance: float
    closed: bool
    relax_along: RelaxAlong
    design: DesignCurve

    def points(self, knots: IntArray) -> SurfacePoints:
        """The points of the surface at knots, which are indices of places."""
        return snapped(nearest_points(self.mesh, self.places[knots])[0])

    def refined(self, knots: IntArray, most: int, rounds: int, *, along: bool) -> IntArray | None:
        """Knots, with others added until their curve stays near the stroke; None if that fails.

        Parameters
        ----------
        knots : (k,) int array
        most : int
            Greatest number of knots.
        rounds : int
            Greatest number of curves that are designed.
        along : bool
            Whether each curve is relaxed from the line through all places.
        """
        for _ in range(rounds):
            checkpoint()
            if len(knots) > most:
                return None
            curve, line = None, Line(self.places, knots)
            # Two of the points may coincide, or lie on different parts.
            with contextlib.suppress(ControlPointError, UnreachableError, CurveError):
                if along:
                    curve = self.relax_along(self.points(knots), line)
                else:
                    curve = self.design(self.points(knots), line, self.differs)
            missing = np.arange(0) if curve is None else self.missing(knots, curve.points)
            if curve is not None and not len(missing):
                return knots
            finer = knots
            for place in missing:
                finer = _with_knot(finer, len(self.places), self.closed, int(place))
            if not len(missing):
                finer = _with_knot(knots, len(self.places), self.closed, None)
            if len(finer) == len(knots):
                return None
            knots = finer
        return None

    def differs(self, curve: FloatArray) -> bool:
        """Whether a curve, (n, 3), is too far from the stroke somewhere."""
        return bool((self._away(curve)[1] > WITHIN * self.tolerance).any())

    def _away(self, curve: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Points of the stroke and of a curve, (m, 3), and their distances from the other, (m,)."""
        line = _sampled(curve, self.tolerance, self.closed)
        away = cKDTree(line).query(self.stroke)[0], cKDTree(self.stroke).query(line)[0]
        return np.concatenate([self.stroke, line]), np.concatenate(away)

    def missing(self, knots: IntArray, curve: FloatArray) -> IntArray:
        """The places between knots where a curve is farthest from the stroke, the worst first.

        At most one lies between any two knots. Empty if the curve is near the stroke everywhere.
        Distances count from the curve to the stroke and from the stroke to the curve.
        """
        both, away = self._away(curve)
        limit = max(WITHIN * self.tolerance, WORST * float(away.max()))
        far = np.flatnonzero(away > limit)
        far = far[np.argsort(-away[far], kind="stable")]
        place = cKDTree(self.places).query(both[far])[1]
        gap = np.searchsorted(knots, place, side="right")
        gap %= len(knots) if self.closed else len(self.places)
        _, first = np.unique(gap, return_index=True)
        found: IntArray = place[np.sort(first)]
        return found


def _some_of(knots: IntArray, closed: bool) -> IntArray:
    """Some of the knots, with both ends of an open curve."""
    fewest = FEWEST_CLOSED if closed else FEWEST_OPEN
    count = max(fewest, len(knots) // SPARSE)
    chosen = np.linspace(0, len(knots) - (not closed), count, endpoint=not closed)
    return knots[np.unique(chosen.astype(np.int64))]


def _smoothed_lines(stroke: FloatArray, tolerance: float, closed: bool) -> Iterator[FloatArray]:
    """Places on smooth lines near a stroke, evenly spaced, (m, 3).

    A closed line ends before its first place. The first line is smoothed fully. Another follows if
    that cuts corners off; it is smoothed less.
    """
    line = np.concatenate([stroke, stroke[:1]]) if closed else stroke
    degree = min(3, len(line) - 1)
    squares = len(line) * (SMOOTHING * tolerance) ** 2
    weights = np.ones(len(line))
    if not closed:
        weights[[0, -1]] = AT_ENDS
    share = np.linspace(0.0, 1.0, 4 * MOST_PLACES)
    for number, smoothing in enumerate(np.append(squares * 0.25 ** np.arange(SMOOTHINGS), 0.0)):
        spline, _ = splprep(line.T, w=weights, s=smoothing, k=degree, per=closed)
        fine = np.stack(splev(share, spline), axis=1)
        keeps_corners = cKDTree(fine).query(stroke)[0].max() <= CORNERS * tolerance
        if number == 0 or keeps_corners or smoothing == 0.0:
            yield _evenly_spaced(fine, tolerance, closed)
        if keeps_corners:
            return


def _evenly_spaced(line: FloatArray, tolerance: float, closed: bool) -> FloatArray:
    """Places on a line, (m, 3); a closed one ends before its first place."""
    arcs = arc_lengths(np.diff(line, axis=0))
    count = int(np.clip(2.0 * arcs[-1] / tolerance, PLACES, MOST_PLACES))
    wanted = np.linspace(0.0, arcs[-1], count, endpoint=not closed)
    return np.stack([np.interp(wanted, arcs, line[:, axis]) for axis in range(3)], axis=1)


def _fewest_knots(
    places: FloatArray, normals: FloatArray, tolerance: float, closed: bool
) -> IntArray:
    """Places whose cubic spline stays near all of them.

    They are added where it is farthest, and then removed where that is possible. Distances along
    the normals of the surface do not count, since the curve bends with the surface by itself.
    """
    m = len(places)
    knots = np.array([0, m // 3, 2 * m // 3] if closed else [0, m - 1])
    within = MARGIN * tolerance
    while True:
        away = _off_spline(places, normals, knots, tolerance, closed)
        if away.max() <= within:
            break
        finer = _with_knot(knots, m, closed, int(away.argmax()))
        if len(finer) == len(knots):
            break
        knots = finer
    fewest = FEWEST_CLOSED if closed else FEWEST_OPEN
    for knot in knots[1:] if closed else knots[1:-1]:
        fewer = knots[knots != knot]
        if len(fewer) >= fewest and (
            _off_spline(places, normals, fewer, tolerance, closed).max() <= within
        ):
            knots = fewer
    return knots


def _with_knot(knots: IntArray, m: int, closed: bool, wanted: int | None) -> IntArray:
    """Knots with another one at or near a wanted place, or in the middle of the widest gap.

    They stay as they are if there is no room for another one.
    """
    ends = np.append(knots, knots[0] + m) if closed else knots
    gap = int(np.diff(ends).argmax())
    if wanted is not None:
        gap = min(int(np.searchsorted(ends, wanted, side="right")) - 1, len(ends) - 2)
    low, high = int(ends[gap]), int(ends[gap + 1])
    if high - low < 2 * APART:
        gap = int(np.diff(ends).argmax())
        low, high = int(ends[gap]), int(ends[gap + 1])
        wanted = None
        if high - low < 2 * APART:
            return knots
    place = (low + high) // 2 if wanted is None else wanted
    place = min(max(place, low + APART), high - APART)
    return np.sort(np.append(knots, place % m))


def _off_spline(
    places: FloatArray, normals: FloatArray, knots: IntArray, tolerance: float, closed: bool
) -> FloatArray:
    """Distance of each place from the cubic spline through knots, (m,), across the normals."""
    spline = interpolating_spline(places[knots], closed)
    count = int(np.clip(spline.x[-1] / (DENSE * tolerance), 2 * len(places), MOST_SAMPLES))
    line = spline(np.linspace(0.0, spline.x[-1], count))
    way = line[cKDTree(line).query(places)[1]] - places
    way -= (way * normals).sum(axis=1, keepdims=True) * normals
    found: FloatArray = np.linalg.norm(way, axis=1)
    return found


def _sampled(line: FloatArray, tolerance: float, closed: bool) -> FloatArray:
    """Points of a polyline that are much closer to each other than the tolerance."""
    whole = np.concatenate([line, line[:1]]) if closed else line
    arcs = arc_lengths(np.diff(whole, axis=0))
    count = int(np.clip(arcs[-1] / (DENSE * tolerance), len(whole), MOST_SAMPLES))
    at = np.union1d(np.linspace(0.0, arcs[-1], count), arcs)
    return np.stack([np.interp(at, arcs, whole[:, axis]) for axis in range(3)], axis=1)
