"""Energies of curves with nodes, by which different curves of one request are compared."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from .curve_nodes import CurveSurface
from .discrete_curve import DiscreteCurve
from .elastic_energy import bending_energy, comparable_energies


def energies_of(
    surface: CurveSurface,
    curves: Sequence[DiscreteCurve],
    smoothness: float,
    length_scale: float | None = None,
) -> list[float]:
    """Energies of curves on a common length scale, by default the least length among them."""
    scale = min(curve.length for curve in curves) if length_scale is None else length_scale
    return [
        float(comparable_energies(surface, curve.nodes, smoothness, scale)[0]) for curve in curves
    ]


def relative_energies(
    surface: CurveSurface,
    curves: Sequence[DiscreteCurve],
    smoothness: float,
    length_scale: float | None = None,
) -> list[float]:
    """Energies relative to the least of them, so all are at least 1.

    Differences are divided by the least energy without maps, since with lanes it may be negative.
    """
    energies = energies_of(surface, curves, smoothness, length_scale)
    best = energies.index(min(energies))
    unpainted = replace(surface, feature_map=None)
    (unit,) = energies_of(unpainted, [curves[best]], smoothness, length_scale)
    return [1.0 + (energy - energies[best]) / unit for energy in energies]


def scaled_bending(curve: DiscreteCurve) -> float:
    """L ∮ κ_g² ds, which does not depend on the unit of length."""
    return bending_energy(curve.nodes) * curve.length
