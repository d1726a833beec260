# SPDX-License-Identifier: GPL-3.0-or-later
"""The radius of the tube of a curve object of either type, in the space of the object."""

from . import sticky_curves


def radius_of(drawn) -> float:
    """The radius of a curve object; of hair curves, the largest radius of their points."""
    if drawn.type == "CURVES":
        return sticky_curves.radius_of(drawn.data)
    return drawn.data.bevel_depth


def set_radius(drawn, radius: float) -> None:
    """Set the radius of a curve object; the radii of hair curves are scaled."""
    if drawn.type == "CURVES":
        sticky_curves.set_radius(drawn.data, radius)
    else:
        drawn.data.bevel_depth = radius
