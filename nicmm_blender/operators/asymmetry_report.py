# SPDX-License-Identifier: GPL-3.0-or-later
"""Words about the asymmetry of a curve on a mesh that is only nearly symmetric."""

from __future__ import annotations

from typing import TYPE_CHECKING

import bpy
import numpy as np

from ..scene.surface import Surface

if TYPE_CHECKING:
    from ...nicmm_core import Design

SYMMETRIC = 1e-5
"""Asymmetry up to which a curve counts as symmetric, in diagonals of the mesh.

Blender stores the positions of vertices in single precision.
"""


def asymmetry_text(scene: bpy.types.Scene, surface: Surface, design: Design) -> str:
    """The asymmetry in units of the scene, such as "; asymmetry 0.3 mm"; empty without one."""
    diagonal = float(np.linalg.norm(np.ptp(surface.core_positions, axis=0)))
    if design.asymmetry is None or design.asymmetry <= SYMMETRIC * diagonal:
        return ""
    units, length = scene.unit_settings, design.asymmetry * surface.unit
    if units.system == "NONE":
        return f"; asymmetry {length:.2g}"
    words = bpy.utils.units.to_string(
        units.system, "LENGTH", length * units.scale_length, precision=3
    )
    return f"; asymmetry {words}"
