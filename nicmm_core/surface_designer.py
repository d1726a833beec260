"""Designs a curve on a manifold: from an earlier curve, from a course, or from the network.

This is the pipeline of a checked request; `design` is its entry point.
"""

from __future__ import annotations

import contextlib
import itertools
import time
from collections.abc import Generator, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, partial

import numpy as np

from .coarsening.coarse_start import CoarseStarts
from .courses.attempts import (
    COURSES_OF_A_PART,
    COURSES_OF_A_SEARCH,
    FURTHER_SEARCHES,
    MOST_FAILURES,
    SEARCHES_FOR_PARTS,
    Attempts,
)
from .courses.bent_part import BentPart, bent_part, request_for_part, with_part
from .courses.comparison import is_apart
from .courses.course_surface import CourseSurface
from .design_result import Design
from .errors import NicmmError
from .geometry.array_types import FloatArray, IntArray
from .geometry.curve import SurfaceCurve
from .geometry.mesh import Mesh
from .level_set import variational
from .level_set.curve_field import curve_field
from .level_set.losses import LossWeights, balanced, energy_surface, loss_terms
from .level_set.problem import Problem, requested_problem
from .level_set.solution import Solution
from .level_set.zero_set import ZeroSet, zero_set
from .maps.guidance import component_unit
from .network.single_pass import infer
from .network.weights_file import shipped_weights
from .path.initial_loop import path_curve
from .progress import CancelledError, checkpoint, subrange
from .relaxation.curve_nodes import CurveSurface, curve_surface, with_maps
from .relaxation.noded_curve import NodedCurve
from .relaxation.relaxing import GUIDED, TIGHTENED, RelaxationConfig, Relaxed, relax
from .relaxation.simple_curve import simple_curve
from .relaxation.warm_start import WARM, movable_near
from .request import Request, same_maps
from .start import Resumable, moved_start, unsettled_vertices
from .status import Status

START_FRACTION = 0.6
"""Approximate fraction of the total time that passes before the relaxation."""

LIMIT_TO_USUAL_ITERATIONS = 10
"""Limit on the iterations of a relaxation, relative to the number that most curves need.

Since most curves converge long before the limit, reported progress rises quickly at first.
"""

MAX_COURSES_RELAXED = 10
"""Courses relaxed for alternatives, in addition to two for each alternative.

Many courses relax to the same curve.
"""

FURTHER_SEEDS = range(1, 1 + FURTHER_SEARCHES)
"""Seeds of repeated searches; the first search has the seed 0."""

COLLISIONS = 3
"""Number of designs after a collision for which strands are assumed to collide again."""


@dataclass(frozen=True)
class _Start:
    """A simple curve on the mesh from which relaxation begins."""

    curve: SurfaceCurve | NodedCurve
    visited: IntArray  # (k,) indices of control points in the order visited
    surface: CurveSurface
    unit: float  # square root of the surface's area
    breaking: int = 0
    collisions: int = 0
    unsettled: IntArray | None = None  # vertices near which it may move; None if everywhere


