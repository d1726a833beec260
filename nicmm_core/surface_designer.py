"""Designs a curve on a manifold: from an earlier curve, from a course, or from the initial path.

This is the pipeline of a checked request; `design` is its entry point. The manifold is the last
copy of the given mesh. A new curve is found on the Delaunay triangulation of that copy
(`coarsening.retriangulated`), and relaxed on the copy at last (`final_relaxation`).
"""

from __future__ import annotations

import contextlib
import itertools
import time
from dataclasses import replace
from functools import partial

import numpy as np

from .continued import ContinuedCurve, chosen, has_detour
from .courses.course_search import Search
from .courses.course_set import CourseSet
from .design_result import Design
from .errors import CurveError, UnreachableError
from .final_relaxation import relaxed_on_copy
from .geometry.array_types import FloatArray
from .geometry.curve import SurfaceCurve
from .geometry.curve_field import curve_field
from .geometry.mesh import Mesh
from .improvement import Improvement, Rival, RivalBeatenError, relaxation_config
from .mapped_surface import MappedSurface
from .new_legs import Leg, legs_of, may_need_search, widened
from .progress import CancelledError, checkpoint, subrange
from .relaxation.discrete_curve import DiscreteCurve
from .relaxation.relaxing import RelaxationConfig, Relaxed, relax
from .relaxation.warm_start import WARM, movable_near
from .request import Request
from .start import (
    WITHOUT_START,
    Resumable,
    curve_of_start,
    moved_start,
    unsettled_vertices,
)
from .start_search import InitialCurve, StartSearch, is_new
from .status import Status
from .symmetry.half_order import in_shortest_order
from .symmetry.half_search import NO_SYMMETRIC_CURVE, symmetric_by_halves
from .symmetry.symmetric_relaxation import (
    MOST_CANDIDATES,
    ComparedCurve,
    SymmetricCurve,
    best_symmetric,
    relaxed_symmetric,
    symmetric_from,
)

START_FRACTION = 0.6
"""Approximate fraction of the total time that passes before the relaxation."""

LIMIT_TO_USUAL_ITERATIONS = 10
"""Limit on the iterations of a relaxation, relative to the number that most curves need.

Since most curves converge long before the limit, reported progress rises quickly at first.
"""

TRIED = 2
"""Greatest number of courses of new legs that are relaxed for a start."""

COLLISIONS = 3
"""Number of designs after a collision for which strands are assumed to collide again."""


