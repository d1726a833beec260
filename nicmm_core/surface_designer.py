"""Designs a curve on a manifold: from an earlier curve, from a course, or from the initial path.

This is the pipeline of a checked request; `design` is its entry point.
"""

from __future__ import annotations

import time
from dataclasses import replace
from functools import partial

import numpy as np

from .design_result import Design
from .geometry.array_types import FloatArray
from .geometry.curve import SurfaceCurve
from .geometry.curve_field import curve_field
from .geometry.mesh import Mesh
from .improvement import Improvement, relaxation_config
from .progress import CancelledError, checkpoint, subrange
from .relaxation.relaxing import RelaxationConfig, Relaxed, relax
from .relaxation.warm_start import WARM, movable_near
from .request import Request
from .start import Resumable, moved_start, unsettled_vertices
from .start_search import InitialCurve, StartSearch
from .status import Status

START_FRACTION = 0.6
"""Approximate fraction of the total time that passes before the relaxation."""

LIMIT_TO_USUAL_ITERATIONS = 10
"""Limit on the iterations of a relaxation, relative to the number that most curves need.

Since most curves converge long before the limit, reported progress rises quickly at first.
"""

COLLISIONS = 3
"""Number of designs after a collision for which strands are assumed to collide again."""


class SurfaceDesigner:
    """Designs curves on one manifold. What depends only on the mesh is computed once.

    Parameters
    ----------
    mesh : Mesh
        A mesh whose faces all have an area and whose edges have at most two faces.
    """

    def __init__(self, mesh: Mesh) -> None:
        self.mesh = mesh
        self._search = StartSearch(mesh)

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
            A curve on this mesh from which the method "elastic" starts.
        max_iterations : int, optional
            Limit on the total number of iterations of the relaxation.

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
            return self._designed(request, max_iterations, started)
        from .paper.level_set_design import level_set_design  # only the other methods need it

        return level_set_design(self.mesh, request, started)

    def _resumed(
        self,
        request: Request,
        start: Resumable | SurfaceCurve,
        max_iterations: int | None,
        started: float,
    ) -> Design:
        """Move a start to the control points and relax it."""
        surface = self._search.surface.of(request)
        curve, visited = moved_start(surface, start, request)
        collisions, unsettled = 0, None
        if isinstance(start, Resumable):
            collisions, unsettled = start.collisions, unsettled_vertices(start, request, visited)
        # If strands collide, an attempt without tracing every iteration would fail.
        config = replace(WARM, defer_tracing=not collisions)
        begin = InitialCurve(
            curve,
            visited,
            surface,
            self._search.surface.unit,
            collisions=collisions,
            unsettled=unsettled,
        )
        relaxed = _relaxed(request, begin, config, max_iterations)
        return self._relaxed_design(request, begin, relaxed, started)

    def _designed(self, request: Request, max_iterations: int | None, started: float) -> Design:
        """Relax the best course, or the initial path if no course is found."""
        search, before = self._search, self._search.transferred
        with subrange(0.0, START_FRACTION):
            courses = search.courses(request)
            start = next(courses, None)
            by_course = start is not None
            if start is None:
                start = search.by_path(request)
        with subrange(START_FRACTION, 1.0):
            first = _relaxed(request, start, relaxation_config(request), max_iterations)
            if max_iterations is not None or first.status is Status.CANCELLED:
                return self._relaxed_design(request, start, first, started)
            improvement = Improvement(
                search,
                request,
                partial(_relaxed_unless_cancelled, request),
                before,
                [start],
                [first],
            )
            cancelled = False
            try:
                improvement.improve(courses, by_course)
            except CancelledError:
                cancelled = True
        energies = improvement.relative_energies()
        best, *others = [
            replace(
                self._relaxed_design(
                    request, improvement.starts[i], improvement.relaxed[i], started
                ),
                relative_energy=energies[i],
            )
            for i in improvement.by_energy()[: 1 + request.alternatives]
        ]
        status = Status.CANCELLED if cancelled else best.status
        return replace(best, status=status, alternatives=others)

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
    return relax(start.surface, start.curve, request.smoothness, config, watch, movable)


def _relaxed_unless_cancelled(
    request: Request, start: InitialCurve, config: RelaxationConfig
) -> Relaxed:
    """Relax a start; raises CancelledError if that is cancelled."""
    relaxed = _relaxed(request, start, config)
    if relaxed.status is Status.CANCELLED:
        raise CancelledError
    return relaxed
