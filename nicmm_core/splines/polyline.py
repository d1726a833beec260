"""Cuts a polyline at its control points, as both clean versions of a curve require."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..geometry.array_types import FloatArray, IntArray
from ..geometry.curve import arc_lengths

CORNER = np.radians(30.0)
"""Turn at one place, in radians, above which a polyline has a corner there."""


@dataclass(frozen=True)
class CutPolyline:
    """A polyline divided into legs. A closed one starts at a control point, if it has any.

    Attributes
    ----------
    points : (n, 3) float array
        Positions. A closed polyline has its first point again at the end.
    arc : (n,) float array
        Arc length from the start.
    closed : bool
    vertex : (n,) int array
        Index of each point among the original points.
    bounds : (b,) int array
        Indices of the points at which legs begin or end, ascending: the control points, the first
        point and the last.
    """

    points: FloatArray
    arc: FloatArray
    closed: bool
    vertex: IntArray
    bounds: IntArray

    @property
    def length(self) -> float:
        """Length of the polyline."""
        return float(self.arc[-1])

    def leg(self, number: int) -> CutPolyline:
        """One leg as an open polyline of its own."""
        start, end = self.bounds[number : number + 2]
        part = slice(start, end + 1)
        arc = self.arc[part] - self.arc[start]
        bounds = np.array([0, end - start])
        return CutPolyline(self.points[part], arc, False, self.vertex[part], bounds)

    def positions(self, at: FloatArray) -> FloatArray:
        """Positions at arc lengths of any shape (...), shape (..., 3).

        On a closed polyline arc lengths wrap around; on an open one they are clamped to its ends.
        """
        if self.closed:
            at = np.mod(at, self.arc[-1])
        axes = [np.interp(at, self.arc, self.points[:, axis]) for axis in range(3)]
        return np.stack(axes, axis=-1)

    def turns(self, at: FloatArray, reach: FloatArray | float) -> FloatArray:
        """Angles at arc lengths between the chord over `reach` before and that over `reach` after.

        Parameters
        ----------
        at : (k,) float array
        reach : (k,) float array or float
            Arc length. At a corner the angle does not depend on it; on a smooth curve the angle is
            proportional to it.

        Returns
        -------
        (k,) float array
            In radians, 0 … π; 0 at the ends of an open polyline.
        """
        here = self.positions(at)
        before, after = here - self.positions(at - reach), self.positions(at + reach) - here
        return angles(before, after)


def angles(first: FloatArray, second: FloatArray) -> FloatArray:
    """Angles between pairs of vectors, (k, 3), in radians, (k,); 0 where a vector is zero."""
    sine = np.linalg.norm(np.cross(first, second), axis=1)
    return np.arctan2(sine, (first * second).sum(axis=1))


def cut_polyline(points: FloatArray, closed: bool, control_index: IntArray) -> CutPolyline:
    """Cut a polyline at its control points.

    Parameters
    ----------
    points : (n, 3) float array
    closed : bool
        Whether the last point is joined to the first, which is not repeated.
    control_index : (k,) int array
        Indices of the control points among the points, in any order; -1 is ignored. A closed
        polyline without control points is cut at its sharpest corner, or at its first point if it
        has no corner.
    """
    controls = np.unique(control_index[control_index >= 0])
    n = len(points)
    if not closed:
        vertex = np.arange(n)
        bounds = np.unique(np.concatenate([controls, [0, n - 1]]))
    else:
        if len(controls) == 0:
            controls = np.array([_sharpest(points)])
        vertex = (controls[0] + np.arange(n + 1)) % n
        bounds = np.append(controls - controls[0], n)
    line = points[vertex]
    arc = arc_lengths(np.diff(line, axis=0))
    return CutPolyline(line, arc, closed, vertex, bounds)


def _sharpest(points: FloatArray) -> int:
    """The sharpest corner of a closed polyline, or 0 if it has no corner."""
    before, after = points - np.roll(points, 1, axis=0), np.roll(points, -1, axis=0) - points
    turn = angles(before, after)
    # Of corners that differ only by rounding, the first one.
    return int((turn >= turn.max() - 1e-9).argmax()) if turn.max() > CORNER else 0
