"""Energies of curves with nodes, by which different curves of one request are compared."""

from __future__ import annotations

from collections.abc import Sequence

from .curve_nodes import CurveSurface
from .elastic_energy import bending_energy, comparable_energies
from .noded_curve import NodedCurve


def energies_of(
    surface: CurveSurface, curves: Sequence[NodedCurve], smoothness: float
) -> list[float]:
    """Energies of curves, with the least length among them as the common length scale."""
    scale = min(curve.length for curve in curves)
    return [
        float(comparable_energies(surface, curve.nodes, smoothness, scale)[0]) for curve in curves
    ]


def scaled_bending(curve: NodedCurve) -> float:
    """L ∮ κ_g² ds, which does not depend on the unit of length."""
    return bending_energy(curve.nodes) * curve.length
