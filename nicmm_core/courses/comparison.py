"""Compares relaxed curves of one request, and decides whether to search for another course.

A search misses courses, the more the farther the curve winds around limbs. Searches with other
lengths find others, so the search is repeated while that pays.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ..relaxation.curve_nodes import CurveSurface
from ..relaxation.elastic_energy import bending_energy, comparable_energies
from ..relaxation.noded_curve import NodedCurve
from .course_search import SAME_COURSE, farthest_between

STRONGLY_BENT = 14.0
"""L ∮ κ_g² ds above which the search is repeated, a third of the value of a circle.

Curves above it wind around limbs, where a search misses more courses.
"""

EXTREMELY_BENT = 80.0
"""L ∮ κ_g² ds above which searches go on even if they gain little; twice the value of a circle."""

KINKED = 200.0
"""L ∮ κ_g² ds above which a curve usually has kinks, so its start is relaxed in another way too."""

FURTHER_SEARCHES = 5
"""Greatest number of repeated searches."""

FRUITLESS_SEARCHES = 2
"""Number of consecutive searches with little gain after which no further one is made."""

LEAST_GAIN = 0.02
"""Relative decrease of the energy below which a search counts as fruitless."""

MOST_WORK = 100_000
"""Work above which no further attempt is begun, in points times iterations of relaxations.

It takes two to three seconds. Curves on needles have thousands of points.
"""


def work_of_search(n_points: int) -> int:
    """Approximate work of a search through some points, in the same units."""
    return 3_000 * (1 + n_points)


def is_kinked(curve: NodedCurve) -> bool:
    """Whether a curve bends so much that any other attempt may be far better."""
    return _scaled_bending(curve) > KINKED


def is_search_worthwhile(
    surface: CurveSurface, curves: Sequence[NodedCurve], smoothness: float
) -> bool:
    """Whether the fairest curve bends so much that another search may find a far better one.

    Parameters
    ----------
    surface : CurveSurface
    curves : sequence of NodedCurve
        The relaxed curve of each search so far.
    smoothness : float
    """
    energies = energies_of(surface, curves, smoothness)
    bending = _scaled_bending(curves[int(np.argmin(energies))])
    lowest = np.minimum.accumulate(energies)
    gains = lowest[1:] < (1.0 - LEAST_GAIN) * lowest[:-1]
    fruitless = len(gains) >= FRUITLESS_SEARCHES and not gains[-FRUITLESS_SEARCHES:].any()
    return bending > EXTREMELY_BENT or (bending > STRONGLY_BENT and not fruitless)


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


def _scaled_bending(curve: NodedCurve) -> float:
    """L ∮ κ_g² ds, which does not depend on the unit of length."""
    return bending_energy(curve.nodes) * curve.length
