"""Decides what to relax after the first start of a curve, as long as it pays.

In turn: other courses of the first search, the courses of a repeated search, the best curve with
other parts, the courses of more searches, and for kinks the same start with more tension and the
curve of the network. At last come courses for alternatives. `courses.attempts` tells what pays.
"""

from __future__ import annotations

import contextlib
import itertools
from collections.abc import Generator, Iterator
from dataclasses import dataclass, field

from .courses.attempts import (
    COURSES_OF_A_PART,
    COURSES_OF_A_SEARCH,
    FURTHER_SEARCHES,
    MOST_FAILURES,
    SEARCHES_FOR_PARTS,
    Attempts,
)
from .courses.bent_part import bent_part
from .errors import NicmmError
from .geometry.array_types import FloatArray
from .relaxation.noded_curve import NodedCurve
from .relaxation.relaxing import GUIDED, TIGHTENED, RelaxationConfig, Relaxed
from .relaxation.warm_start import WARM
from .request import Request
from .start_search import Start, StartSearch, is_new

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
class FurtherStarts:
    """The starts of one curve that have been relaxed so far, and what to relax next.

    Attributes
    ----------
    search : StartSearch
    request : Request
    attempts : Attempts
        The result of each start.
    starts : list of Start
    """

    search: StartSearch
    request: Request
    attempts: Attempts
    starts: list[Start] = field(default_factory=list)

    def add(self, start: Start, relaxed: Relaxed) -> None:
        """Record a start and its relaxed curve."""
        self.starts.append(start)
        self.attempts.relaxed.append(relaxed)

    def in_turn(
        self, courses: Iterator[Start], by_course: bool
    ) -> Iterator[tuple[Start, RelaxationConfig]]:
        """What to relax next; the caller adds each start before it asks for the next one.

        Parameters
        ----------
        courses : iterator of Start
            Other courses of the first search. Those that remain are for alternatives.
        by_course : bool
            Whether the first start is a course. If no course was simple, further searches would
            hardly find one and take long, so they are made only for alternatives.
        """
        request, attempts = self.request, self.attempts
        further = [self.search.courses(request, seed, MOST_FAILURES) for seed in FURTHER_SEEDS]
        if by_course:
            yield from self._other_courses(courses)
            attempts.end_search()
            yield from self._of_further_searches(further)
        if attempts.tightening_pays():
            yield self.starts[attempts.best], attempts.limited(TIGHTENED)
        if by_course and attempts.network_pays():
            # On steps and creases, the network's path may be better than any course. It is only
            # another candidate, so its errors do not matter.
            with contextlib.suppress(NicmmError):
                yield self.search.by_network(request), self._config
        if request.alternatives:
            others = itertools.chain(courses, *further[: max(attempts.searches - 1, 1)])
            new = (start for start in others if is_new(start, attempts.curves))
            most = MAX_COURSES_RELAXED + 2 * request.alternatives
            config = relaxation_config(request)
            yield from ((start, config) for start in itertools.islice(new, most))

    @property
    def _config(self) -> RelaxationConfig:
        """Settings with at most the work that is left."""
        return self.attempts.limited(relaxation_config(self.request))

    def _of_further_searches(
        self, further: list[Iterator[Start]]
    ) -> Iterator[tuple[Start, RelaxationConfig]]:
        """The courses of one repeated search, other parts, and the courses of more searches."""
        found = True
        for courses in further[:1]:
            if self.attempts.another_search_pays():
                found = yield from self._of_search(courses)
        yield from self._with_other_parts()
        for courses in further[1:]:
            if not (found and self.attempts.another_search_pays()):
                break
            found = yield from self._of_search(courses)
            if self.attempts.fruitless == 0:
                yield from self._with_other_parts()

    def _of_search(
        self, courses: Iterator[Start]
    ) -> Generator[tuple[Start, RelaxationConfig], None, bool]:
        """The best courses of a repeated search; returns whether there were any.

        On rough meshes hardly any course is simple, and each failure takes long.
        """
        self.attempts.searches += 1
        start = next(courses, None)
        if start is None:
            return False
        yield start, self._config
        yield from self._other_courses(courses)
        self.attempts.end_search()
        return True

    def _other_courses(self, courses: Iterator[Start]) -> Iterator[tuple[Start, RelaxationConfig]]:
        """The next courses of a search as long as its best curve is extremely bent."""
        first = len(self.starts) - 1
        while (
            len(self.starts) - first < COURSES_OF_A_SEARCH
            and self.attempts.another_course_pays(first)
        ):  # fmt: skip
            known = [
                start.curve for start in self.starts[first:] if isinstance(start.curve, NodedCurve)
            ]
            start = next((start for start in courses if is_new(start, known)), None)
            if start is None:
                break
            yield start, self._config

    def _with_other_parts(self) -> Iterator[tuple[Start, RelaxationConfig]]:
        """The best curve with other courses in the parts that bend most."""
        attempts = self.attempts
        tried: list[FloatArray] = []
        attempts.fruitless = 0  # whether parts pay does not follow from the searches before
        for _ in range(SEARCHES_FOR_PARTS):
            if not attempts.part_pays():
                break
            best = attempts.best
            curve = attempts.curves[best]
            part = bent_part(curve, tried)
            if part is None:
                break
            tried.append(part.middle)
            attempts.parts += 1
            courses = self.search.with_other_part(self.request, self.starts[best], curve, part)
            for start in itertools.islice(courses, COURSES_OF_A_PART):
                yield start, attempts.limited(WARM)
            attempts.end_search(of_part=True)
            if attempts.fruitless == 0:
                tried = []  # the best curve is another one now
