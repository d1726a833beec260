"""The main path: from a mesh and control points to a curve. Read this file first.

control points → initial loop → signed distance → features (`problem`) → network, pretrained
→ prediction → one loop through the points → contour → relaxation of the curve.
"""

from __future__ import annotations

import copy
import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property, partial
from typing import TypeVar

import numpy as np
from numpy.typing import ArrayLike

from .arguments import check_choices, check_torch, checked_map, checked_smoothness
from .array_types import FloatArray, IntArray
from .crossings import crossing_segments
from .curve import SurfaceCurve
from .design_result import STATUS, Design, Status, is_one_curve
from .errors import ArgumentError
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
from .path.via_points import ViaPoints, same_via_points
from .relaxation.curve_field import curve_field
from .relaxation.curve_nodes import CurveSurface, unsigned_normals
from .relaxation.elastic_energy import FEATURE_TENSION
from .relaxation.exact_curve import ExactCurve
from .relaxation.relaxing import RelaxationConfig, Relaxed, relax
from .relaxation.warm_start import WARM, moved_along
from .surface_points import SurfacePoints, locate_control_points

PROGRESS_INTERVAL = 0.25
"""Least seconds between two calls of a caller's progress function."""

Progress = Callable[[float, FloatArray], object]

State = TypeVar("State")

Maps = tuple[FloatArray | None, FloatArray | None]
"""Obstacles and alignment."""


@dataclass(frozen=True)
class _Request:
    """What a relaxed curve was asked for, as far as it can be compared."""

    points: SurfacePoints
    closed: bool
    order: str
    via_points: ViaPoints | None
    maps: tuple[bytes | None, bytes | None]
    smoothness: float