class SurfaceDesigner:
    """Designs curves on one manifold. What depends only on the mesh is computed once.

    Parameters
    ----------
    mesh : Mesh
        A mesh whose faces all have an area and whose edges have at most two faces.
    is_canonical : bool
        Whether it is a canonical copy (`geometry.numbering`).
    """

    def __init__(self, mesh: Mesh, is_canonical: bool = False) -> None:
        self.mesh = mesh
        self._search = StartSearch(mesh, is_canonical)

    @property
    def surface(self) -> MappedSurface:
        """The surface of the mesh."""
        return self._search.surface

    def design(
        self,
        request: Request,
        started: float,
        start: Resumable | SurfaceCurve | None = None,
        max_iterations: int | None = None,
        rival: Rival | None = None,
    ) -> Design:
        """Design a curve.

        Parameters
        ----------
        request : Request
        started : float
            Value of `time.perf_counter` when the design began.
        start : Resumable or SurfaceCurve, optional
            A curve on this mesh from which the method "elastic" starts.
        max_iterations : int, optional
            Limit on the total number of iterations of the relaxation.
        rival : Rival, optional
            The search ends with the first curve that is fairer than this one and not the same.

        Raises
        ------
        UnreachableError
            If no simple curve passes through the points in this order.
        CurveError
            If the start cannot be used.
        """
        if request.method == "elastic":
            if start is not None:
                return self._resumed(request, start, max_iterations, started)
            return self._designed(request, max_iterations, started, rival)
        from .paper.level_set_design import level_set_design  # only the other methods need it

        return level_set_design(self.mesh, request, started)

    def _resumed(
        self,
        request: Request,
        start: Resumable | SurfaceCurve,
        max_iterations: int | None,
        started: float,
    ) -> Design:
        """Move a start to the control points and relax it.

        If points have come or gone, courses of the new legs are tried as well.
        """
        surface = self._search.surface.of(request)
        curve, numbers = curve_of_start(surface, start, request)
        legs: list[Leg] = []
        if max_iterations is None and len(request.points) != len(curve.control_nodes):
            legs = legs_of(surface, curve, request)
            if not may_need_search(surface, curve, legs, request):
                legs = []
        found, problem = [], None
        try:
            moved, visited = moved_start(surface, curve, numbers, request)
            begin = InitialCurve(moved, visited, surface, self._search.surface.unit)
            if isinstance(start, Resumable):
                unsettled = unsettled_vertices(start, request, visited)
                begin = replace(begin, collisions=start.collisions, unsettled=unsettled)
            found.append(_continued(request, begin, max_iterations))
        except CurveError as error:
            if not legs:
                raise
            problem = error
        cancelled = False
        if legs and not (found and found[0].relaxed.status is Status.CANCELLED):
            cancelled = self._try_new_legs(request, curve, legs, found)
            if problem is not None and not found:
                raise problem
        best = chosen(request, curve, found) if legs else found[0]
        design = self._relaxed_design(request, best.start, best.relaxed, started)
        return replace(design, status=Status.CANCELLED) if cancelled else design

    def _try_new_legs(
        self,
        request: Request,
        curve: DiscreteCurve,
        legs: list[Leg],
        found: list[ContinuedCurve],
    ) -> bool:
        """Append curves with other courses of the new legs of a start.

        If all curves bend far more than the start, the neighbouring legs are searched for as well.
        Returns whether the caller has stopped it after a first curve.
        """
        try:
            self._try_legs(request, curve, legs, found, 1)
            if has_detour(curve, found):
                self._try_legs(request, curve, widened(legs, curve.closed), found, 2)
        except CancelledError:
            if not found:
                raise
            return True
        return False

    def _try_legs(
        self,
        request: Request,
        curve: DiscreteCurve,
        legs: list[Leg],
        found: list[ContinuedCurve],
        given_up: int,
    ) -> None:
        """Append curves with courses of some legs of a start."""
        tried: list[DiscreteCurve] = []
        for begin in self._search.with_new_legs(request, curve, legs):
            if not is_new(begin, tried):
                continue
            assert isinstance(begin.curve, DiscreteCurve)
            tried.append(begin.curve)
            with contextlib.suppress(CurveError):  # there may be no symmetric curve
                found.append(_continued(request, begin, None, given_up))
            if found and found[-1].relaxed.status is Status.CANCELLED:
                raise CancelledError
            if len(tried) == TRIED:
                break

    def _designed(
        self, request: Request, max_iterations: int | None, started: float, rival: Rival | None
    ) -> Design:
        """Relax the best course, or the initial path if no course is found."""
        if request.mirror is not None:
            return self._designed_symmetric(request, max_iterations, started)
        curves, cancelled = self._curves(request, max_iterations, rival)
        return self._with_alternatives(request, curves, cancelled, started)

    def _curves(
        self, request: Request, max_iterations: int | None, rival: Rival | None = None
    ) -> tuple[list[ComparedCurve], bool]:
        """The best distinct curves by energy, and whether the search was cancelled.

        They are found on the Delaunay triangulation of a canonical copy, and relaxed on the copy.
        If none of them is simple there, they are found on the copy itself.
        """
        if self._search.on_delaunay is not None:
            delaunay, search = self._search.on_delaunay
            there = delaunay.request_to(request)
            if there is not None:
                with contextlib.suppress(UnreachableError):  # the copy may have another path
                    found, cancelled = self._found_by(search, there, max_iterations, rival)
                    relax, most = partial(_relaxed, request), max_iterations
                    curves = relaxed_on_copy(self._search, request, found, relax, most, cancelled)
                    if curves:
                        return curves, any(r.status is Status.CANCELLED for _, r, _ in curves)
        return self._found_by(self._search, request, max_iterations, rival)

    def _found_by(
        self,
        search: StartSearch,
        request: Request,
        max_iterations: int | None,
        rival: Rival | None,
    ) -> tuple[list[ComparedCurve], bool]:
        """The best distinct curves on the mesh of a search."""
        before = search.transferred
        with subrange(0.0, START_FRACTION):
            found: list[CourseSet] = []
            courses = search.courses(request, Search(earlier=found), insist=True)
            start, kind = search.first(request, courses)
        with subrange(START_FRACTION, 1.0):
            first = _relaxed(request, start, relaxation_config(request), max_iterations)
            cancelled = first.status is Status.CANCELLED
            if max_iterations is not None or cancelled:
                return [(start, first, 1.0)], cancelled
            improvement = Improvement(
                search,
                request,
                partial(_relaxed_unless_cancelled, request),
                before,
                found,
                [start],
                [first],
                rival=rival,
            )
            try:
                with contextlib.suppress(RivalBeatenError):  # no better curve is needed
                    improvement.improve(courses, kind)
            except CancelledError:
                cancelled = True
        starts, relaxed = improvement.starts, improvement.relaxed
        energies = improvement.relative_energies()
        most = (1 if request.mirror is None else MOST_CANDIDATES) + request.alternatives
        by_energy = itertools.islice(improvement.by_energy(), most)
        return [(starts[i], relaxed[i], energies[i]) for i in by_energy], cancelled

    def _designed_symmetric(
        self, request: Request, max_iterations: int | None, started: float
    ) -> Design:
        """Make the best curves symmetric and relax them."""
        given, number = request, np.arange(len(request.points))
        if request.order == "shortest":
            given, number = in_shortest_order(self._search.surface.of(request), request)
        try:
            curves, cancelled = self._curves(given, max_iterations)
        except UnreachableError:
            curves, cancelled = [], False  # there may be a curve through the points of one side
        if cancelled:
            raise CancelledError  # before there was a symmetric curve
        begins = self._symmetric_curves(given, curves)
        if not begins:
            raise UnreachableError(NO_SYMMETRIC_CURVE)
        left = None
        if max_iterations is not None:
            left = max_iterations - sum(each.iterations for _, each, _ in curves)
        relax = partial(_relaxed_unless_cancelled, given)
        found, cancelled = best_symmetric(given, begins, relax, left)
        found = [
            (replace(start, visited=number[start.visited]), relaxed, energy)
            for start, relaxed, energy in found
        ]
        return self._with_alternatives(request, found, cancelled, started)

    def _with_alternatives(
        self, request: Request, curves: list[ComparedCurve], cancelled: bool, started: float
    ) -> Design:
        """The design of the first of some curves, with the next ones as alternatives."""
        best, *others = [
            replace(self._relaxed_design(request, start, relaxed, started), relative_energy=energy)
            for start, relaxed, energy in curves[: 1 + request.alternatives]
        ]
        status = Status.CANCELLED if cancelled else best.status
        return replace(best, status=status, alternatives=others)

    def _symmetric_curves(
        self, request: Request, curves: list[ComparedCurve]
    ) -> list[SymmetricCurve]:
        """Symmetric curves made of the best of some curves, or else of halves."""
        found = [
            symmetric
            for start, each, _ in curves[: MOST_CANDIDATES + request.alternatives]
            for symmetric in symmetric_from(request, start, each.discrete_curve)
        ]
        if found:
            return found
        surface, unit = self._search.surface.of(request), self._search.surface.unit
        return [
            SymmetricCurve(curve, InitialCurve(nodes, visited, surface, unit))
            for nodes, curve, visited in symmetric_by_halves(surface, request)
        ]

    def _relaxed_design(
        self, request: Request, start: InitialCurve, relaxed: Relaxed, started: float
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
            breaking_vertices=0,
            find_field=partial(curve_field, self.mesh, relaxed.curve),
            resumable=Resumable(
                self.mesh,
                request,
                relaxed.discrete_curve,
                start.visited,
                collisions,
                np.zeros(0, np.int64) if converged else start.unsettled,
            ),
        )


