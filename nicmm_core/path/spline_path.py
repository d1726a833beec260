"""Interpolates control points by a cubic spline in space, which bends about as little as possible.

Where control points are close together, the curve of a design bends like this spline. So the places
of the surface nearest to the spline are a good start.
"""

from __future__ import annotations

import itertools

import numpy as np
from scipy.interpolate import CubicSpline

from ..geometry.array_types import BoolArray, FloatArray, IntArray
from ..geometry.curve import arc_lengths

SAMPLES, FEWEST_OF_A_LEG = 256, 6
"""Approximate number of samples of a spline, and least number of them on a leg."""


def interpolating_spline(points: FloatArray, closed: bool) -> CubicSpline:
    """The natural, or periodic, cubic spline through points.

    Parameters
    ----------
    points : (k, 3) float array
        At least two points, any two consecutive ones different.
    closed : bool
        Whether the spline returns to the first point.

    Returns
    -------
    CubicSpline
        A function of the length of the chords from the first point, its knots `x`.
    """
    whole = np.concatenate([points, points[:1]]) if closed else points
    at = arc_lengths(np.diff(whole, axis=0))
    return CubicSpline(at, whole, bc_type="periodic" if closed else "natural")


def spline_samples(
    points: FloatArray, closed: bool, corners: BoolArray
) -> tuple[FloatArray, IntArray]:
    """Samples of the spline through points, which may turn freely at some of them.

    Parameters
    ----------
    points : (k, 3) float array
        At least two points, any two consecutive ones different.
    closed : bool
    corners : (k,) bool array
        Points at which the spline may turn.

    Returns
    -------
    (n, 3) float array
        Samples; those of a closed spline end before its first point.
    (k,) int array
        Index of each point among them, ascending.
    """
    first = int(corners.argmax()) if closed else 0  # a closed spline begins at a corner
    line = np.roll(points, -first, axis=0)
    bends = np.flatnonzero(np.roll(corners, -first))
    whole = interpolating_spline(line, closed)
    if closed and len(bends):
        line = np.concatenate([line, line[:1]])
    breaks = np.unique(np.concatenate([[0, len(line) - 1], bends])) if len(bends) else None
    counts = np.rint(SAMPLES * np.diff(whole.x) / whole.x[-1]).astype(np.int64)
    counts = counts.clip(FEWEST_OF_A_LEG)
    index = np.append(0, np.cumsum(counts))
    at = np.interp(np.arange(index[-1] + 1), index, whole.x)
    if breaks is None:
        samples = whole(at)
    else:
        samples = np.empty((len(at), 3))
        for begin, end in itertools.pairwise(breaks.tolist()):
            part = interpolating_spline(line[begin : end + 1], False)
            inside = slice(index[begin], index[end] + 1)
            samples[inside] = part(at[inside] - at[index[begin]])
    if closed:
        begin = index[-first % len(points)]  # of the point that comes first
        samples, index = np.roll(samples[:-1], -begin, axis=0), index[:-1]
        index = np.sort((index - begin) % len(samples))
    return samples, index
