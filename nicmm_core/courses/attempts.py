"""Decides whether to make another attempt at a curve, from the curves relaxed so far.

The farther a curve winds around limbs, the more courses a search misses. Searches with other
lengths find others, so the search is repeated while that pays. Then the parts that bend most are
searched for again.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np

from ..relaxation.curve_nodes import CurveSurface
from ..relaxation.noded_curve import NodedCurve
from ..relaxation.relaxing import RelaxationConfig, Relaxed
from .comparison import distinct_by_energy, energies_of, scaled_bending

STRONGLY_BENT = 14.0
"""L ∮ κ_g² ds above which the search is repeated, a third of the value of a circle.

Curves above it wind around limbs, where a search misses more courses.
"""

EXTREMELY_BENT = 80.0
"""L ∮ κ_g² ds above which searches go on even if they gain little; twice the value of a circle."""

KINKED = 200.0
"""L ∮ κ_g² ds above which a curve usually has kinks, so its start is relaxed in another way too."""

FURTHER_SEARCHES = 3
"""Greatest number of repeated searches for the whole curve."""

FRUITLESS_SEARCHES = 2
"""Number of consecutive searches with little gain after which no further one is made."""

PARTLY_BENT = 30.0
"""L ∮ κ_g² ds above which the parts that bend most are searched for again."""

SEARCHES_FOR_PARTS, COURSES_OF_A_PART = 8, 2
"""Greatest number of such searches, and of courses relaxed after each of them."""

LEAST_GAIN = 0.02
"""Relative decrease of the energy below which a search counts as fruitless."""

MOST_FAILURES = 8
"""Number of courses in a row that are not simple on the mesh after which a repeated search ends.

On rough meshes each of them takes long.
"""

MOST_WORK = 2_000
"""Work of all attempts together above which no further one is begun.

In moves of all nodes (`Work`). It takes about three seconds, and longer on rough meshes.
"""

RESERVED = 800
"""Part of that work that must be left after a further search, for other attempts at kinks."""

WORK_OF_SEARCH = 40
"""Approximate work of a search, in the same unit; as much again for each control or via point."""


@dataclass
class Attempts:
    """The attempts at one curve so far, and whether another one is worth its time.

    Attributes
    ----------
    surface : CurveSurface
    smoothness : float
    n_points : int
        Number of control points and via points.
    searches : int
        Number of searches for courses begun so far, those for parts included.
    relaxed : list of Relaxed
        The result of each attempt.
    relaxed_after : list of int
        Number of results after each completed search.
    """

    surface: CurveSurface
    smoothness: float
    n_points: int
    searches: int = 1
    relaxed: list[Relaxed] = field(default_factory=list)
    relaxed_after: list[int] = field(default_factory=list)

    @property
    def curves(self) -> list[NodedCurve]:
        """The relaxed curves."""
        return [each.noded_curve for each in self.relaxed]

    @property
    def best(self) -> int:
        """Index of the curve of least energy."""
        return self.by_energy()[0]

    def by_energy(self) -> list[int]:
        """Indices of the curves by ascending energy, without repetitions of the same curve."""
        return distinct_by_energy(self.surface, self.curves, self.smoothness)

    def end_search(self) -> None:
        """Record that a search has ended, with or without another relaxed curve."""
        self.relaxed_after.append(len(self.relaxed))

    def another_search_pays(self) -> bool:
        """Whether another search is affordable and may find a far better curve.

        A search is worthwhile if the best curve bends, unless the last ones have gained little.
        """
        energies = energies_of(self.surface, self.curves, self.smoothness)
        bending = scaled_bending(self.curves[int(np.argmin(energies))])
        lowest = np.minimum.accumulate(energies)[np.array(self.relaxed_after) - 1]
        gains = lowest[1:] < (1.0 - LEAST_GAIN) * lowest[:-1]
        fruitless = len(gains) >= FRUITLESS_SEARCHES and not gains[-FRUITLESS_SEARCHES:].any()
        promising = bending > EXTREMELY_BENT or (bending > STRONGLY_BENT and not fruitless)
        return promising and self._is_affordable(self._work / self.searches + RESERVED)

    def part_pays(self, fruitless: int) -> bool:
        """Whether another search for a part of the best curve is worthwhile and affordable.

        Parameters
        ----------
        fruitless : int
            Number of consecutive searches for parts so far that have gained little.
        """
        bent = scaled_bending(self.curves[self.best]) > PARTLY_BENT
        affordable = self._is_affordable(self._work_of_search)
        return bent and fruitless < FRUITLESS_SEARCHES and affordable

    def least_energies(self, count: int) -> tuple[float, float]:
        """The least energy of the first `count` results, and that of all results."""
        energies = energies_of(self.surface, self.curves, self.smoothness)
        return min(energies[:count]), min(energies)

    def tightening_pays(self) -> bool:
        """Whether the best curve has kinks, and relaxing its start again is affordable."""
        return self._is_kinked and self._is_affordable(self.relaxed[self.best].work)

    def network_pays(self) -> bool:
        """Whether the best curve has kinks, and an attempt by the network is affordable."""
        mean = self._work_of_relaxations / len(self.relaxed)
        return self._is_kinked and self._is_affordable(self._work_of_search + mean)

    def limited(self, config: RelaxationConfig) -> RelaxationConfig:
        """Settings with which another relaxation does at most the work that is left."""
        return replace(config, work=min(config.work, MOST_WORK - self._work))

    @property
    def _is_kinked(self) -> bool:
        return scaled_bending(self.curves[self.best]) > KINKED

    @property
    def _work(self) -> float:
        return self.searches * self._work_of_search + self._work_of_relaxations

    @property
    def _work_of_relaxations(self) -> float:
        return sum(each.work for each in self.relaxed)

    @property
    def _work_of_search(self) -> int:
        return WORK_OF_SEARCH * (1 + self.n_points)

    def _is_affordable(self, further: float) -> bool:
        return self._work + further <= MOST_WORK
