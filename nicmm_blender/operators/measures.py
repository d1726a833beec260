# SPDX-License-Identifier: GPL-3.0-or-later
"""Measures of designed curves in the units of the scene, computed again only after changes.

Panels ask for them while they are drawn, so they are computed soon afterwards, not then.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import bpy
import numpy as np
from bpy.app.handlers import persistent

from ..scene import curve_record, surface_cache
from ..scene.lookup import by_uid
from ..scene.messages import InputError
from ..scene.surface import Surface, group_weights
from ..scene.viewports import redraw_sidebars

if TYPE_CHECKING:
    from ...nicmm_core.measures import CurvatureSamples

DELAY = 0.1
"""Seconds between the drawing of a panel and the computation."""

COMB = 0.1
"""Length of a tooth of the comb and its radius of curvature, at a scale of 1, in diagonals."""


@dataclass(frozen=True)
class Measured:
    """Measures of the curves of an object, or why they cannot be computed.

    Attributes
    ----------
    values : list of dict
        For each curve, those of `SurfaceCurve.measures` in scene units.
    combs : list of (n, 2, 3) float array
        For each curve, the ends of the teeth of its comb at a scale of 1, in the local space of the
        mesh: on the curve, and away from it.
    closed : list of bool
        Whether each curve is closed.
    problem : str
    """

    values: list[dict[str, Any]]
    combs: list[np.ndarray]
    closed: list[bool]
    problem: str = ""


_measured: dict[int, tuple[int, Measured]] = {}
_wanted: set[int] = set()


def of(curve: bpy.types.Object) -> Measured | None:
    """The measures of a curve; None if they have to be computed first, which is then done soon."""
    uid = curve.session_uid
    found = _measured.get(uid)
    if found is not None and found[0] == surface_cache.changes():
        return found[1]
    _wanted.add(uid)
    if not bpy.app.timers.is_registered(_compute_wanted):
        bpy.app.timers.register(_compute_wanted, first_interval=DELAY)
    return None


def now(curve: bpy.types.Object) -> Measured:
    """The measures of a curve, computed at once if they are not known."""
    from ... import nicmm_core as nicmm

    found = _measured.get(curve.session_uid)
    if found is None or found[0] != surface_cache.changes():
        try:
            measured = _measure(curve)
        except (InputError, nicmm.NicmmError, ImportError) as error:
            measured = Measured([], [], [], str(error))
        found = _measured[curve.session_uid] = surface_cache.changes(), measured
    return found[1]


def _compute_wanted() -> float | None:
    """Compute what panels have asked for, but not during a render: reading makes objects."""
    if bpy.app.is_job_running("RENDER"):
        return DELAY
    wanted = [by_uid(uid) for uid in _wanted]
    _wanted.clear()
    for curve in wanted:
        if curve_record.has_record(curve):
            now(curve)
    redraw_sidebars()
    return None


def _measure(curve: bpy.types.Object) -> Measured:
    from ...nicmm_core.measures import curvature_samples

    mesh_object = curve_record.mesh_in_any_scene(curve)
    settings = curve_record.settings_of(curve)
    surface = surface_cache.get(mesh_object, settings.use_modifiers)
    curves = curve_record.read_curves(curve, surface)
    weights = None
    if settings.obstacle_group in mesh_object.vertex_groups:
        weights = group_weights(mesh_object, settings.obstacle_group, surface.with_modifiers)
    corners = np.flatnonzero(curve_record.corners_of(curve))
    values, combs = [], []
    with surface_cache.designer_of(surface) as designer:
        for each in curves:
            bends = corners[corners < len(each.control_index)]
            found = designer.measures(each, weights, _up(surface), bends)
            values.append(_in_scene(found, surface.unit))
            combs.append(_comb(surface, curvature_samples(designer.mesh, each)))
    return Measured(values, combs, [each.closed for each in curves])


def _up(surface: Surface) -> np.ndarray:
    """The z axis of the scene in the space of the core."""
    to_world = surface.local_to_world[:3, :3] @ np.linalg.inv(surface.local_to_core)
    return to_world.T @ np.array([0.0, 0.0, 1.0])


def _in_scene(found: dict[str, Any], unit: float) -> dict[str, Any]:
    """Measures in scene units."""
    powers = {"length": 1, "area": 2, "least_radius": 1, "distance_to_obstacle": 1}
    result = dict(found)
    for name, power in powers.items():
        if result[name] is not None:
            result[name] *= unit**power
    result["leg_lengths"] = [unit * length for length in result["leg_lengths"]]
    return result


def _comb(surface: Surface, samples: CurvatureSamples) -> np.ndarray:
    """The teeth of a comb at a scale of 1, in local space, (n, 2, 3)."""
    size = (COMB * float(np.linalg.norm(np.ptp(surface.core_positions, axis=0)))) ** 2
    tips = samples.points - size * samples.curvature[:, None] * samples.conormals
    both: np.ndarray = np.stack([samples.points, tips], axis=1)
    return both @ np.linalg.inv(surface.local_to_core).T


def text_of(scene: bpy.types.Scene, value: float, power: int = 1) -> str:
    """A length or an area in the units of the scene, as text."""
    if np.isinf(value):
        return "∞"
    units = scene.unit_settings
    if units.system == "NONE":
        return f"{value:.5g}"
    kind = {1: "LENGTH", 2: "AREA"}[power]
    return str(
        bpy.utils.units.to_string(
            units.system, kind, value * units.scale_length**power, precision=5
        )
    )


@persistent
def forget(*_arguments: object) -> None:
    """Drop all measures before another file is opened."""
    _measured.clear()
    _wanted.clear()


def register() -> None:
    bpy.app.handlers.load_pre.append(forget)


def unregister() -> None:
    if bpy.app.timers.is_registered(_compute_wanted):
        bpy.app.timers.unregister(_compute_wanted)
    bpy.app.handlers.load_pre.remove(forget)
    forget()
