"""Curves on a sound mesh: from the last curve, a coarse mesh or the network, then relaxed.

The main path for one checked request; `design` is the front of it.
"""

from __future__ import annotations

import time
from dataclasses import dataclass, replace
from functools import cached_property, partial

import numpy as np

from .coarsening.coarse_start import CoarseStarts
from .design_result import STATUS, Design, Status
from .geometry.array_types import FloatArray, IntArray
from .geometry.curve import SurfaceCurve
from .geometry.mesh import Mesh
from .level_set import variational
from .level_set.losses import LossWeights, balanced, energy_surface, loss_terms
from .level_set.problem import Problem, requested_problem
from .level_set.solution import Solution
from .level_set.zero_set import ZeroSet, zero_set
from .maps.guidance import component_unit, feature_map
from .network.single_pass import predicted
from .network.weights_file import shipped_weights
from .path.initial_loop import path_curve
from .progress import CancelledError, checkpoint, part
from .relaxation.curve_field import curve_field
from .relaxation.curve_nodes import CurveSurface, curve_surface
from .relaxation.elastic_energy import FEATURE_TENSION
from .relaxation.noded_curve import NodedCurve, noded_curve
from .relaxation.relaxing import GUIDED, RelaxationConfig, relax
from .relaxation.warm_start import LONGEST_MOVE, LONGEST_MOVE_OF_A_FRAME, WARM, moved_along
from .request import Request, same_course, same_request

STARTED = 0.6
"""About how much of the time is over when relaxation begins."""

SOON_DONE = 10
"""The cap of a relaxation, in numbers of iterations that most need."""

CROWDED = 3
"""Frames for which strands that collided are assumed to collide still."""


@dataclass(frozen=True)
class _Start:
    """A simple curve on the mesh from which relaxation begins."""

    curve: SurfaceCurve | NodedCurve
    visited: IntArray  # (k,) which control points it passes, in order
    surface: CurveSurface
    unit: float  # square root of the surface's area
    breaking: int = 0


@dataclass(frozen=True)
class _Remembered:
    """The last relaxed curve."""

    request: Request
    start: _Start
    exact: NodedCurve  # the design's curve with its nodes
    design: Design | None  # None where the curve has not converged yet
    crowded: int = 0  # frames in which it is better drawn after every step


