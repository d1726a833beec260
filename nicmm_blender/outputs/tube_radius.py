# SPDX-License-Identifier: GPL-3.0-or-later
"""The largest radius of the tube of a curve object of either type, in the space of the object."""

from __future__ import annotations

import bpy

from . import curve_object, sticky_curves


def radius_of(drawn: bpy.types.Object) -> float:
    """The radius of a curve object at its thickest point."""
    if drawn.type == "CURVES":
        return sticky_curves.radius_of(drawn.data)
    return drawn.data.bevel_depth * curve_object.largest_point_radius(drawn)


def set_radius(drawn: bpy.types.Object, radius: float) -> None:
    """Set the radius of a curve object at its thickest point; the others keep their proportions."""
    if drawn.type == "CURVES":
        sticky_curves.set_radius(drawn.data, radius)
    else:
        drawn.data.bevel_depth = radius / curve_object.largest_point_radius(drawn)
