"""Compares relaxed curves of one request by their energies and by their distances."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ..relaxation.curve_nodes import CurveSurface
from ..relaxation.elastic_energy import bending_energy, comparable_energies
from ..relaxation.noded_curve import NodedCurve
from .course_search import SAME_COURSE, farthest_between


def energies_of(
    surface: CurveSurface, curves: Sequence[NodedCurve], smoothness: float
) -> list[float]:
    """Energies of curves, with the least length among them as the common length scale."""
    scale = min(curve.length for curve in curves)
    return [
        float(comparable_energies(surface, curve.nodes, smoothness, scale)[0]) for curve in curves
    ]


def distinct_by_energy(
    surface: CurveSurface, curves: Sequence[NodedCurve], smoothness: float
) -> list[int]:
    """Indices of curves by ascending energy, without those that equal a curve of less energy."""
    chosen: list[int] = []
    for number in np.argsort(energies_of(surface, curves, smoothness), kind="stable").tolist():
        if is_apart(surface, curves[number], [curves[each] for each in chosen]):
            chosen.append(number)
    return chosen


def is_apart(surface: CurveSurface, curve: NodedCurve, others: Sequence[NodedCurve]) -> bool:
    """Whether a curve is somewhere apart from each of the others."""
    limit = SAME_COURSE * surface.mesh.diagonal
    positions = curve.nodes.positions
    return all(farthest_between(positions, other.nodes.positions) > limit for other in others)


def scaled_bending(curve: NodedCurve) -> float:
    """L ∮ κ_g² ds, which does not depend on the unit of length."""
    return bending_energy(curve.nodes) * curve.length
