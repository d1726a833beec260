# SPDX-License-Identifier: GPL-3.0-or-later
"""Junctions: control points of a curve that lie on other curves, and follow them.

A record stores the place of a junction by the leg of the other curve and the fraction of its
length, so that the point stays on the other curve when this is edited.
"""

from __future__ import annotations

import hashlib
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import bpy
import numpy as np

from . import point_lists
from .lookup import by_uid, is_in_a_scene
from .record_check import Record

if TYPE_CHECKING:
    from ...nicmm_core import Mesh, SurfaceCurve, SurfacePoints

SNAP = 1e-6
"""Distance up to which a control point is put onto another curve, in diagonals of the mesh.

It covers positions in single precision, which operators have."""

SAME_PLACE = 1e-10
"""Distance up to which a control point is on another curve already, in the same diagonals."""


@dataclass(frozen=True)
class OtherCurve:
    """A designed curve that another one avoids, on the surface of that one.

    Attributes
    ----------
    uid : int
        The session_uid of its object.
    name : str
        Name of its object.
    curves : tuple of SurfaceCurve
        Its curves; mostly one.
    problem : str
        Why its curves are unknown; empty if they are known.
    """

    uid: int
    name: str
    curves: tuple[SurfaceCurve, ...]
    problem: str = ""


@dataclass(frozen=True)
class Junction:
    """A control point on another curve.

    Attributes
    ----------
    point : int
        Index of the control point.
    uid : int
        The session_uid of the object of the other curve.
    part : int
        Index of the other curve in its object.
    leg : int
        The leg of the other curve.
    share : float
        Fraction of the length of that leg.
    legs : int
        Number of legs of the other curve.
    """

    point: int
    uid: int
    part: int
    leg: int
    share: float
    legs: int


def digest_of(other: OtherCurve) -> bytes:
    """A hash of the points of another curve."""
    found = hashlib.blake2b(digest_size=16)
    for curve in other.curves:
        found.update(bytes([curve.closed]))
        for array in (curve.faces, curve.barycentric, curve.control_index):
            found.update(np.ascontiguousarray(array).tobytes())
    return found.digest()


def followed(
    mesh: Mesh, points: SurfacePoints, junctions: Sequence[Junction], others: Sequence[OtherCurve]
) -> SurfacePoints:
    """Control points, with each junction where its place on the other curve is now.

    If the other curve has got another number of legs, the junction moves to its nearest point. A
    point on several curves follows the first of them.
    """
    from ...nicmm_core.geometry.curve_places import (
        CurvePlace,
        nearest_point,
        number_of_legs,
        point_at,
    )

    curves = {
        (other.uid, part): curve for other in others for part, curve in enumerate(other.curves)
    }
    moved = set()
    for junction in junctions:
        curve = curves.get((junction.uid, junction.part))
        if curve is None or junction.point in moved or junction.point >= len(points):
            continue
        moved.add(junction.point)
        position = points[np.array([junction.point])].positions(mesh)[0]
        if number_of_legs(curve) == junction.legs:
            place = point_at(mesh, curve, CurvePlace(junction.leg, junction.share))
        else:
            place, _ = nearest_point(mesh, curve, position)
        away = np.linalg.norm(place.positions(mesh)[0] - position)
        if away > SAME_PLACE * mesh.diagonal:
            points = point_lists.with_point(points, junction.point, place, replaced=True)
    return points


def snapped(mesh: Mesh, points: SurfacePoints, others: Sequence[OtherCurve]) -> SurfacePoints:
    """Control points, of which those within `SNAP` of another curve are put exactly onto it.

    Where curves cross, a control point of one of them lies on the others, so control points come
    first.
    """
    from ...nicmm_core.geometry.curve_places import nearest_control_point, nearest_point

    curves: dict[int, list[SurfaceCurve]] = {}
    for number, _other, _part, curve in _on_other_curves(mesh, points, others):
        curves.setdefault(number, []).append(curve)
    for number, near in curves.items():
        position = points[np.array([number])].positions(mesh)[0]
        found = (nearest_control_point(curve, position) for curve in near)
        place, away = min(found, key=lambda each: each[1])
        if away > SNAP * mesh.diagonal:
            place, away = nearest_point(mesh, near[0], position)
        if away > SAME_PLACE * mesh.diagonal:
            points = point_lists.with_point(points, number, place, replaced=True)
    return points


def _on_other_curves(
    mesh: Mesh, points: SurfacePoints, others: Sequence[OtherCurve]
) -> list[tuple[int, OtherCurve, int, SurfaceCurve]]:
    """The control points within `SNAP` of other curves.

    Each with the other object, and the index and the curve in that object.
    """
    from ...nicmm_core.geometry.curve_places import distances

    positions = points.positions(mesh)
    return [
        (number, other, part, curve)
        for other in others
        for part, curve in enumerate(other.curves)
        for number in np.flatnonzero(distances(curve, positions) <= SNAP * mesh.diagonal).tolist()
    ]


def on_curves(mesh: Mesh, points: SurfacePoints, others: Sequence[OtherCurve]) -> list[Junction]:
    """The control points on other curves that pass all their own control points, as junctions."""
    from ...nicmm_core.geometry.curve_places import nearest_place, number_of_legs

    found = []
    for number, other, part, curve in _on_other_curves(mesh, points, others):
        if (curve.control_index >= 0).all():
            position = points[np.array([number])].positions(mesh)[0]
            place, legs = nearest_place(mesh, curve, position), number_of_legs(curve)
            found.append(Junction(number, other.uid, part, place.leg, place.share, legs))
    return found


def are_junctions(mesh: Mesh, points: SurfacePoints, others: Sequence[OtherCurve]) -> np.ndarray:
    """Which control points lie on other curves, (k,)."""
    flags = np.zeros(len(points), dtype=bool)
    flags[[number for number, *_ in _on_other_curves(mesh, points, others)]] = True
    return flags


def to_store(junctions: Sequence[Junction]) -> list[dict[str, Any]]:
    """Junctions as a record stores them, each with its curve object."""
    return [
        {
            "point": junction.point,
            "curve": curve_object,
            "part": junction.part,
            "leg": junction.leg,
            "share": junction.share,
            "legs": junction.legs,
        }
        for junction in junctions
        if (curve_object := by_uid(junction.uid)) is not None
    ]


def of_record(record: Record) -> list[Junction]:
    """The junctions in a checked record, without those on curves that were deleted."""
    return [
        Junction(
            stored["point"],
            stored["curve"].session_uid,
            stored["part"],
            stored["leg"],
            stored["share"],
            stored["legs"],
        )
        for stored in record.get("junctions", ())
        if isinstance(stored.get("curve"), bpy.types.Object) and is_in_a_scene(stored["curve"])
    ]


def point_to(record: Record, former: bpy.types.Object, present: bpy.types.Object) -> None:
    """Let the junctions of a record that are on one curve object be on another one."""
    for stored in record.get("junctions", ()):
        if stored.get("curve") == former:
            stored["curve"] = present
