"""Places on a curve: by the leg and the fraction of its length, or nearest to a position.

A leg runs from a control point to the next one and has the index of the control point at which it
begins. A place on it stays at the same fraction of the leg while the curve changes.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .array_types import FloatArray
from .curve import (
    SurfaceCurve,
    arc_lengths,
    leg_of_segment,
    point_on_segment,
    points_of,
    points_of_leg,
)
from .mesh import Mesh
from .surface_points import SurfacePoints
from .tolerances import COINCIDENT, SNAP, TINY


@dataclass(frozen=True)
class CurvePlace:
    """A place on a curve through all of its control points.

    Attributes
    ----------
    leg : int
        Index of the control point at which its leg begins.
    share : float
        Fraction of the length of the leg, from 0 to 1.
    """

    leg: int
    share: float


def number_of_legs(curve: SurfaceCurve) -> int:
    """The number of legs of a curve through all of its control points."""
    return len(curve.control_index) - (not curve.closed)


def point_at(mesh: Mesh, curve: SurfaceCurve, place: CurvePlace) -> SurfacePoints:
    """The point of a curve at a place, exactly on the curve; at an end of a leg its control point.

    Parameters
    ----------
    mesh : Mesh
    curve : SurfaceCurve
        A curve on the mesh through all of its control points.
    place : CurvePlace

    Returns
    -------
    SurfacePoints
        One point.
    """
    index, arcs = points_of_leg(curve, place.leg), _arcs(curve, place.leg)
    arc = place.share * arcs[-1]
    segment = int(np.searchsorted(arcs, arc, side="right") - 1)
    segment = min(max(segment, 0), len(arcs) - 2)
    length = max(arcs[segment + 1] - arcs[segment], TINY)
    share = float(((arc - arcs[segment]) / length).clip(0.0, 1.0))
    if place.share >= 1.0:
        segment, share = len(arcs) - 2, 1.0
    return _on_segment(mesh, curve, int(index[segment]), share)


def distances(curve: SurfaceCurve, positions: FloatArray) -> FloatArray:
    """Distance of positions (k, 3) from a curve in space, (k,)."""
    return np.array([nearest_segment(curve, position)[2] for position in positions])


def nearest_control_point(curve: SurfaceCurve, position: FloatArray) -> tuple[SurfacePoints, float]:
    """The control point of a curve nearest to a position, (3,), and its distance.

    The distance is infinite if the curve passes no control point.
    """
    passed = curve.control_index[curve.control_index >= 0]
    away = np.linalg.norm(curve.points[passed] - position, axis=1)
    nearest = passed[away.argsort()[:1]]
    return points_of(curve)[nearest], float(away.min(initial=np.inf))


def nearest_point(
    mesh: Mesh, curve: SurfaceCurve, position: FloatArray
) -> tuple[SurfacePoints, float]:
    """The point of a curve nearest to a position, exactly on the curve, and its distance.

    Parameters
    ----------
    mesh : Mesh
    curve : SurfaceCurve
        A curve on the mesh.
    position : (3,) float array

    Returns
    -------
    SurfacePoints
        One point.
    float
    """
    segment, share, _ = nearest_segment(curve, position)
    point = _on_segment(mesh, curve, segment, share)
    return point, float(np.linalg.norm(point.positions(mesh)[0] - position))


def nearest_place(mesh: Mesh, curve: SurfaceCurve, position: FloatArray) -> CurvePlace:
    """The place of a curve nearest to a position.

    Near a control point, up to `tolerances.COINCIDENT`, it is the end of a leg.

    Parameters
    ----------
    mesh : Mesh
    curve : SurfaceCurve
        A curve on the mesh through all of its control points.
    position : (3,) float array
    """
    away = np.linalg.norm(curve.points[curve.control_index] - position, axis=1)
    control, last = int(away.argmin()), number_of_legs(curve)
    if away[control] <= COINCIDENT * mesh.diagonal:
        return CurvePlace(control, 0.0) if control < last else CurvePlace(control - 1, 1.0)
    segment, share, _ = nearest_segment(curve, position)
    leg = leg_of_segment(curve, segment)
    arcs, index = _arcs(curve, leg), points_of_leg(curve, leg)
    number = int(np.flatnonzero(index[:-1] == segment)[0])
    arc = arcs[number] + share * (arcs[number + 1] - arcs[number])
    return CurvePlace(leg, float(arc / max(arcs[-1], TINY)))


def _arcs(curve: SurfaceCurve, leg: int) -> FloatArray:
    """Length of a leg from its beginning to each of its points."""
    steps = np.diff(curve.points[points_of_leg(curve, leg)], axis=0)
    return arc_lengths(steps)


def nearest_segment(curve: SurfaceCurve, position: FloatArray) -> tuple[int, float, float]:
    """The segment of a curve nearest to a position, the fraction along it, and the distance."""
    step = curve.steps
    start = curve.points[: len(step)]
    squared = np.maximum((step * step).sum(axis=1), TINY)
    share = (((position - start) * step).sum(axis=1) / squared).clip(0.0, 1.0)
    away = np.linalg.norm(start + share[:, None] * step - position, axis=1)
    segment = int(away.argmin())
    return segment, float(share[segment]), float(away[segment])


def _on_segment(mesh: Mesh, curve: SurfaceCurve, segment: int, share: float) -> SurfacePoints:
    """A point of a segment that stays on the curve when its coordinates are rounded.

    Coordinates below `tolerances.SNAP` become zero where a point is located; such a point is
    replaced by the nearer end of the segment.
    """
    if 0.0 < share < 1.0:
        found = point_on_segment(mesh, curve, segment, share)
        weights = found.barycentric
        if not ((weights > 0.0) & (weights < SNAP)).any():
            return found
    end = (segment + (share >= 0.5)) % len(curve.faces)
    return points_of(curve)[np.array([end])]