class SurfaceDesigner:
    """Designs curves on one manifold. What depends only on the mesh is computed once.

    Parameters
    ----------
    mesh : Mesh
        A mesh whose faces all have an area and whose edges have at most two faces.
    """

    def __init__(self, mesh: Mesh) -> None:
        self.mesh = mesh
        self._units: dict[int, float] = {}  # by component
        self._mapped: tuple[Request, CurveSurface] | None = None  # of the last request with maps

    def design(
        self,
        request: Request,
        started: float,
        start: Resumable | SurfaceCurve | None = None,
        max_iterations: int | None = None,
    ) -> Design:
        """Design a curve.

        Parameters
        ----------
        request : Request
        started : float
            Value of `time.perf_counter` when the design began.
        start : Resumable or SurfaceCurve, optional
            A curve on this mesh from which the method "nicmm" starts.
        max_iterations : int, optional
            Limit on the total number of iterations of the relaxation.

        Raises
        ------
        UnreachableError
            If no simple curve passes through the points in this order.
        CurveError
            If the start cannot be used.
        """
        if request.method == "nicmm":
            if start is not None:
                return self._resumed(request, start, max_iterations, started)
            return self._designed(request, max_iterations, started)
        with subrange(0.0, 0.3):
            problem = requested_problem(self.mesh, request)
        watch = _FieldWatch(self.mesh, problem)
        try:
            with subrange(0.3, 0.9):
                solution = self._solution(problem, request, watch)
            zeros = zero_set(self.mesh, problem, solution.field, solution.keeps_topology)
        except CancelledError:
            if watch.shown is None:
                raise
            design = self._level_set_design(problem, watch.solution, watch.shown, started)
            return replace(design, iterations=watch.shown_after)
        return self._level_set_design(problem, solution, zeros, started)

    def _resumed(
        self,
        request: Request,
        start: Resumable | SurfaceCurve,
        max_iterations: int | None,
        started: float,
    ) -> Design:
        """Move a start to the control points and relax it."""
        surface = self._curve_surface(request)
        curve, visited = moved_start(surface, start, request)
        collisions, unsettled = 0, None
        if isinstance(start, Resumable):
            collisions, unsettled = start.collisions, unsettled_vertices(start, request, visited)
        # If strands collide, an attempt without tracing every iteration would fail.
        config = replace(WARM, defer_tracing=not collisions)
        begin = _Start(
            curve,
            visited,
            surface,
            self._unit(request),
            collisions=collisions,
            unsettled=unsettled,
        )
        relaxed = _relaxed(request, begin, config, max_iterations)
        return self._relaxed_design(request, begin, relaxed, started)

    def _designed(self, request: Request, max_iterations: int | None, started: float) -> Design:
        """Relax the best course, or the curve of the network if no course is found."""
        with subrange(0.0, START_FRACTION):
            courses = self._course_starts(request)
            start = next(courses, None)
            by_course = start is not None
            if start is None:
                start = self._start_by_network(request)
        with subrange(START_FRACTION, 1.0):
            first = _relaxed(request, start, _config(request), max_iterations)
            if max_iterations is not None or first.status is Status.CANCELLED:
                return self._relaxed_design(request, start, first, started)
            n_points = len(request.points) + sum(map(len, request.via_points.values()))
            attempts = Attempts(start.surface, request.smoothness, n_points)
            attempts.relaxed.append(first)
            starts, cancelled = [start], False
            try:
                further = self._further_starts(request, starts, attempts, courses, by_course)
                for other, config in further:
                    relaxed = _relaxed(request, other, config)
                    if relaxed.status is Status.CANCELLED:
                        raise CancelledError
                    starts.append(other)
                    attempts.relaxed.append(relaxed)
            except CancelledError:
                cancelled = True
        best, *others = [
            self._relaxed_design(request, starts[each], attempts.relaxed[each], started)
            for each in attempts.by_energy()[: 1 + request.alternatives]
        ]
        status = Status.CANCELLED if cancelled else best.status
        return replace(best, status=status, alternatives=others)

    def _further_starts(
        self,
        request: Request,
        starts: list[_Start],
        attempts: Attempts,
        courses: Iterator[_Start],
        by_course: bool,
    ) -> Iterator[tuple[_Start, RelaxationConfig]]:
        """What to relax next, as long as it pays.

        The caller adds each start and its relaxed curve to `starts` and `attempts` before it asks
        for the next one. The `courses` of the first search that then remain are for alternatives.
        If no course was simple (`by_course` is False), further searches would hardly find one and
        take long, so they are made only for alternatives.
        """
        config = _config(request)
        further = [self._course_starts(request, seed, MOST_FAILURES) for seed in FURTHER_SEEDS]
        if by_course:
            yield from self._other_finalists(request, starts, attempts, courses)
            attempts.end_search()
            yield from self._starts_of_further_searches(request, starts, attempts, further)
        if attempts.tightening_pays():
            yield starts[attempts.best], attempts.limited(TIGHTENED)
        if by_course and attempts.network_pays():
            # On steps and creases, the network's path may be better than any course. It is only
            # another candidate, so its errors do not matter.
            with contextlib.suppress(NicmmError):
                yield self._start_by_network(request), attempts.limited(config)
        if request.alternatives:
            others = itertools.chain(courses, *further[: max(attempts.searches - 1, 1)])
            new = (start for start in others if _is_apart(start, attempts.curves))
            most = MAX_COURSES_RELAXED + 2 * request.alternatives
            yield from ((start, config) for start in itertools.islice(new, most))

    def _starts_of_further_searches(
        self,
        request: Request,
        starts: list[_Start],
        attempts: Attempts,
        further: Sequence[Iterator[_Start]],
    ) -> Iterator[tuple[_Start, RelaxationConfig]]:
        """The courses of one repeated search, other parts, and more searches as long as it pays."""
        found = True
        for search in further[:1]:
            if attempts.another_search_pays():
                found = yield from self._searched(request, starts, attempts, search)
        yield from self._starts_with_other_parts(request, starts, attempts)
        for search in further[1:]:
            if not (found and attempts.another_search_pays()):
                break
            found = yield from self._searched(request, starts, attempts, search)
            if attempts.fruitless == 0:
                yield from self._starts_with_other_parts(request, starts, attempts)

    def _searched(
        self,
        request: Request,
        starts: list[_Start],
        attempts: Attempts,
        search: Iterator[_Start],
    ) -> Generator[tuple[_Start, RelaxationConfig], None, bool]:
        """The best courses of a repeated search; returns whether another search may find any.

        On rough meshes hardly any course is simple, and each failure takes long.
        """
        attempts.searches += 1
        start = next(search, None)
        if start is None:
            return False
        yield start, attempts.limited(_config(request))
        yield from self._other_finalists(request, starts, attempts, search)
        attempts.end_search()
        return True

    def _other_finalists(
        self,
        request: Request,
        starts: list[_Start],
        attempts: Attempts,
        search: Iterator[_Start],
    ) -> Iterator[tuple[_Start, RelaxationConfig]]:
        """The next courses of a search as long as its best curve is extremely bent."""
        before = len(starts) - 1
        while len(starts) - before < COURSES_OF_A_SEARCH and attempts.another_course_pays(before):
            known = [
                start.curve for start in starts[before:] if isinstance(start.curve, NodedCurve)
            ]
            start = next((start for start in search if _is_apart(start, known)), None)
            if start is None:
                break
            yield start, attempts.limited(_config(request))

    def _starts_with_other_parts(
        self, request: Request, starts: list[_Start], attempts: Attempts
    ) -> Iterator[tuple[_Start, RelaxationConfig]]:
        """The best curve with other courses in the parts that bend most, as long as it pays."""
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
            courses = self._courses_of_part(request, starts[best], curve, part)
            for start in itertools.islice(courses, COURSES_OF_A_PART):
                yield start, attempts.limited(WARM)
            attempts.end_search()
            if attempts.fruitless == 0:
                tried = []  # the best curve is another one now

    def _courses_of_part(
        self, request: Request, start: _Start, curve: NodedCurve, part: BentPart
    ) -> Iterator[_Start]:
        """A curve with other courses of one part that are apart from each other, the best first."""
        found: list[NodedCurve] = []
        part_request = request_for_part(request, curve, part)
        for course in self._course_starts(part_request, most_failures=MOST_FAILURES):
            if not _is_apart(course, found):
                continue
            assert isinstance(course.curve, NodedCurve)
            changed = with_part(start.surface, curve, part, course.curve)
            if changed is not None:
                found.append(course.curve)
                yield replace(start, curve=changed)

    def _course_starts(
        self, request: Request, seed: int = 0, most_failures: int | None = None
    ) -> Iterator[_Start]:
        """Courses that are simple on the mesh, the best first; seeds above 0 use random lengths.

        The search ends after `most_failures` courses in a row that are not simple.
        """
        failures = 0
        for start in self._joined_courses(request, seed):
            failures = failures + 1 if start is None else 0
            if start is not None:
                yield start
            elif failures == most_failures:
                break

    def _joined_courses(self, request: Request, seed: int) -> Iterator[_Start | None]:
        """Courses joined on the mesh; None for each course that is not simple there."""
        there, unit = self._curve_surface(request), self._unit(request)
        if self._coarse_starts.is_large(request):
            for found in self._coarse_starts.courses(request, seed):
                yield None if found is None else _Start(found.curve, found.visited, there, unit)
            return
        for course in self._courses.courses(request, seed):
            checkpoint()
            curve = simple_curve(
                self._surface,
                course.places,
                course.control_nodes,
                request.points[course.visited],
                request.closed,
            )
            yield None if curve is None else _Start(curve, course.visited, there, unit)

    def _start_by_network(self, request: Request) -> _Start:
        """The zero set of the network's level set, or the path if the zero set is not simple."""
        coarse = self._coarse_starts.by_network(request)
        if coarse is not None:
            return _Start(
                curve=coarse.curve,
                visited=coarse.visited,
                surface=self._curve_surface(request),
                unit=self._unit(request),
                breaking=coarse.breaking_vertices,
            )
        found = infer(self.mesh, request)
        problem, zeros = found.problem, found.zeros
        # A zero set may touch itself where the mesh is too coarse; the path does not.
        one = zeros.is_simple_curve(self.mesh, request.closed)
        curve = zeros.curves[0] if one else path_curve(self.mesh, problem.working, problem.loop)
        return _Start(
            curve=curve,
            visited=problem.loop.order,
            surface=self._curve_surface(request),
            unit=problem.unit,
            breaking=zeros.breaking_vertices,
        )

    def _relaxed_design(
        self, request: Request, start: _Start, relaxed: Relaxed, started: float
    ) -> Design:
        """The design whose curve has been relaxed from a start."""
        unit = start.unit
        feature = 0.0 if start.surface.feature_map is None else 0.5 * relaxed.feature / unit
        # φ is exactly the distance to the curve, so two terms of Eq. 2 vanish.
        energy = {"sdf": 0.0, "int": 0.0, "smooth": 0.5 * relaxed.bending * unit, "fea": feature}
        converged = relaxed.status is Status.CONVERGED
        collisions = COLLISIONS if relaxed.collided else max(start.collisions - 1, 0)
        return Design(
            status=relaxed.status,
            curves=[relaxed.curve],
            iterations=relaxed.iterations,
            seconds=time.perf_counter() - started,
            energy=energy,
            breaking_vertices=start.breaking,
            find_field=partial(curve_field, self.mesh, relaxed.curve),
            resumable=Resumable(
                self.mesh,
                request,
                relaxed.noded_curve,
                start.visited,
                collisions,
                np.zeros(0, np.int64) if converged else start.unsettled,
            ),
        )

    def _level_set_design(
        self, problem: Problem, solution: Solution, zeros: ZeroSet, started: float
    ) -> Design:
        """The design whose curve is the zero set of a level set, without relaxation."""
        one = zeros.is_simple_curve(self.mesh, problem.loop.closed)
        return Design(
            status=solution.status if one else Status.NOT_ONE_CURVE,
            curves=zeros.curves,
            iterations=solution.iterations,
            seconds=time.perf_counter() - started,
            energy=solution.terms,
            breaking_vertices=zeros.breaking_vertices,
            find_field=partial(_at_input_vertices, self.mesh, problem, zeros.field),
        )

    def _solution(self, problem: Problem, request: Request, watch: _FieldWatch) -> Solution:
        """Solve for the level set by a method other than "nicmm"."""
        weights = balanced(LossWeights(smooth=request.smoothness * LossWeights.smooth), problem)
        if request.method == "variational":
            return variational.solve(problem, weights, variational.VariationalConfig(), watch)
        pretrained = shipped_weights(problem.features.shape[1])
        # These modules import PyTorch, which only this method needs.
        from .network.finetuning import FinetuningConfig, finetune
        from .network.trainable_network import build_network

        return finetune(build_network(pretrained), problem, weights, FinetuningConfig(), watch)

    def _curve_surface(self, request: Request) -> CurveSurface:
        """The surface for relaxation, with the maps of a request."""
        if not request.has_maps:
            return self._surface
        last = self._mapped
        if last is None or not self._same_maps(last[0], request):
            obstacles, alignment = request.obstacles, request.alignment
            mapped = with_maps(self._surface, obstacles, alignment, self._unit(request))
            last = self._mapped = request, mapped
        return last[1]

    def _same_maps(self, one: Request, other: Request) -> bool:
        """Whether two requests have the same maps on the same component."""
        return self._component(one) == self._component(other) and same_maps(one, other)

    def _unit(self, request: Request) -> float:
        """Square root of the area of the component of a request."""
        component = self._component(request)
        if component not in self._units:
            self._units[component] = component_unit(self.mesh, component)
        return self._units[component]

    def _component(self, request: Request) -> int:
        return int(self.mesh.face_component[request.points.faces[0]])

    @cached_property
    def _surface(self) -> CurveSurface:
        return curve_surface(self.mesh)

    @cached_property
    def _courses(self) -> CourseSurface:
        return CourseSurface(self.mesh)

    @cached_property
    def _coarse_starts(self) -> CoarseStarts:
        return CoarseStarts(self._surface)


