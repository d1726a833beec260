# SPDX-License-Identifier: GPL-3.0-or-later
"""The mirror of a symmetric curve: a plane of the object, or that of its Mirror modifier."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import bpy
import numpy as np

from .messages import InputError
from .surface import Surface

if TYPE_CHECKING:
    from ...nicmm_core.geometry.mirror import Plane
    from .curve_record import CurveSettings

NONE, MODIFIER = "NONE", "MODIFIER"
AXES = ("X", "Y", "Z")
JOINED, PAIR = "JOINED", "PAIR"

CHOICES = {"mirror_axis": (NONE, *AXES, MODIFIER), "mirror_as": (JOINED, PAIR)}
"""Identifiers of the two settings."""

NO_AXIS = (
    'The Mirror modifier "{modifier}" of "{mesh}" has no axis enabled. Enable one, or set Mirror '
    "to another plane"
)


@dataclass(frozen=True, eq=False)
class Mirror:
    """The mirror of a curve.

    Attributes
    ----------
    point, normal : (3,) float array
        A point of the plane and its unit normal, in the space of the core.
    joined : bool
        Whether one curve passes through the control points and their mirror images; otherwise the
        mirror image of the curve is a second curve.
    """

    point: np.ndarray
    normal: np.ndarray
    joined: bool

    def argument(self) -> np.ndarray:
        """The plane as the core takes it, (2, 3)."""
        return np.stack([self.point, self.normal])

    @cached_property
    def plane(self) -> Plane:
        """The plane of the core."""
        from ...nicmm_core.geometry.mirror import Plane

        return Plane(self.point, self.normal)


def mirror_of(
    mesh_object: bpy.types.Object, surface: Surface, settings: CurveSettings
) -> Mirror | None:
    """The mirror of a curve with these settings, or None; only the elastic method has one."""
    if settings.mirror_axis == NONE or settings.method != "ELASTIC":
        return None
    if settings.mirror_axis == MODIFIER:
        point, covector = _plane_of_modifier(mesh_object, surface)
    else:
        point, covector = np.zeros(3), np.eye(3)[AXES.index(settings.mirror_axis)]
    # A normal is no vector but a linear form, so it is mapped by the inverse transpose.
    normal = np.linalg.inv(surface.local_to_core).T @ covector
    normal /= np.linalg.norm(normal)
    return Mirror(surface.local_to_core @ point, normal, settings.mirror_as == JOINED)


def modifier_of(mesh_object: bpy.types.Object | None) -> bpy.types.MirrorModifier | None:
    """The first Mirror modifier of an object that the viewport shows, or None."""
    found = [] if mesh_object is None else mesh_object.modifiers
    shown = (each for each in found if each.type == "MIRROR" and each.show_viewport)
    return next(shown, None)


def _plane_of_modifier(
    mesh_object: bpy.types.Object, surface: Surface
) -> tuple[np.ndarray, np.ndarray]:
    """A point of the plane of the Mirror modifier and its normal, in the object's local space."""
    modifier = modifier_of(mesh_object)
    if modifier is None:
        raise InputError(
            f'"{mesh_object.name}" has no Mirror modifier that the viewport shows. Add or enable '
            "one, or set Mirror to another plane"
        )
    enabled = np.flatnonzero(np.array(modifier.use_axis[:], dtype=bool))
    if not len(enabled):
        raise InputError(NO_AXIS.format(modifier=modifier.name, mesh=mesh_object.name))
    axis = np.eye(3)[enabled[0]]
    if modifier.mirror_object is None:
        return np.zeros(3), axis
    # In its own space, the plane of the other object passes through the origin.
    to_world = np.array(modifier.mirror_object.matrix_world, dtype=np.float64)
    to_local = np.linalg.inv(surface.local_to_world)
    linear = (to_local @ to_world)[:3, :3]
    if abs(np.linalg.det(to_world[:3, :3])) == 0.0:
        raise InputError(
            f'"{modifier.mirror_object.name}", the mirror object of "{modifier.name}", has a scale '
            "of zero. Reset it (Object > Clear > Scale)"
        )
    return (to_local @ to_world[:, 3])[:3], np.linalg.inv(linear).T @ axis
