"""The main path: from a mesh and control points to a curve. Read this file first.

control points → initial loop → signed distance → features (`problem`) → network, pretrained
→ prediction → one loop through the points → contour → relaxation of the curve.

On a large mesh all of that is done on a coarse mesh of the same surface, and the curve is lifted
from there and relaxed once more (`coarsening`).
"""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property, partial
from typing import TypeVar

import numpy as np
from numpy.typing import ArrayLike

from .arguments import check_choices, check_closed, check_torch, checked_map, checked_smoothness
from .array_types import FloatArray, IntArray
from .coarsening.coarse_start import CoarseStarts, Solve
from .crossings import crossing_segments
from .curve import SurfaceCurve
from .design_result import STATUS, Design, Status, is_one_curve
from .errors import ArgumentError, UnreachableError
from .level_set import variational
from .level_set.contour import extract_curves
from .level_set.features import feature_map
from .level_set.losses import LossWeights, balanced
from .level_set.problem import Problem, build_problem
from .level_set.solution import Solution
from .level_set.topology import keep_topology
from .mesh import Mesh
from .network.forward_pass import NetworkWeights
from .network.single_pass import predict_once
from .network.weights_file import load_weights
from .path.via_points import ViaPoints, located_via_points
from .relaxation.curve_field import curve_field
from .relaxation.curve_nodes import CurveSurface, unsigned_normals
from .relaxation.elastic_energy import FEATURE_TENSION
from .relaxation.relaxing import RelaxationConfig, relax
from .relaxation.warm_start import WARM, moved_along
from .request import Progress, Request, same_course, same_request
from .sound_copy import SoundCopy, sound_copies
from .surface_points import SurfacePoints, locate_control_points

PARTS = (
    "control_points, or via points, lie on parts of the mesh that meet in single vertices or edges "
    "only, across which no curve is led; join the parts, or choose points on one of them"
)

PROGRESS_INTERVAL = 0.25
"""Least seconds between two calls of a caller's progress function."""

LARGE = 24_000
"""Faces of a component from which on a curve is found on a coarse mesh first."""

State = TypeVar("State")


@dataclass(frozen=True)
class _Start:
    """A simple curve on the mesh from which relaxation begins."""

    curve: SurfaceCurve
    visited: IntArray  # (k,) which control points it passes, in order
    surface: CurveSurface
    unit: float  # square root of the surface's area
    breaking: int = 0
    iterations: int = 0  # until there
    cancelled: bool = False


@dataclass(frozen=True)
class _Remembered:
    """The last relaxed curve."""

    request: Request
    start: _Start
    design: Design


