"""Decides whether to make another attempt at a curve, from the curves relaxed so far.

The farther a curve winds around limbs, the more courses a search misses. A search with other
lengths and another tension finds others, so it is made if the curve bends, and more of them follow
if even the best curve bends strongly. Then the parts that bend most are searched for again.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field, replace

from ..relaxation.curve_energies import energies_of, scaled_bending
from ..relaxation.curve_nodes import CurveSurface
from ..relaxation.discrete_curve import DiscreteCurve
from ..relaxation.relaxing import RelaxationConfig, Relaxed
from .comparison import distinct_by_energy, is_apart

SLIGHTLY_BENT = 10.0
"""L ∮ κ_g² ds above which the search is repeated, a quarter of the value of a circle.

Curves above it may wind around limbs, where a search misses more courses.
"""

BENT = 15.0
"""L ∮ κ_g² ds above which the parts that bend most are searched for again."""

STRONGLY_BENT = 30.0
"""L ∮ κ_g² ds above which further courses and searches follow; a circle has 4π², about 40."""

KINKED = 200.0
"""L ∮ κ_g² ds above which a curve usually has kinks, so its start is relaxed in another way too."""

FURTHER_SEARCHES = 3
"""Greatest number of repeated searches for the whole curve; strongly bent curves get all."""

COURSES_OF_A_SEARCH = 3
"""Greatest number of courses relaxed after a search whose curves are strongly bent.

The order of their energies with few nodes is unreliable.
"""

SEARCHES_FOR_PARTS = 8
"""Greatest number of searches for parts of the best curve."""

COURSES_OF_A_PART, RELAXED_OF_A_PART = 4, 2
"""Greatest numbers of courses looked at after each of them, and of those relaxed."""

PROMISING = 0.4
"""Energy above that of the best curve, relative to its elastic energy, up to which a start may
lead to a better curve."""

LEAST_GAIN = 0.02
"""Decrease of the energy, relative to the elastic energy, below which a search has gained nothing.
"""

MOST_FAILURES = 4
"""Number of courses in a row that are not simple on the mesh after which a repeated search ends.

On rough meshes each of them takes long.
"""

MOST_WORK = 2_200
"""Work of all attempts together above which no further one is begun.

