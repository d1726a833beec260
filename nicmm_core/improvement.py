"""Improves the first curve of a request by further attempts, while their gain justifies the work.

In turn: other courses of the first search, the courses of repeated searches, the best curve with
other parts, and for kinks the same start with more tension and the initial path. At last come
courses for alternatives. `courses.attempts` decides whether each of them is made.
"""

from __future__ import annotations

import contextlib
import itertools
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field

from .courses.attempts import (
    COURSES_OF_A_PART,
    COURSES_OF_A_SEARCH,
    FURTHER_SEARCHES,
    MOST_FAILURES,
    RELAXED_OF_A_PART,
    SEARCHES_FOR_PARTS,
    Attempts,
)
from .courses.bent_part import bent_parts
from .errors import NicmmError
from .relaxation.discrete_curve import DiscreteCurve
from .relaxation.relaxing import GUIDED, TIGHTENED, RelaxationConfig, Relaxed
from .relaxation.warm_start import WARM
from .request import Request
from .start_search import InitialCurve, StartSearch, is_new

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
class Improvement:
    """The attempts at one curve, each of which relaxes one start.

    Attributes
    ----------
    search : StartSearch
    request : Request
    relax : callable
        Relaxes a start with some settings; raises `CancelledError` if the caller stops it.
    attempts : Attempts
        The results, and whether another attempt is worth its work.
    starts : list of InitialCurve
        The start of each attempt.
    """

    search: StartSearch
    request: Request
    relax: Callable[[InitialCurve, RelaxationConfig], Relaxed]
    attempts: Attempts
    starts: list[InitialCurve] = field(default_factory=list)

    def attempt(self, start: InitialCurve, config: RelaxationConfig) -> None:
        """Relax a start."""
        relaxed = self.relax(start, config)
        self.starts.append(start)
        self.attempts.relaxed.append(relaxed)

    def improve(self, courses: Iterator[InitialCurve], by_course: bool) -> None:
        """Make all attempts that follow the first one.

        Parameters
        ----------
        courses : iterator of InitialCurve
            Other courses of the first search. Those that remain are for alternatives.
        by_course : bool
            Whether the first start is a course. If no course was simple, further searches would
            hardly find one and take long, so they are made only for alternatives.
        """
        request, attempts = self.request, self.attempts
        further = [self.search.courses(request, seed, MOST_FAILURES) for seed in FURTHER_SEEDS]
        if by_course:
            self._try_other_courses(courses)
            for repeated in further:
                if not (attempts.should_search_again() and self._try_courses(repeated)):
                    break
            self._try_other_parts()
        if attempts.should_tighten():
            self.attempt(self.starts[attempts.best], attempts.limited(TIGHTENED))
        if by_course and attempts.should_try_path():
            # On steps and creases, the initial path may be better than any course. It is only
            # another candidate, so its errors do not matter.
            start = None
            with contextlib.suppress(NicmmError):
                start = self.search.by_path(request)
            if start is not None:
                self.attempt(start, self._config)
        if request.alternatives:
            others = itertools.chain(courses, *further[: max(attempts.searches - 1, 1)])
            new = (start for start in others if is_new(start, attempts.curves))
            for start in itertools.islice(new, MAX_COURSES_RELAXED + 2 * request.alternatives):
                self.attempt(start, relaxation_config(request))

    @property
    def _config(self) -> RelaxationConfig:
        """Settings with at most the work that is left."""
        return self.attempts.limited(relaxation_config(self.request))

    def _try_courses(self, courses: Iterator[InitialCurve]) -> bool:
        """Try the best courses of a repeated search; returns whether there were any.

        On rough meshes hardly any course is simple, and each failure takes long.
        """
        before = len(self.starts)
        self.attempts.searches += 1
        start = next(courses, None)
        if start is None:
            return False
        self.attempt(start, self._config)
        self._try_other_courses(courses)
        self.attempts.end_repeated_search(before)
        return True

    def _try_other_courses(self, courses: Iterator[InitialCurve]) -> None:
        """Try the next courses of a search as long as its best curve is strongly bent."""
        first = len(self.starts) - 1
        while (
            len(self.starts) - first < COURSES_OF_A_SEARCH
            and self.attempts.should_try_another_course(first)
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

    def _try_other_parts(self) -> None:
        """Try the best curve with other courses in the parts that bend most."""
        attempts, changed = self.attempts, self.attempts.best
        parts = bent_parts(attempts.curves[changed])
        for _ in range(SEARCHES_FOR_PARTS):
            part = next(parts, None)
            if part is None or not attempts.should_try_another_part():
                break
            before, curve = len(self.starts), attempts.curves[changed]
            attempts.parts += 1
            courses = self.search.with_other_part(self.request, self.starts[changed], curve, part)
            promising = (
                start
                for start in itertools.islice(courses, COURSES_OF_A_PART)
                if isinstance(start.curve, DiscreteCurve) and attempts.is_promising(start.curve)
            )
            for start in itertools.islice(promising, RELAXED_OF_A_PART):
                self.attempt(start, attempts.limited(WARM))
            if attempts.gained_since(before):
                changed = attempts.best
                parts = bent_parts(attempts.curves[changed])