def _config(request: Request) -> RelaxationConfig:
    return RelaxationConfig() if request.alignment is None else GUIDED


def _relaxed(
    request: Request, start: _Start, config: RelaxationConfig, max_iterations: int | None = None
) -> Relaxed:
    """Relax a start."""
    if max_iterations is not None:
        config = replace(config, most_iterations=max_iterations)

    def watch(done: float, points: FloatArray) -> bool:
        checkpoint(1.0 - (1.0 - done) ** LIMIT_TO_USUAL_ITERATIONS, lambda: points)
        return True

    movable = None
    if start.unsettled is not None:
        movable = movable_near(start.surface.mesh, start.unsettled, start.unit)
    return relax(start.surface, start.curve, request.smoothness, config, watch, movable)


def _is_apart(start: _Start, curves: list[NodedCurve]) -> bool:
    """Whether a course is somewhere apart from each of some curves."""
    assert isinstance(start.curve, NodedCurve)
    return is_apart(start.surface, start.curve, curves)


class _FieldWatch:
    """Reports the zero set while a level set is computed, and keeps the last one reported."""

    def __init__(self, mesh: Mesh, problem: Problem) -> None:
        self._mesh, self._problem = mesh, problem
        self._iterations = 0
        self.shown: ZeroSet | None = None
        self.shown_after = 0

    def __call__(self, done: float, field: FloatArray) -> bool:
        self._iterations += 1
        checkpoint(done, partial(self._show, field, self._iterations))
        return True

    @property
    def solution(self) -> Solution:
        """The level set reported last, as the solution of a cancelled solver."""
        assert self.shown is not None  # checked by the caller
        field = self.shown.field
        terms = loss_terms(energy_surface(self._problem), field)
        terms = {name: float(value) for name, value in terms.items()}
        return Solution(field, terms, [], Status.CANCELLED)

    def _show(self, field: FloatArray, iteration: int) -> FloatArray:
        zeros = zero_set(self._mesh, self._problem, field)
        self.shown, self.shown_after = zeros, iteration
        return zeros.curves[0].points if zeros.curves else np.zeros((0, 3))


def _at_input_vertices(mesh: Mesh, problem: Problem, field: FloatArray) -> FloatArray:
    """φ at the input vertices, in mesh units; vertices without φ get the largest value."""
    if problem.bundle is not None:
        # A section of a sign bundle has no sign at a vertex: the sign depends on the face.
        field = np.abs(field)
    inputs = problem.working.input_vertex
    values = np.full(len(mesh.vertices), field.max() * problem.unit)
    values[inputs[inputs >= 0]] = field[inputs >= 0] * problem.unit
    return values
