"""Improves the first curve of a request by further attempts, while their gain justifies the work.

The farther a curve winds around limbs, the more courses a search misses. So if the curve bends,
the search is repeated with other lengths and other tensions, until two searches have found the same
curve. Then the legs of the courses of all searches are combined, and the parts that bend most are
searched for again. If the best curve has kinks, the
initial path is tried before these searches, and more tension after them. At last come courses for
alternatives.
"""

from __future__ import annotations

import contextlib
import itertools
import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field, replace

from .courses.bent_part import BentPart, bent_parts
from .courses.comparison import (
    PARTS_APART,
    distinct_by_energy,
    farthest_between,
    is_apart,
)
from .courses.course_search import COMBINED, Search
from .courses.course_set import CourseSet
from .errors import NicmmError
from .geometry.array_types import FloatArray
from .relaxation.close_points import bends_like_points
from .relaxation.curve_energies import energies_of, relative_energies, scaled_bending
from .relaxation.curve_nodes import CurveSurface
from .relaxation.discrete_curve import DiscreteCurve
from .relaxation.relaxing import GUIDED, TIGHTENED, RelaxationConfig, Relaxed
from .relaxation.warm_start import WARM
from .request import Request
from .start_search import (
    InitialCurve,
    StartKind,
    StartSearch,
    has_many_points,
    is_new,
)

SLIGHTLY_BENT = 3.0
"""L ∮ κ_g² ds above which the search is repeated; a circle has 4π², about 40.

Curves above it may wind around limbs, where a search misses more courses.
"""

BENT = 15.0
"""L ∮ κ_g² ds above which courses of all searches are combined, and the parts that bend most are
searched for again."""

STRONGLY_BENT = 20.0
"""L ∮ κ_g² ds above which further courses of a search follow, half the value of a circle."""

WITH_NORMAL_BENDING = 14.0
"""Increase of these three bounds, relative to them, for each unit of `normal_bending`.

The fairest curve then bends more along the surface in order to bend less with it.
"""

WITH_AVOIDED_CURVES = 2.5
"""Factor of these three bounds if other curves are avoided; the fairest curve goes round them."""

LIKE_CIRCLE = 35.0
"""L ∮ κ_g² ds above which the search is repeated once in any case, somewhat less than for a circle.

With normal bending, a loop beside a limb may be found first, and a ring around it be fairer.
"""

KINKED = 200.0
"""L ∮ κ_g² ds above which a curve usually has kinks, so its start is relaxed in another way too."""

FURTHER_SEARCHES = 3
"""Greatest number of repeated searches for the whole curve."""

COURSES_OF_A_SEARCH = 6
"""Greatest number of courses relaxed after a search whose curves are strongly bent.

The order of their energies with few nodes is unreliable.
"""

COMBINED_COURSES = 6
"""Greatest number of courses relaxed that combine legs of all searches."""

SEARCHES_FOR_PARTS = 16
"""Greatest number of searches for parts of the best curve.

Each takes less than half the time of a search for the whole curve, and where curves bend far more
than a circle, it gains more.
"""

COURSES_OF_A_PART, RELAXED_OF_A_PART = 4, 2
"""Greatest numbers of courses looked at after each of them, and of those relaxed."""

PROMISING = 0.4
"""Energy above that of the best curve, relative to its elastic energy, up to which a start may
lead to a better curve."""

LEAST_GAIN = 0.02
"""Decrease of the energy, relative to the elastic energy, below which a search has gained nothing.
"""

MOST_WORK = 10_000
"""Work of all attempts together above which no further one is begun.

In moves of all nodes of a curve, of which 4,000 take about a second. The next constants are the
measured times of searches in this unit.
"""

WORK_OF_SEARCH, WORK_OF_POINT = 400, 100
"""Approximate work of a search, in the same unit, and what each control or via point adds."""

WORK_OF_PART = 400
"""Approximate work of a search for a part, in the same unit, or of combining the courses of all
searches."""

WORK_OF_TRANSFER = 40
"""Approximate work of transferring a course from the coarse mesh, in the same unit."""

MAX_COURSES_RELAXED = 10
"""Courses relaxed for alternatives, in addition to two for each alternative.

Many courses relax to the same curve.
"""

FURTHER_SEEDS = range(1, 1 + FURTHER_SEARCHES)
"""Seeds of repeated searches; the first search has the seed 0."""


def relaxation_config(request: Request) -> RelaxationConfig:
    """The settings with which a start of a request is relaxed."""
    return RelaxationConfig() if request.alignment is None else GUIDED