def _continued(
    request: Request, begin: InitialCurve, max_iterations: int | None, given_up: int = 0
) -> ContinuedCurve:
    """Relax a start that has been fitted to the control points.

    Raises
    ------
    CurveError
        If a symmetric curve is requested and the start cannot be made symmetric.
    """
    # If strands collide, an attempt without tracing every iteration would fail.
    config = replace(WARM, defer_tracing=not begin.collisions)
    if request.mirror is None:
        relaxed = _relaxed(request, begin, config, max_iterations)
        return ContinuedCurve(begin, relaxed, given_up)
    if max_iterations is not None:
        config = replace(config, most_iterations=max_iterations)
    assert isinstance(begin.curve, DiscreteCurve)
    relax = partial(_relaxed_unless_cancelled, request)
    found = relaxed_symmetric(request, begin, None, begin.curve.length, relax, config)
    if found is None:
        raise CurveError(f"start cannot be made symmetric about the mirror{WITHOUT_START}")
    return ContinuedCurve(*found, given_up)


def _relaxed(
    request: Request,
    start: InitialCurve,
    config: RelaxationConfig,
    max_iterations: int | None = None,
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
    return relax(
        start.surface,
        start.curve,
        request.smoothness,
        config,
        watch,
        movable,
        request.are_corners(start.visited),
    )


def _relaxed_unless_cancelled(
    request: Request, start: InitialCurve, config: RelaxationConfig
) -> Relaxed:
    """Relax a start; raises CancelledError if that is cancelled."""
    relaxed = _relaxed(request, start, config)
    if relaxed.status is Status.CANCELLED:
        raise CancelledError
    return relaxed