class Designer:
    """A surface that will be asked for many curves.

    What depends on the mesh alone is found once. ``method="nicmm"`` also starts from the curve
    before, if the request differs from the last one only in small moves of control points or in
    smoothness: then the cost follows the curve and not the mesh, which is what
    dragging a point needs. Such a curve keeps the course and the order of points that it has, so
    it may differ from what `design_curve` finds from nothing; `forget` makes the next design
    start anew. A Designer serves one thread at a time.

    Parameters
    ----------
    mesh : Mesh
    """

    def __init__(self, mesh: Mesh) -> None:
        if not isinstance(mesh, Mesh):
            raise ArgumentError(
                f"mesh is a {type(mesh).__name__}; pass nicmm_core.Mesh(vertices, faces)"
            )
        self.mesh = mesh
        self._weights: dict[int, NetworkWeights] = {}
        self._last: _Remembered | None = None
        self._coarse_starts: CoarseStarts | None = None
        self._copies = sound_copies(mesh)
        self._on_copies: list[tuple[SoundCopy, Designer]] = []

    def forget(self) -> None:
        """Start the next design anew."""
        self._last = None
        for copy, designer in self._on_copies:
            if copy.differs:
                designer.forget()

    def design(
        self,
        control_points: ArrayLike | SurfacePoints,
        *,
        closed: bool = True,
        order: str = "given",
        via_points: ViaPoints | None = None,
        method: str = "nicmm",
        obstacles: ArrayLike | None = None,
        alignment: ArrayLike | None = None,
        smoothness: float = 1.0,
        progress: Progress | None = None,
    ) -> Design:
        """Design a curve; arguments, result and errors are those of `design_curve`."""
        started = time.perf_counter()
        check_choices(order, method)
        check_closed(closed)
        if progress is not None and not callable(progress):
            raise ArgumentError(f"progress is {progress!r}; pass a function or None")
        if method == "nicmm-paper":
            check_torch()
        points = locate_control_points(self.mesh, control_points, closed)
        via = {} if via_points is None else via_points
        request = Request(
            points=points,
            closed=closed,
            order=order,
            via_points=located_via_points(self.mesh, points, via, order, closed),
            obstacles=checked_map("obstacles", obstacles, self.mesh),
            alignment=checked_map("alignment", alignment, self.mesh),
            smoothness=checked_smoothness(smoothness),
        )
        copy, designer, request = self._on_sound_copy(request)
        design = designer._answered(request, method, progress, started)
        return copy.design(design) if copy.differs else design

    def _on_sound_copy(self, request: Request) -> tuple[SoundCopy, Designer, Request]:
        """A copy of the mesh without its defects, who designs on it, and the request there."""
        place = 0
        while True:
            if place == len(self._on_copies):
                copy = next(self._copies, None)
                if copy is None:
                    raise UnreachableError(PARTS)
                self._on_copies.append((copy, Designer(copy.mesh) if copy.differs else self))
            copy, designer = self._on_copies[place]
            there = copy.request(request) if copy.differs else request
            if there is not None:
                return copy, designer, there
            place += 1

    def _answered(
        self, request: Request, method: str, progress: Progress | None, started: float
    ) -> Design:
        """A design on this mesh as it is."""
        if method == "nicmm":
            return self._designed(request, progress, started)
        problem = self._problem(request)
        solution = self._solution(problem, request, method, progress)
        return self._from_level_set(problem, solution, started)

    def _designed(self, request: Request, progress: Progress | None, started: float) -> Design:
        """A relaxed curve that starts from the last one, a coarse mesh or the network."""
        last = self._last
        if last is not None and same_request(request, last.request):
            return replace(last.design, seconds=time.perf_counter() - started)
        start = self._start_from_last(request)
        if start is not None:
            return self._relaxed(request, start, WARM, progress, started)
        start = self._start_from_coarse(request, progress)
        if start is not None:
            config = RelaxationConfig()
            later = None if progress is None else _part(progress, 0.5, 1.0)
            return self._relaxed(request, start, config, later, started)
        problem = self._problem(request)
        weights = self._pretrained(problem.features.shape[1])
        solution = predict_once(weights, problem)
        field, breaking, curves = self._curves(problem, solution.field)
        if not self._is_one(curves, request.closed):
            return self._from_level_set(problem, solution, started)
        surface = self._curve_surface(request)
        start = _Start(curves[0], problem.loop.order, surface, problem.unit, breaking)
        return self._relaxed(request, start, RelaxationConfig(), progress, started)

    def _start_from_last(self, request: Request) -> _Start | None:
        """The last curve with its control points moved; None where the request is too different."""
        last = self._last
        if last is None or not same_course(request, last.request):
            return None
        points = request.points[last.start.visited]
        curve = moved_along(last.start.surface, last.design.curves[0], points)
        if curve is None:
            return None
        return replace(last.start, curve=curve, breaking=0, iterations=0)

    def _start_from_coarse(self, request: Request, progress: Progress | None) -> _Start | None:
        """The curve of a coarse mesh; None where the mesh is small, or where none is found."""
        component = self.mesh.face_component == self.mesh.face_component[request.points.faces[0]]
        if np.count_nonzero(component) < LARGE:
            return None
        if self._coarse_starts is None:
            self._coarse_starts = CoarseStarts(self.mesh, self._normals, _coarse_solver)
        before = None if progress is None else _part(progress, 0.0, 0.5)
        found = self._coarse_starts.find(request, before)
        if found is None:
            return None
        return _Start(
            curve=found.curve,
            visited=found.visited,
            surface=self._curve_surface(request),
            unit=float(np.sqrt(self.mesh.face_areas[component].sum())),
            breaking=found.design.breaking_vertices,
            iterations=found.design.iterations,
            cancelled=found.design.status is Status.CANCELLED,
        )

    def _problem(self, request: Request) -> Problem:
        return build_problem(
            self.mesh,
            request.points,
            request.order,
            request.obstacles,
            request.alignment,
            request.smoothness,
            request.closed,
            request.via_points or None,
        )

    def _relaxed(
        self,
        request: Request,
        start: _Start,
        config: RelaxationConfig,
        progress: Progress | None,
        started: float,
    ) -> Design:
        """The design that relaxation makes of a curve; it is kept for the next request."""
        watch: Callable[[float, FloatArray], bool] | None = None
        if start.cancelled:
            watch = _stop
        elif progress is not None:
            watch = _seldom(progress, lambda points: points)
        surface, unit = start.surface, start.unit
        relaxed = relax(surface, start.curve, request.smoothness, config, watch)
        feature = 0.0 if surface.feature_map is None else 0.5 * relaxed.feature / unit
        # φ is exactly the distance to the curve, so two terms of Eq. 2 vanish.
        energy = {"sdf": 0.0, "int": 0.0, "smooth": 0.5 * relaxed.bending * unit, "fea": feature}
        design = Design(
            status=Status.CANCELLED if start.cancelled else STATUS[relaxed.stopped],
            curves=[relaxed.curve],
            iterations=start.iterations + relaxed.iterations,
            seconds=time.perf_counter() - started,
            energy=energy,
            breaking_vertices=start.breaking,
            find_field=partial(curve_field, self.mesh, relaxed.curve),
        )
        if design.status is not Status.CANCELLED:
            self._last = _Remembered(request, start, design)
        return design

    def _from_level_set(self, problem: Problem, solution: Solution, started: float) -> Design:
        """The design that a level set is."""
        field, breaking, curves = self._curves(problem, solution.field, solution.keeps_topology)
        one = self._is_one(curves, problem.loop.closed)
        return Design(
            status=STATUS[solution.stopped] if one else Status.NOT_ONE_CURVE,
            curves=curves,
            iterations=solution.iterations,
            seconds=time.perf_counter() - started,
            energy=solution.terms,
            breaking_vertices=breaking,
            find_field=partial(_at_input_vertices, self.mesh, problem, field),
        )

    def _solution(
        self, problem: Problem, request: Request, method: str, progress: Progress | None
    ) -> Solution:
        """The level set that a method other than "nicmm" finds."""
        watch = None if progress is None else self._field_watcher(problem, progress)
        weights = balanced(LossWeights(smooth=request.smoothness * LossWeights.smooth), problem)
        if method == "variational":
            return variational.solve(problem, weights, variational.VariationalConfig(), watch)
        pretrained = self._pretrained(problem.features.shape[1])
        # These import PyTorch, which nothing else needs.
        from .network.prediction import PredictionConfig, predict
        from .network.trainable_network import build_network

        return predict(build_network(pretrained), problem, weights, PredictionConfig(), watch)

    def _is_one(self, curves: list[SurfaceCurve], closed: bool) -> bool:
        """Whether curves are a single one through all control points that is simple."""
        if not is_one_curve(curves, closed):
            return False
        polyline = SurfacePoints(curves[0].faces, curves[0].barycentric)
        return not len(crossing_segments(self.mesh, polyline, closed))

    def _curve_surface(self, request: Request) -> CurveSurface:
        """The surface that curves move on."""
        if not request.has_maps:
            return CurveSurface(self.mesh, self._normals)
        component = self.mesh.face_component == self.mesh.face_component[request.points.faces[0]]
        area = float(self.mesh.face_areas[component].sum())
        maps = request.obstacles, request.alignment
        importance = feature_map(self.mesh.vertices, *maps, self.mesh.mean_edge_length)
        return CurveSurface(self.mesh, self._normals, importance, FEATURE_TENSION / area)

    @cached_property
    def _normals(self) -> FloatArray:
        return unsigned_normals(self.mesh)

    def _pretrained(self, channels: int) -> NetworkWeights:
        if channels not in self._weights:
            self._weights[channels] = load_weights(channels=channels)
        return self._weights[channels]

    def _curves(
        self, problem: Problem, field: FloatArray, keeps_topology: bool = False
    ) -> tuple[FloatArray, int, list[SurfaceCurve]]:
        """Make φ exactly zero at the control points and one loop, and take its contour."""
        breaking = 0
        if not keeps_topology:
            field, breaking = keep_topology(
                problem.working,
                problem.loop,
                problem.initial_distance,
                problem.smoother.interpolating(field),
                problem.bundle,
            )
        controls = problem.loop.control_vertices
        curves = extract_curves(self.mesh, problem.working, field, controls, problem.bundle)
        return field, breaking, curves

    def _field_watcher(
        self, problem: Problem, progress: Progress
    ) -> Callable[[float, FloatArray], bool]:
        def points(field: FloatArray) -> FloatArray:
            curves = self._curves(problem, field)[2]
            return curves[0].points if curves else np.zeros((0, 3))

        return _seldom(progress, points)