In moves of all nodes. It takes about one second, and two to three on rough meshes.
"""

RESERVED = 600
"""Part of that work that must be left after a further search, for other attempts at kinks."""

WORK_OF_SEARCH = 40
"""Approximate work of a search, in the same unit; as much again for each control or via point."""

WORK_OF_PART = 100
"""Approximate work of a search for a part, in the same unit."""

WORK_OF_TRANSFER = 40
"""Approximate work of transferring a course from the coarse mesh, in the same unit."""


@dataclass
class Attempts:
    """The attempts at one curve so far, and whether another one is worth its time.

    Attributes
    ----------
    surface : CurveSurface
    smoothness : float
    n_points : int
        Number of control points and via points.
    transferred : callable
        Returns the number of courses so far that have been transferred from a coarse mesh.
    searches, parts : int
        Numbers of searches for courses begun so far, of the whole curve and of parts.
    relaxed : list of Relaxed
        The result of each attempt.
    repeat_found_same_curve : bool
        Whether the last repeated search has found the best curve of before once more.
    """

    surface: CurveSurface
    smoothness: float
    n_points: int
    transferred: Callable[[], int]
    searches: int = 1
    parts: int = 0
    relaxed: list[Relaxed] = field(default_factory=list)
    repeat_found_same_curve: bool = False

    @property
    def curves(self) -> list[DiscreteCurve]:
        """The relaxed curves."""
        return [each.discrete_curve for each in self.relaxed]

    @property
    def energies(self) -> list[float]:
        """Energies of the curves.

        The length of the first curve is the scale of all of them. So the order of two curves does
        not depend on later ones, and a further attempt never leads to a worse result.
        """
        scale = self.curves[0].length
        return energies_of(self.surface, self.curves, self.smoothness, scale)

    @property
    def best(self) -> int:
        """Index of the curve of least energy."""
        return self.energies.index(min(self.energies))

    def by_energy(self) -> list[int]:
        """Indices of the curves by ascending energy, without repetitions of the same curve."""
        return distinct_by_energy(self.surface, self.curves, self.energies)

    def is_promising(self, start: DiscreteCurve) -> bool:
        """Whether a start, if relaxed, may become better than the best curve."""
        best = self.curves[self.best]
        scale = self.curves[0].length
        least, energy = energies_of(self.surface, [best, start], self.smoothness, scale)
        return energy - least <= PROMISING * self._elastic_energy(best)

    def gained_since(self, before: int) -> bool:
        """Whether the results from an index on are clearly better than those before."""
        energies = self.energies
        least, found = min(energies[:before]), min(energies[before:], default=math.inf)
        earlier = self.curves[energies.index(least)]
        return least - found > LEAST_GAIN * self._elastic_energy(earlier)

    def end_repeated_search(self, before: int) -> None:
        """Record that the courses of a repeated search have been relaxed, from an index on."""
        energies, curves = self.energies, self.curves
        earlier = curves[energies.index(min(energies[:before]))]
        latest = curves[before + energies[before:].index(min(energies[before:]))]
        is_same = not is_apart(self.surface, latest, [earlier])
        self.repeat_found_same_curve = is_same and not self.gained_since(before)

    def should_search_again(self) -> bool:
        """Whether another search is affordable and may find a far better curve.

        The first repeated search is worthwhile if the best curve bends; those after it, only if it
        is still strongly bent and two searches have not found the same curve.
        """
        least = SLIGHTLY_BENT if self.searches == 1 else STRONGLY_BENT
        promising = self._bending > least and not self.repeat_found_same_curve
        return promising and self._is_affordable(self._work / self.searches + RESERVED)

    def should_try_another_course(self, first: int) -> bool:
        """Whether the next course of a search is worthwhile, whose results begin at an index."""
        least = min(scaled_bending(each.discrete_curve) for each in self.relaxed[first:])
        mean = self._work_of_relaxations / len(self.relaxed)
        return least > STRONGLY_BENT and self._is_affordable(mean + RESERVED)

    def should_try_another_part(self) -> bool:
        """Whether another search for a part of the best curve is worthwhile and affordable."""
        return self._bending > BENT and self._is_affordable(WORK_OF_PART)

    def should_tighten(self) -> bool:
        """Whether the best curve has kinks, and relaxing its start again is affordable."""
        return self._is_kinked and self._is_affordable(self.relaxed[self.best].work)

    def should_try_path(self) -> bool:
        """Whether the best curve has kinks, and an attempt by the initial path is affordable."""
        mean = self._work_of_relaxations / len(self.relaxed)
        return self._is_kinked and self._is_affordable(self._work_of_search + mean)

    def limited(self, config: RelaxationConfig) -> RelaxationConfig:
        """Settings with which another relaxation does at most the work that is left."""
        return replace(config, work=min(config.work, MOST_WORK - self._work))

    def _elastic_energy(self, curve: DiscreteCurve) -> float:
        """The energy without maps, since with lanes it may be negative."""
        unpainted = replace(self.surface, feature_map=None)
        scale = self.curves[0].length
        return float(energies_of(unpainted, [curve], self.smoothness, scale)[0])

    @property
    def _is_kinked(self) -> bool:
        return self._bending > KINKED

    @property
    def _bending(self) -> float:
        return scaled_bending(self.curves[self.best])

    @property
    def _work(self) -> float:
        of_searches = self.searches * self._work_of_search + self.parts * WORK_OF_PART
        of_transfers = self.transferred() * WORK_OF_TRANSFER
        return of_searches + of_transfers + self._work_of_relaxations

    @property
    def _work_of_relaxations(self) -> float:
        return sum(each.work for each in self.relaxed)

    @property
    def _work_of_search(self) -> int:
        return WORK_OF_SEARCH * (1 + self.n_points)

    def _is_affordable(self, further: float) -> bool:
        return self._work + further <= MOST_WORK
