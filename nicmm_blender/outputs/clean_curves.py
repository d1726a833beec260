# SPDX-License-Identifier: GPL-3.0-or-later
"""Computes what objects show of a curve: even points, every edge crossing, or Bézier knots.

The core does the fitting, in a space with the proportions of the scene. Whatever an object shows,
its record holds the exact curve.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from ..scene import surface_cache
from ..scene.surface import Surface

if TYPE_CHECKING:
    from ...nicmm_core import Mesh, SurfaceCurve
    from ...nicmm_core.splines.even_spacing import SampledCurve

EVEN, EXACT, BEZIER = "EVEN", "EXACT", "BEZIER"

COLLINEAR = 1e-4
"""Sine of the angle up to which the two handles of a knot count as collinear."""


@dataclass(frozen=True)
class Drawing:
    """How curves are drawn: the kind of spline, and radius and offset in scene units."""

    spline: str
    radius: float
    offset: float


@dataclass(frozen=True)
class Polyline:
    """Points of a spline in the mesh's local space, (n, 3)."""

    closed: bool
    points: np.ndarray


@dataclass(frozen=True)
class Knots:
    """Bézier knots of a spline with their handles, in the mesh's local space, each (n, 3).

    `smooth`, (n,), tells whether the handles of a knot are collinear.
    """

    closed: bool
    points: np.ndarray
    left: np.ndarray
    right: np.ndarray
    smooth: np.ndarray


Spline = Polyline | Knots


def splines(
    surface: Surface,
    curves: list[SurfaceCurve],
    drawing: Drawing,
    corners: np.ndarray,
) -> list[Spline]:
    """The splines that show curves, each a `Polyline` or `Knots`.

    `corners`, (k,), tells which of their control points are corners, where the handles of knots are
    free.
    """
    if drawing.spline == BEZIER:
        return [
            _knots(surface, curve, drawing, sharp)
            for curve, sharp in zip(curves, _indices(curves, corners), strict=True)
        ]
    return [
        Polyline(curve.closed, _offset_points(surface, curve, drawing.offset))
        for curve in on_surface(surface, curves, drawing, corners)
    ]


def on_surface(
    surface: Surface, curves: list[SurfaceCurve], drawing: Drawing, corners: np.ndarray
) -> Sequence[SurfaceCurve | SampledCurve]:
    """Curves of the core whose points are those of the polylines to draw.

    They have a point at every control point. `corners`, (k,), tells which of these are corners;
    evenly spaced points are close to these, so that a tube is not thinner further away.
    """
    if drawing.spline == EXACT:
        return curves
    from ...nicmm_core.splines.even_spacing import even_curve

    mesh = surface_cache.core_mesh(surface)
    tolerance, radius = _tolerance(surface, mesh, drawing), drawing.radius / surface.unit
    return [
        even_curve(mesh, curve, tolerance, sharp, beside=radius)
        for curve, sharp in zip(curves, _indices(curves, corners), strict=True)
    ]


def _indices(curves: list[SurfaceCurve], corners: np.ndarray) -> list[np.ndarray]:
    """The indices of corners among the points of each curve."""
    passed = [curve.control_index[curve.control_index >= 0] for curve in curves]
    sharp = np.split(corners, np.cumsum([len(index) for index in passed]))[:-1]
    return [index[here] for index, here in zip(passed, sharp, strict=True)]


def automatic_radius(surface: Surface, radius: float, thickness: float) -> float:
    """The radius in scene units; if it is zero, the given fraction of the surface's diagonal."""
    return radius or thickness * surface.diagonal * surface.scale


def _knots(surface: Surface, curve: SurfaceCurve, drawing: Drawing, corners: np.ndarray) -> Knots:
    """Knots on a curve; their handles are free at the points with the indices `corners`."""
    from ...nicmm_core.splines.bezier import fit_bezier

    mesh = surface_cache.core_mesh(surface)
    points = _offset_points(surface, curve, drawing.offset) @ surface.local_to_core.T
    tolerance = _tolerance(surface, mesh, drawing)
    fitted = fit_bezier(points, curve.closed, curve.control_index, tolerance, corners)
    back = np.linalg.inv(surface.local_to_core).T
    left, right = fitted.left - fitted.knots, fitted.right - fitted.knots
    across = np.linalg.norm(np.cross(left, right), axis=1)
    sizes = np.linalg.norm(left, axis=1) * np.linalg.norm(right, axis=1)
    smooth = (across <= COLLINEAR * sizes) & (np.einsum("nj,nj->n", left, right) < 0.0)
    smooth[fitted.control_index[np.isin(curve.control_index, corners)]] = False
    return Knots(curve.closed, fitted.knots @ back, fitted.left @ back, fitted.right @ back, smooth)


def _offset_points(
    surface: Surface, curve: SurfaceCurve | SampledCurve, offset: float
) -> np.ndarray:
    """Points of a curve in the mesh's local space, offset from the surface along its normals."""
    if not offset:
        return surface.points(curve.faces, curve.barycentric)
    from ...nicmm_core.splines.normal_offset import offset_points

    # A reflection turns the normals of the core's mesh inwards.
    height = np.sign(np.linalg.det(surface.local_to_core)) * offset / surface.unit
    points = offset_points(surface_cache.core_mesh(surface), curve.faces, curve.barycentric, height)
    return points @ np.linalg.inv(surface.local_to_core).T


def _tolerance(surface: Surface, mesh: Mesh, drawing: Drawing) -> float:
    from ...nicmm_core.geometry.tolerances import of_clean_curve

    return of_clean_curve(mesh.diagonal, drawing.radius / surface.unit)