class SurfaceDesigner:
    """Designs on one mesh; what depends on the mesh alone is found once.

    Parameters
    ----------
    mesh : Mesh
        Every face has an area, and no edge has more than two.
    """

    def __init__(self, mesh: Mesh) -> None:
        self.mesh = mesh
        self._last: _Remembered | None = None

    def forget(self) -> None:
        """Start the next design anew."""
        self._last = None

    def design(self, request: Request, method: str, started: float) -> Design:
        """Design a curve.

        Parameters
        ----------
        request : Request
        method : {"nicmm", "nicmm-paper", "variational"}
        started : float
            When the design began, by `time.perf_counter`.

        Raises
        ------
        UnreachableError
            If no simple curve passes the points in this order.
        """
        if method == "nicmm":
            return self._designed(request, started)
        with part(0.0, 0.3):
            problem = requested_problem(self.mesh, request)
        watch = _FieldWatch(self.mesh, problem)
        try:
            with part(0.3, 0.9):
                solution = self._solution(problem, request, method, watch)
            zeros = zero_set(self.mesh, problem, solution.field, solution.keeps_topology)
        except CancelledError:
            if watch.shown is None:
                raise
            design = self._level_set_design(problem, watch.solution, watch.shown, started)
            return replace(design, iterations=watch.shown_after)
        return self._level_set_design(problem, solution, zeros, started)

    def follow(self, request: Request, iterations: int, started: float) -> Design | None:
        """Relax the last curve by few iterations; None where it cannot be moved there.

        Parameters
        ----------
        request : Request
        iterations : int
            At most so many.
        started : float
            When this began, by `time.perf_counter`.
        """
        last = self._last
        if last is not None and last.design is not None and same_request(request, last.request):
            return replace(last.design, seconds=time.perf_counter() - started)
        config = replace(WARM, iterations=iterations, drawn_iterations=1)
        if last is not None and last.crowded:
            # Without would fail once more.
            config = replace(config, defer_tracing=False)
        start = self._start_from_last(request, LONGEST_MOVE_OF_A_FRAME)
        return None if start is None else self._relaxed(request, start, config, started)

    def resume(self, request: Request, curve: SurfaceCurve) -> bool:
        """Go on from a curve as if it were the last one, or forget where it is not on this surface.

        Parameters
        ----------
        request : Request
            That the curve answers.
        curve : SurfaceCurve
            Through all its points, in their order.
        """
        self.forget()
        surface, unit = self._curve_surface(request), self._unit(request)
        start = _Start(curve, np.arange(len(request.points)), surface, unit)
        exact = noded_curve(surface, curve, WARM.levels[-1])
        self._last = _Remembered(request, start, exact, None)
        return True

    def _designed(self, request: Request, started: float) -> Design:
        """A relaxed curve that starts from the last one, a coarse mesh or the network."""
        last = self._last
        if last is not None and last.design is not None and same_request(request, last.request):
            return replace(last.design, seconds=time.perf_counter() - started)
        start = self._start_from_last(request)
        if start is not None:
            return self._relaxed(request, start, WARM, started)
        with part(0.0, STARTED):
            start = self._start_from_coarse(request)
            if start is None:
                found = predicted(self.mesh, request)
                problem, zeros = found.problem, found.zeros
                one = zeros.is_simple_curve(self.mesh, request.closed)
                start = _Start(
                    # A level set may touch itself where the mesh is too coarse; the path does not.
                    curve=zeros.curves[0]
                    if one
                    else path_curve(self.mesh, problem.working, problem.loop),
                    visited=problem.loop.order,
                    surface=self._curve_surface(request),
                    unit=problem.unit,
                    breaking=zeros.breaking_vertices,
                )
        with part(STARTED, 1.0):
            config = RelaxationConfig() if request.alignment is None else GUIDED
            return self._relaxed(request, start, config, started)

    def _start_from_last(self, request: Request, longest: float = LONGEST_MOVE) -> _Start | None:
        """The last curve with its control points moved; None where the request is too different."""
        last = self._last
        if last is None or not same_course(request, last.request):
            return None
        points = request.points[last.start.visited]
        curve = moved_along(last.start.surface, last.exact, points, longest)
        if curve is None:
            return None
        return replace(last.start, curve=curve, breaking=0)

    def _start_from_coarse(self, request: Request) -> _Start | None:
        """The curve of a coarse mesh; None where the mesh is small, or where none is found."""
        found = self._coarse_starts.find(request)
        if found is None:
            return None
        return _Start(
            curve=found.curve,
            visited=found.visited,
            surface=self._curve_surface(request),
            unit=self._unit(request),
            breaking=found.breaking_vertices,
        )

    def _relaxed(
        self,
        request: Request,
        start: _Start,
        config: RelaxationConfig,
        started: float,
    ) -> Design:
        """The design that relaxation makes of a curve; it is kept for the next request."""

        def watch(done: float, points: FloatArray) -> bool:
            checkpoint(1.0 - (1.0 - done) ** SOON_DONE, lambda: points)
            return True

        surface, unit = start.surface, start.unit
        relaxed = relax(surface, start.curve, request.smoothness, config, watch)
        feature = 0.0 if surface.feature_map is None else 0.5 * relaxed.feature / unit
        # φ is exactly the distance to the curve, so two terms of Eq. 2 vanish.
        energy = {"sdf": 0.0, "int": 0.0, "smooth": 0.5 * relaxed.bending * unit, "fea": feature}
        design = Design(
            status=STATUS[relaxed.stopped],
            curves=[relaxed.curve],
            iterations=relaxed.iterations,
            seconds=time.perf_counter() - started,
            energy=energy,
            breaking_vertices=start.breaking,
            find_field=partial(curve_field, self.mesh, relaxed.curve),
        )
        if design.status is not Status.CANCELLED:
            at_rest = design.status is not Status.ITERATION_LIMIT
            before = 0 if self._last is None else self._last.crowded
            failed = config.defer_tracing and relaxed.iterations > config.iterations
            crowded = CROWDED if failed else max(before - 1, 0)
            kept = design if at_rest else None
            self._last = _Remembered(request, start, relaxed.exact, kept, crowded)
        return design

    def _level_set_design(
        self, problem: Problem, solution: Solution, zeros: ZeroSet, started: float
    ) -> Design:
        """The design that a level set is."""
        one = zeros.is_simple_curve(self.mesh, problem.loop.closed)
        return Design(
            status=STATUS[solution.stopped] if one else Status.NOT_ONE_CURVE,
            curves=zeros.curves,
            iterations=solution.iterations,
            seconds=time.perf_counter() - started,
            energy=solution.terms,
            breaking_vertices=zeros.breaking_vertices,
            find_field=partial(_at_input_vertices, self.mesh, problem, zeros.field),
        )

    def _solution(
        self, problem: Problem, request: Request, method: str, watch: _FieldWatch
    ) -> Solution:
        """The level set that a method other than "nicmm" finds."""
        weights = balanced(LossWeights(smooth=request.smoothness * LossWeights.smooth), problem)
        if method == "variational":
            return variational.solve(problem, weights, variational.VariationalConfig(), watch)
        pretrained = shipped_weights(problem.features.shape[1])
        # These import PyTorch, which nothing else needs.
        from .network.prediction import PredictionConfig, predict
        from .network.trainable_network import build_network

        return predict(build_network(pretrained), problem, weights, PredictionConfig(), watch)

    def _curve_surface(self, request: Request) -> CurveSurface:
        """The surface that curves move on."""
        if not request.has_maps:
            return self._surface
        unit = self._unit(request)
        phi_fea = feature_map(self.mesh, request.obstacles, request.alignment, unit)
        weight = FEATURE_TENSION / unit**2
        return replace(self._surface, feature_map=phi_fea, feature_weight=weight)

    def _unit(self, request: Request) -> float:
        return component_unit(self.mesh, int(request.points.faces[0]))

    @cached_property
    def _surface(self) -> CurveSurface:
        return curve_surface(self.mesh)

    @cached_property
    def _coarse_starts(self) -> CoarseStarts:
        return CoarseStarts(self._surface)


class _FieldWatch:
    """Shows the zero set of a level set that is being solved for, and keeps the last one shown."""

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
        """The level set that was shown last, of a solver that has been cancelled."""
        assert self.shown is not None  # as the caller has asked
        field = self.shown.field
        terms = loss_terms(energy_surface(self._problem), field)
        terms = {name: float(value) for name, value in terms.items()}
        return Solution(field, terms, [], "cancelled")

    def _show(self, field: FloatArray, iteration: int) -> FloatArray:
        zeros = zero_set(self._mesh, self._problem, field)
        self.shown, self.shown_after = zeros, iteration
        return zeros.curves[0].points if zeros.curves else np.zeros((0, 3))


def _at_input_vertices(mesh: Mesh, problem: Problem, field: FloatArray) -> FloatArray:
    """φ in mesh units at the input vertices."""
    if problem.bundle is not None:
        field = np.abs(field)
    inputs = problem.working.input_vertex
    values = np.full(len(mesh.vertices), field.max() * problem.unit)
    values[inputs[inputs >= 0]] = field[inputs >= 0] * problem.unit
    return values