@dataclass(frozen=True)
class _Remembered:
    """The last relaxed curve."""

    request: _Request
    visited: IntArray  # (k,) order of the control points
    surface: CurveSurface
    unit: float
    exact: ExactCurve
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

    def forget(self) -> None:
        """Start the next design anew."""
        self._last = None

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
        if progress is not None and not callable(progress):
            raise ArgumentError(f"progress is {progress!r}; pass a function or None")
        if method == "nicmm-paper":
            check_torch()
        points = locate_control_points(self.mesh, control_points, closed)
        maps = (
            checked_map("obstacles", obstacles, self.mesh),
            checked_map("alignment", alignment, self.mesh),
        )
        smoothness = checked_smoothness(smoothness)
        request = _Request(points, closed, order, via_points, _as_bytes(maps), smoothness)
        if method == "nicmm":
            again = self._designed_again(request, progress, started)
            if again is not None:
                return again
        problem = build_problem(self.mesh, points, order, *maps, smoothness, closed, via_points)
        return self._solve(problem, method, request, maps, progress, started)

    def _designed_again(
        self,
        request: _Request,
        progress: Progress | None,
        started: float,
    ) -> Design | None:
        """A design from the last curve; None where that is too different."""
        last = self._last
        if last is None or not _is_alike(request, last.request):
            return None
        if _is_same(request, last.request):
            return replace(last.design, seconds=time.perf_counter() - started)
        points = request.points[last.visited]
        surface = last.surface
        start = moved_along(surface, last.exact, points)
        if start is None:
            return None
        relaxed = self._relaxed(surface, start, request.smoothness, WARM, progress)
        design = self._relaxed_design(relaxed, surface, last.unit, 0, started)
        self._remember(request, last.visited, surface, last.unit, relaxed.exact, design)
        return design

    def _solve(
        self,
        problem: Problem,
        method: str,
        request: _Request,
        maps: Maps,
        progress: Progress | None,
        started: float,
    ) -> Design:
        weights = balanced(LossWeights(smooth=request.smoothness * LossWeights.smooth), problem)
        solution = self._solution(problem, method, weights, progress)
        field, breaking, curves = self._curves(problem, solution.field, solution.keeps_topology)
        one = is_one_curve(curves, problem.loop.closed) and not _crosses(self.mesh, curves[0])
        if method == "nicmm" and one:
            surface = self._curve_surface(maps, problem.unit)
            relaxed = self._relaxed(
                surface, curves[0], request.smoothness, RelaxationConfig(), progress
            )
            design = self._relaxed_design(relaxed, surface, problem.unit, breaking, started)
            visited = problem.loop.order
            self._remember(request, visited, surface, problem.unit, relaxed.exact, design)
            return design
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
        self, problem: Problem, method: str, weights: LossWeights, progress: Progress | None
    ) -> Solution:
        """The level set that a method finds."""
        watch = None if progress is None else self._field_watcher(problem, progress)
        if method == "variational":
            return variational.solve(problem, weights, variational.VariationalConfig(), watch)
        pretrained = self._pretrained(problem.features.shape[1])
        if method == "nicmm":
            return predict_once(pretrained, problem)
        # These import PyTorch, which nothing else needs.
        from .network.prediction import PredictionConfig, predict
        from .network.trainable_network import build_network

        return predict(build_network(pretrained), problem, weights, PredictionConfig(), watch)

    def _relaxed(
        self,
        surface: CurveSurface,
        start: SurfaceCurve | ExactCurve,
        smoothness: float,
        config: RelaxationConfig,
        progress: Progress | None,
    ) -> Relaxed:
        watch = None if progress is None else _seldom(progress, lambda points: points)
        return relax(surface, start, smoothness, config, watch)

    def _relaxed_design(
        self, relaxed: Relaxed, surface: CurveSurface, unit: float, breaking: int, started: float
    ) -> Design:
        feature = 0.0 if surface.feature_map is None else 0.5 * relaxed.feature / unit
        # φ is exactly the distance to the curve, so two terms of Eq. 2 vanish.
        energy = {"sdf": 0.0, "int": 0.0, "smooth": 0.5 * relaxed.bending * unit, "fea": feature}
        return Design(
            status=STATUS[relaxed.stopped],
            curves=[relaxed.curve],
            iterations=relaxed.iterations,
            seconds=time.perf_counter() - started,
            energy=energy,
            breaking_vertices=breaking,
            find_field=partial(curve_field, self.mesh, relaxed.curve),
        )

    def _remember(
        self,
        request: _Request,
        visited: IntArray,
        surface: CurveSurface,
        unit: float,
        exact: ExactCurve,
        design: Design,
    ) -> None:
        """Keep a curve that came to rest for the next request."""
        if design.status is not Status.CANCELLED:
            # The caller may change what was passed.
            request = replace(request, via_points=copy.deepcopy(request.via_points))
            self._last = _Remembered(request, visited, surface, unit, exact, design)

    def _curve_surface(self, maps: Maps, unit: float) -> CurveSurface:
        """The surface that curves move on; the unit is the square root of its area."""
        if all(one is None for one in maps):
            return CurveSurface(self.mesh, self._normals)
        importance = feature_map(self.mesh.vertices, *maps, self.mesh.mean_edge_length)
        return CurveSurface(self.mesh, self._normals, importance, FEATURE_TENSION / unit**2)

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
        return progress(fraction, points(state)) is not False

    return watch


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


def _is_alike(one: _Request, other: _Request) -> bool:
    """Whether two requests are for the same course of a curve."""
    return (
        len(one.points) == len(other.points)
        and one.closed == other.closed
        and one.order == other.order
        and same_via_points(one.via_points, other.via_points)
        and one.maps == other.maps  # the path goes round obstacles from the start
    )


def _is_same(one: _Request, other: _Request) -> bool:
    """Whether two requests that are alike do not differ at all."""
    return (
        np.array_equal(one.points.faces, other.points.faces)
        and np.array_equal(one.points.barycentric, other.points.barycentric)
        and one.smoothness == other.smoothness
    )


def _as_bytes(maps: Maps) -> tuple[bytes | None, bytes | None]:
    """Maps in a form that can be compared, and that the caller cannot change."""
    obstacles, alignment = (None if one is None else one.tobytes() for one in maps)
    return obstacles, alignment


def _crosses(mesh: Mesh, curve: SurfaceCurve) -> bool:
    """Whether a curve crosses or touches itself."""
    polyline = SurfacePoints(curve.faces, curve.barycentric)
    return len(crossing_segments(mesh, polyline, curve.closed)) > 0


def _at_input_vertices(mesh: Mesh, problem: Problem, field: FloatArray) -> FloatArray:
    """φ in mesh units at the input vertices."""
    if problem.bundle is not None:
        field = np.abs(field)
    inputs = problem.working.input_vertex
    values = np.full(len(mesh.vertices), field.max() * problem.unit)
    values[inputs[inputs >= 0]] = field[inputs >= 0] * problem.unit
    return values