@dataclass
class Rival:
    """A curve through the same control points, which a design may or may not equal in the end.

    Attributes
    ----------
    curve : DiscreteCurve
    differs_from : callable
        Whether another curve, given by its points, (n, 3), counts as another one.
    is_beaten : bool
        Whether a fairer curve has ended the design.
    """

    curve: DiscreteCurve
    differs_from: Callable[[FloatArray], bool]
    is_beaten: bool = False


class RivalBeatenError(Exception):
    """The design cannot equal its rival, since there is a fairer curve."""


@dataclass
class Improvement:
    """The attempts at one curve, each of which relaxes one start.

    Attributes
    ----------
    search : StartSearch
    request : Request
    relax : callable
        Relaxes a start with some settings; raises `CancelledError` if the caller stops it.
    transferred_before : int
        Number of courses transferred from the coarse mesh for earlier requests.
    earlier : list of CourseSet
        The best courses of all searches so far.
    starts, relaxed : lists of InitialCurve and of Relaxed
        The start and the result of each attempt.
    searches, parts : int
        Numbers of searches begun so far: for courses of the whole curve, and for parts or for
        combinations of earlier courses.
    path_tried : bool
        Whether the initial path has been tried.
    rival : Rival, optional
        The attempts end with `RivalBeatenError` when a fairer curve is found.
    """

    search: StartSearch
    request: Request
    relax: Callable[[InitialCurve, RelaxationConfig], Relaxed]
    transferred_before: int
    earlier: list[CourseSet]
    starts: list[InitialCurve] = field(default_factory=list)
    relaxed: list[Relaxed] = field(default_factory=list)
    searches: int = 1
    parts: int = 0
    path_tried: bool = False
    rival: Rival | None = None
    _energies: list[float] = field(default_factory=list)

    def attempt(self, start: InitialCurve, config: RelaxationConfig) -> None:
        """Relax a start."""
        relaxed = self.relax(start, config)
        self.starts.append(start)
        self.relaxed.append(relaxed)
        self._check_rival()

    def _check_rival(self) -> None:
        """Raise `RivalBeatenError` if the best curve is fairer than the rival and another one."""
        if self.rival is None:
            return
        (theirs,), best = self._energies_of([self.rival.curve]), self.best
        is_beaten = self.energies[best] < theirs
        if is_beaten and self.rival.differs_from(self.relaxed[best].curve.points):
            self.rival.is_beaten = True
            raise RivalBeatenError

    def improve(self, courses: Iterator[InitialCurve], start_kind: StartKind) -> None:
        """Make all attempts that follow the first one.

        Parameters
        ----------
        courses : iterator of InitialCurve
            Other courses of the first search. Those that remain are for alternatives.
        start_kind : StartKind
            What the first start is. If control points are close together and the spline bends
            hardly more than they require, there are no searches. If no course was simple, further
            searches for the whole curve would hardly find one and take long, so they are made only
            for alternatives.
        """
        request, self.path_tried = self.request, start_kind is StartKind.PATH
        self._check_rival()
        further = [
            self.search.courses(request, Search(seed=seed, earlier=self.earlier))
            for seed in FURTHER_SEEDS
        ]
        if start_kind is not StartKind.CLOSE_POINTS or not bends_like_points(self.curves[0]):
            self._search_further(courses, further, start_kind)
        if self._should_tighten():
            self.attempt(self.starts[self.best], self._limited(TIGHTENED))
        self._try_path()
        if request.alternatives:
            others = itertools.chain(courses, *further[: max(self.searches - 1, 1)])
            new = (start for start in others if is_new(start, self.curves))
            for start in itertools.islice(new, MAX_COURSES_RELAXED + 2 * request.alternatives):
                self.attempt(start, relaxation_config(request))

    def _search_further(
        self,
        courses: Iterator[InitialCurve],
        further: list[Iterator[InitialCurve]],
        start_kind: StartKind,
    ) -> None:
        """Try the spline, courses of all searches and their combinations, and other parts."""
        by_course = start_kind is StartKind.COURSE
        if start_kind is StartKind.CLOSE_POINTS:
            self.searches = 0
            by_course = self._try_courses(courses)
        elif has_many_points(self.request) and start_kind is not StartKind.SPLINE:
            self._try_spline()
        found_twice = self._found_same_curve(1)
        if start_kind is StartKind.COURSE:
            self._try_other_courses(courses)
        self._try_path()
        for repeated in further if by_course else ():
            before = len(self.starts)
            if found_twice or not self._should_search_again() or not self._try_courses(repeated):
                break
            found_twice = self._found_same_curve(before)
        if len(self.earlier) > 1 and self._should_try_another_part():
            self._try_combined()
        self._try_other_parts()

    @property
    def _config(self) -> RelaxationConfig:
        """Settings with at most the work that is left."""
        return self._limited(relaxation_config(self.request))

    def _try_spline(self) -> None:
        """Try the spline through the control points, in the order of the first start."""
        start = self.search.by_spline(self.request, self.starts[0].visited)
        if start is not None:
            self.attempt(start, self._config)

    def _try_path(self) -> None:
        """Try the initial path, once, if the best curve has kinks.

        On steps and creases, it may be better than any course.
        """
        if self.path_tried or not self._should_try_path():
            return
        self.path_tried, start = True, None
        with contextlib.suppress(NicmmError):  # it is only another candidate
            start = self.search.by_path(self.request)
        if start is not None:
            self.attempt(start, self._config)

    def _try_courses(self, courses: Iterator[InitialCurve]) -> bool:
        """Try the best courses of a repeated search; returns whether there were any.

        On rough meshes hardly any course is simple, and each failure takes long.
        """
        self.searches += 1
        start = next(courses, None)
        if start is None:
            return False
        self.attempt(start, self._config)
        self._try_other_courses(courses)
        return True

    def _try_other_courses(self, courses: Iterator[InitialCurve]) -> None:
        """Try the next courses of a search as long as its best curve is strongly bent."""
        first = len(self.starts) - 1
        while (
            len(self.starts) - first < COURSES_OF_A_SEARCH
            and self._should_try_another_course(first)
        ):  # fmt: skip
            known = [
                start.curve
                for start in self.starts[first:]
                if isinstance(start.curve, DiscreteCurve)
            ]
            start = next((start for start in courses if is_new(start, known)), None)
            if start is None:
                break
            self.attempt(start, self._config)

    def _try_combined(self) -> None:
        """Try the best combinations of legs of the courses of all searches."""
        self.parts += 1
        courses = self.search.courses(self.request, Search(COMBINED, earlier=self.earlier))
        new = (start for start in courses if is_new(start, [self.curves[self.best]]))
        for start in itertools.islice(new, COMBINED_COURSES):
            self.attempt(start, self._config)

    def _try_other_parts(self) -> None:
        """Try the best curve with other courses in the parts that bend most."""
        changed, in_vain = self.best, list[FloatArray]()
        parts = self._bent_parts(self.curves[changed], in_vain)
        for _ in range(SEARCHES_FOR_PARTS):
            part = next(parts, None)
            if part is None or not self._should_try_another_part():
                break
            before, curve = len(self.starts), self.curves[changed]
            self.parts += 1
            courses = self.search.with_other_part(self.request, self.starts[changed], curve, part)
            starts = list(itertools.islice(courses, COURSES_OF_A_PART))
            promising = [start for start in starts if self._is_promising(start)]
            if not promising and has_many_points(self.request):
                promising = starts[:1]  # it may only be kinked where it meets the other parts
            for start in promising[:RELAXED_OF_A_PART]:
                self.attempt(start, self._limited(WARM))
            if self._gained_since(before):
                changed = self.best
                parts = self._bent_parts(self.curves[changed], in_vain)
            else:
                in_vain.append(part.positions(curve))

    def _bent_parts(self, curve: DiscreteCurve, in_vain: list[FloatArray]) -> Iterator[BentPart]:
        """The parts of a curve that bend most, except for those that were searched in vain.

        The latter are given by the positions of their nodes.
        """
        limit = PARTS_APART * self._surface.mesh.diagonal
        for part in bent_parts(curve):
            positions = part.positions(curve)
            if all(farthest_between(positions, each) > limit for each in in_vain):
                yield part

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
        new = self.curves[len(self._energies) :]
        self._energies += self._energies_of(new)
        return self._energies

    def _energies_of(self, curves: list[DiscreteCurve]) -> list[float]:
        scale = self.curves[0].length
        return energies_of(self._surface, curves, self.request.smoothness, scale)

    @property
    def best(self) -> int:
        """Index of the curve of least energy."""
        return self.energies.index(min(self.energies))

    def relative_energies(self) -> list[float]:
        """The same energies, relative to that of the best curve."""
        scale = self.curves[0].length
        return relative_energies(self._surface, self.curves, self.request.smoothness, scale)

    def by_energy(self) -> Iterator[int]:
        """Indices of the curves by ascending energy, without repetitions of the same curve."""
        return distinct_by_energy(self._surface, self.curves, self.energies)

    @property
    def _surface(self) -> CurveSurface:
        return self.starts[0].surface

    def _is_promising(self, start: InitialCurve) -> bool:
        """Whether a start, if relaxed, may become better than the best curve."""
        assert isinstance(start.curve, DiscreteCurve)
        (energy,) = self._energies_of([start.curve])
        least = self.energies[self.best]
        return energy - least <= PROMISING * self._elastic_energy(self.curves[self.best])

    def _gained_since(self, before: int) -> bool:
        """Whether the results from an index on are clearly better than those before."""
        energies = self.energies
        least, found = min(energies[:before]), min(energies[before:], default=math.inf)
        earlier = self.curves[energies.index(least)]
        return least - found > LEAST_GAIN * self._elastic_energy(earlier)

    def _found_same_curve(self, before: int) -> bool:
        """Whether the best result from an index on, if any, is the best one before it once more."""
        energies, curves = self.energies, self.curves
        if len(curves) == before:
            return False
        earlier = curves[energies.index(min(energies[:before]))]
        latest = curves[before + energies[before:].index(min(energies[before:]))]
        is_same = not is_apart(self._surface, latest, [earlier])
        return is_same and not self._gained_since(before)

    def _should_search_again(self) -> bool:
        """Whether another search may find a far better curve and is affordable."""
        promising = self._bending > min(self._bound(SLIGHTLY_BENT), LIKE_CIRCLE)
        return promising and self._is_affordable(self._work / self.searches + self._reserved)

    def _should_try_another_course(self, first: int) -> bool:
        """Whether the next course of a search is worthwhile, whose results begin at an index."""
        least = min(scaled_bending(each.discrete_curve) for each in self.relaxed[first:])
        return least > self._bound(STRONGLY_BENT) and self._is_affordable(
            self._mean_work + self._reserved
        )

    def _should_try_another_part(self) -> bool:
        """Whether other courses of parts of the best curve are worthwhile and affordable."""
        promising = self._bending > self._bound(BENT)
        return promising and self._is_affordable(WORK_OF_PART + self._reserved)

    def _should_tighten(self) -> bool:
        """Whether the best curve has kinks, and relaxing its start again is affordable."""
        return self._is_kinked and self._is_affordable(self.relaxed[self.best].work)

    def _should_try_path(self) -> bool:
        """Whether the best curve has kinks, and an attempt by the initial path is affordable."""
        return self._is_kinked and self._is_affordable(self._work_of_path)

    def _bound(self, bending: float) -> float:
        """A bound of the bending, with regard to other options that make the curve bend."""
        of_normal_bending = 1.0 + WITH_NORMAL_BENDING * self.request.normal_bending
        return bending * of_normal_bending * (WITH_AVOIDED_CURVES if self.request.avoid else 1.0)

    def _limited(self, config: RelaxationConfig) -> RelaxationConfig:
        """Settings with which another relaxation does at most the work that is left."""
        return replace(config, work=min(config.work, MOST_WORK - self._work))

    def _elastic_energy(self, curve: DiscreteCurve) -> float:
        """The energy without maps, since with lanes it may be negative."""
        unpainted = replace(self._surface, feature_map=None)
        scale = self.curves[0].length
        return float(energies_of(unpainted, [curve], self.request.smoothness, scale)[0])

    @property
    def _is_kinked(self) -> bool:
        return self._bending > KINKED

    @property
    def _bending(self) -> float:
        return scaled_bending(self.curves[self.best])

    @property
    def _work(self) -> float:
        of_searches = self.searches * self._work_of_search + self.parts * WORK_OF_PART
        transferred = self.search.transferred - self.transferred_before
        return of_searches + transferred * WORK_OF_TRANSFER + self._work_of_relaxations

    @property
    def _reserved(self) -> float:
        """Work that must be left for other attempts at kinks, if the best curve has any."""
        if not self._is_kinked:
            return 0.0
        return self.relaxed[self.best].work + (0.0 if self.path_tried else self._work_of_path)

    @property
    def _work_of_path(self) -> float:
        """Approximate work of an attempt by the initial path."""
        return self._work_of_search + self._mean_work

    @property
    def _mean_work(self) -> float:
        return self._work_of_relaxations / len(self.relaxed)

    @property
    def _work_of_relaxations(self) -> float:
        return sum(each.work for each in self.relaxed)

    @property
    def _work_of_search(self) -> int:
        via_points = sum(map(len, self.request.via_points.values()))
        return WORK_OF_SEARCH + WORK_OF_POINT * (len(self.request.points) + via_points)

    def _is_affordable(self, further: float) -> bool:
        return self._work + further <= MOST_WORK
