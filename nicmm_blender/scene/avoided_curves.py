# SPDX-License-Identifier: GPL-3.0-or-later
"""The curves that a designed curve avoids: those above it in the list of curves of its mesh.

Each curve can avoid only curves above it, so there are no cycles. A curve that avoids others
follows when one of those changes.
"""

from __future__ import annotations

from collections.abc import Collection

import bpy

from . import curve_record
from .curve_record import CurveSettings
from .junctions import OtherCurve
from .messages import InputError
from .surface import Surface


def above(
    curve_object: bpy.types.Object | None,
    mesh_object: bpy.types.Object,
    surface: Surface,
    settings: CurveSettings,
) -> tuple[OtherCurve, ...]:
    """The curves that a curve with some settings avoids, as they are now.

    Drawings that have no curve yet are left out, and exact copies of the curve: a duplicate is
    avoided only after it, or its original, has been changed.

    Parameters
    ----------
    curve_object : bpy.types.Object or None
        The curve object; None for a new curve, which is below all others.
    mesh_object : bpy.types.Object
        Its mesh object.
    surface : Surface
        The surface that it lies on.
    settings : CurveSettings
        Its settings.
    """
    if not settings.avoids:
        return ()
    curves = curve_record.designed_on(mesh_object)
    if curve_object in curves:
        curves = curves[: curves.index(curve_object)]
    return tuple(
        _other(each, surface)
        for each in curves
        if not curve_record.is_unfinished(each)
        and (curve_object is None or not curve_record.have_same_points(each, curve_object))
    )


def from_first_of(changed: Collection[bpy.types.Object]) -> list[bpy.types.Object]:
    """The curves that avoid others, from the first of the given curves of one mesh on."""
    mesh_object = curve_record.mesh_of(next(iter(changed))) if changed else None
    if mesh_object is None:
        return []
    curves = curve_record.designed_on(mesh_object)
    first = next((number for number, each in enumerate(curves) if each in changed), len(curves))
    return [each for each in curves[first:] if _avoids(each)]


def _avoids(curve_object: bpy.types.Object) -> bool:
    """Whether a curve avoids those above it; False if its record is damaged or has no curve."""
    try:
        return curve_record.settings_of(curve_object).avoids and curve_record.has_curve(
            curve_object
        )
    except InputError:
        return False


def _other(curve_object: bpy.types.Object, surface: Surface) -> OtherCurve:
    """Another curve on a surface, or why it is not known there."""
    uid, name = curve_object.session_uid, curve_object.name
    try:
        uses = curve_record.settings_of(curve_object).use_modifiers
        if uses != surface.with_modifiers:
            raise InputError(
                f'"{name}", which is to be avoided, lies on another surface: Use Modifiers is '
                f"{'on' if uses else 'off'} there. Set it alike for both curves, or move this "
                "curve above that one in the list"
            )
        return OtherCurve(uid, name, tuple(curve_record.read_curves(curve_object, surface)))
    except InputError as error:
        return OtherCurve(uid, name, (), str(error))
