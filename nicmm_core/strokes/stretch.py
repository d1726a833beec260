"""Replaces a stretch of a curve by a stroke that begins and ends on the curve."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..geometry.array_types import FloatArray, IntArray
from ..geometry.curve import SurfaceCurve, leg_lengths
from ..geometry.curve_places import CurvePlace, nearest_place
from ..geometry.mesh import Mesh


@dataclass(frozen=True)
class Stretch:
    """The control points that a curve keeps when a stretch of it is replaced.

    Attributes
    ----------
    before, after : (n,) int array
        Indices of control points before the stroke, and after it. Those of a closed curve are all
        before it, in the order in which the curve visits them from the end of the stroke on.
    reversed : bool
        Whether the stroke runs against the curve.
    """

    before: IntArray
    after: IntArray
    reversed: bool


def stretch_between(mesh: Mesh, curve: SurfaceCurve, start: FloatArray, end: FloatArray) -> Stretch:
    """The control points that are kept when a stroke replaces a stretch of a curve.

    A closed curve loses the shorter of both stretches.

    Parameters
    ----------
    mesh : Mesh
    curve : SurfaceCurve
        A curve on the mesh through all of its control points.
    start, end : (3,) float array
        Positions near the curve at which the stroke begins and ends.
    """
    places = nearest_place(mesh, curve, start), nearest_place(mesh, curve, end)
    legs = leg_lengths(curve)
    arcs = [float(legs[: place.leg].sum() + place.share * legs[place.leg]) for place in places]
    count = len(curve.control_index)
    if not curve.closed:
        is_reversed = arcs[1] < arcs[0]
        first, last = places[::-1] if is_reversed else places
        return Stretch(np.arange(first.leg + 1), np.arange(last.leg + 1, count), is_reversed)
    total = float(legs.sum())
    is_reversed = (arcs[1] - arcs[0]) % total > 0.5 * total
    first, last = places[::-1] if is_reversed else places
    return Stretch(_kept(first, last, count), np.arange(0), is_reversed)


def _kept(first: CurvePlace, last: CurvePlace, count: int) -> IntArray:
    """Control points of a closed curve from a place on to another one, around the curve."""
    is_same = last.leg == first.leg and last.share >= first.share
    number = count if is_same else (first.leg - last.leg) % count
    return (last.leg + 1 + np.arange(number)) % count