def _seldom(
    progress: Progress, points: Callable[[State], FloatArray]
) -> Callable[[float, State], bool]:
    """Call a progress function with the points of a state, but not too often."""
    last_call = -np.inf

    def watch(fraction: float, state: State) -> bool:
        nonlocal last_call
        if time.perf_counter() - last_call < PROGRESS_INTERVAL:
            return True
        last_call = time.perf_counter()
        # A copy, with which the caller may do as it likes.
        return progress(fraction, points(state).copy()) is not False

    return watch


def _part(progress: Progress, begin: float, end: float) -> Progress:
    """A progress function for a part of the whole."""
    return lambda fraction, points: progress(begin + (end - begin) * fraction, points)


def _stop(fraction: float, points: FloatArray) -> bool:
    return False


def _coarse_solver(mesh: Mesh) -> Solve:
    """What designs on a coarse mesh, each curve anew."""
    designer = Designer(mesh)

    def solve(request: Request, progress: Progress | None) -> Design:
        designer.forget()
        return designer._designed(request, progress, time.perf_counter())

    return solve


def design_curve(
    mesh: Mesh,
    control_points: ArrayLike | SurfacePoints,
    *,
    closed: bool = True,
    order: str = "given",
    via_points: ViaPoints | None = None,
    method: str = "nicmm",
    obstacles: ArrayLike | None = None,
    alignment: ArrayLike | None = None,
    smoothness: float = 1.0,
    progress: Progress | None = None,
) -> Design:
    """Design a smooth curve on a mesh through control points.

    Parameters
    ----------
    mesh : Mesh
    control_points : (k,) int array_like, (k, 3) float array_like or SurfacePoints
        Vertex indices, points on the surface, or faces with barycentric coordinates; at least
        three, or two of an open curve.
    closed : bool, default True
        A closed curve, or an open one from the first point visited to the last.
    order : {"given", "shortest"}
        Visit the points in this order, or in the shortest one: cyclic where the curve is closed.
    via_points : mapping, optional
        Which way the curve goes from one control point to the next, where there are several: from
        the index of a control point to points, in any form that control points may have, that the
        initial path passes on its way from there, such as ``{1: [57]}``. The curve does not pass
        them exactly. Only for the order "given".
    method : {"nicmm", "nicmm-paper", "variational"}
        The pretrained network's level set, relaxed on the surface (the default); the paper's own
        method, which trains the network on for every curve; or the same energy minimised without
        a network.
    obstacles, alignment : (V,) array_like of weights in [0, 1], optional
        What the curve shall avoid and what it shall follow.
    smoothness : float, default 1
        Larger gives a fairer curve that follows the shortest way less closely.
    progress : callable, optional
        Called with the fraction done and the points of the curve so far, a few times a second at
        most; the design stops when it returns False.

    Returns
    -------
    Design

    Raises
    ------
    ControlPointError
        If there are too few points, or one is repeated, out of range or off the surface.
    UnreachableError
        If no such curve exists on the surface, or only one that winds round itself too often.
    ArgumentError
        If another argument cannot be used.
    MissingPackageError
        If the method needs PyTorch and it cannot be imported.

    Examples
    --------
    >>> import nicmm_core as nicmm
    >>> from nicmm_core import shapes
    >>> mesh = shapes.sphere(3)
    >>> design = nicmm.design_curve(mesh, [12, 80, 41], order="shortest")
    >>> len(design.curves)
    1
    """
    return Designer(mesh).design(
        control_points,
        closed=closed,
        order=order,
        via_points=via_points,
        method=method,
        obstacles=obstacles,
        alignment=alignment,
        smoothness=smoothness,
        progress=progress,
    )


def _at_input_vertices(mesh: Mesh, problem: Problem, field: FloatArray) -> FloatArray:
    """φ in mesh units at the input vertices."""
    if problem.bundle is not None:
        field = np.abs(field)
    inputs = problem.working.input_vertex
    values = np.full(len(mesh.vertices), field.max() * problem.unit)
    values[inputs[inputs >= 0]] = field[inputs >= 0] * problem.unit
    return values
