"""The main path: from a mesh and control points to a curve. Read this file first.

control points → initial loop → signed distance → features (`problem`) → network, pretrained
→ prediction → one loop through the points → contour → relaxation of the curve.
"""

from __future__ import annotations

import enum
import time
from collections.abc import Callable
from dataclasses import dataclass
from dataclasses import field as dataclass_field
from functools import cached_property, partial
from typing import TypeVar

import numpy as np
from numpy.typing import ArrayLike

from . import variational
from .arguments import check_choices, check_torch, checked_map, checked_smoothness
from .array_types import FloatArray
from .contour import extract_curves
from .crossings import crossing_segments
from .curve import SurfaceCurve
from .curve_field import curve_field
from .curve_nodes import CurveSurface, unsigned_normals
from .errors import ArgumentError
from .losses import LossWeights, balanced
from .mesh import Mesh
from .network import NetworkWeights
from .problem import Problem, build_problem
from .relaxation import RelaxationConfig, Relaxed, relax
from .single_pass import predict_once
from .solution import Solution
from .surface_points import SurfacePoints, locate_control_points
from .topology import keep_topology
from .via_points import ViaPoints
from .weights_file import load_weights

PROGRESS_INTERVAL = 0.25
"""Least seconds between two calls of a caller's progress function."""

Progress = Callable[[float, FloatArray], object]

State = TypeVar("State")


class Status(enum.Enum):
    """How a design ended; ``str()`` says what to change."""

    CONVERGED = "converged: one curve through all control points"
    ITERATION_LIMIT = (
        "stopped at the iteration limit before the energy came to rest; the curve is usable, a "
        "finer mesh or other control points may make it fairer"
    )
    DIVERGED = (
        "the energy left the range of numbers and the best curve before is returned; look for "
        "faces without area, or merge vertices by distance"
    )
    UNRELAXED = (
        "strands of the curve are so close to one another that it is returned as the level set "
        "gives it; use a finer mesh, fewer points or another order"
    )
    CANCELLED = "cancelled by the progress function; the curve is the best one so far"
    NOT_ONE_CURVE = (
        "the level set is not one simple curve through all control points; the mesh may branch "
        "there (edges of three faces): repair it, or move the control points"
    )

    def __str__(self) -> str:
        """What happened and what to change."""
        return self.value


@dataclass(frozen=True)
class Design:
    """The result of a design.

    Attributes
    ----------
    status : Status
    curves : list of SurfaceCurve
        One entry when all is well.
    iterations : int
        Of the network's training, of the solver, or of the relaxation.
    seconds : float
    energy : dict of str to float
        The terms of Eq. 2 without their weights: "sdf", "int", "smooth" and "fea", for lengths in
        square roots of the surface's area.
    breaking_vertices : int
        Vertices whose predicted sign would have split the curve or missed a point, so that the
        initial level set replaces the predicted one around them; 0 when it was one loop by itself.
    find_field : callable
        Finds `field` when it is first asked for.
    """

    status: Status
    curves: list[SurfaceCurve]
    iterations: int
    seconds: float
    energy: dict[str, float]
    breaking_vertices: int
    find_field: Callable[[], FloatArray] = dataclass_field(repr=False, compare=False)

    @cached_property
    def field(self) -> FloatArray:
        """Level-set values in mesh units at the input mesh's vertices, shape (V,).

        Negative inside, or the distance without sign where the curve is open or bounds no region.
        Vertices that are not connected to the control points get the largest value: they are
        outside.
        """
        return self.find_field()


class Designer:
    """A surface that will be asked for many curves.

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
        problem = build_problem(
            self.mesh,
            points,
            order,
            checked_map("obstacles", obstacles, self.mesh),
            checked_map("alignment", alignment, self.mesh),
            checked_smoothness(smoothness),
            closed,
            via_points,
        )
        return self._solve(problem, method, float(smoothness), progress, started)

    def _solve(
        self,
        problem: Problem,
        method: str,
        smoothness: float,
        progress: Progress | None,
        started: float,
    ) -> Design:
        weights = balanced(LossWeights(smooth=smoothness * LossWeights.smooth), problem)
        solution = self._solution(problem, method, weights, progress)
        field, breaking, curves = self._curves(problem, solution.field, solution.keeps_topology)
        stopped, iterations, energy = solution.stopped, solution.iterations, solution.terms
        find_field = partial(_at_input_vertices, self.mesh, problem, field)
        if method == "nicmm" and is_one_curve(curves, problem.loop.closed):
            relaxed = self._relaxed(problem, curves[0], smoothness, progress)
            curves, stopped, iterations = [relaxed.curve], relaxed.stopped, relaxed.iterations
            energy = _sharp_energy(relaxed, problem)
            find_field = partial(curve_field, self.mesh, relaxed.curve)
        status = _STATUS[stopped]
        if not is_one_curve(curves, problem.loop.closed) or _crosses(self.mesh, curves[0]):
            status = Status.NOT_ONE_CURVE
        return Design(
            status=status,
            curves=curves,
            iterations=iterations,
            seconds=time.perf_counter() - started,
            energy=energy,
            breaking_vertices=breaking,
            find_field=find_field,
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
        from .prediction import PredictionConfig, predict
        from .trainable_network import build_network

        return predict(build_network(pretrained), problem, weights, PredictionConfig(), watch)

    def _relaxed(
        self, problem: Problem, curve: SurfaceCurve, smoothness: float, progress: Progress | None
    ) -> Relaxed:
        watch = None if progress is None else _seldom(progress, lambda points: points)
        importance, weight = None, 0.0
        if problem.feature_map is not None:
            importance = np.ones(len(self.mesh.vertices))
            inputs = problem.working.input_vertex
            importance[inputs[inputs >= 0]] = problem.feature_map[inputs >= 0]
            weight = LossWeights.feature / LossWeights.smooth / problem.unit**2
        surface = CurveSurface(self.mesh, self._normals, importance, weight)
        return relax(surface, curve, smoothness, RelaxationConfig(), watch)

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


_STATUS = {
    "converged": Status.CONVERGED,
    "cap": Status.ITERATION_LIMIT,
    "cancelled": Status.CANCELLED,
    "diverged": Status.DIVERGED,
    "unrelaxed": Status.UNRELAXED,
}


def _sharp_energy(relaxed: Relaxed, problem: Problem) -> dict[str, float]:
    """The terms of Eq. 2 where φ is exactly the distance to the curve."""
    feature = 0.0 if problem.feature_map is None else 0.5 * relaxed.feature / problem.unit
    smooth = 0.5 * relaxed.bending * problem.unit
    return {"sdf": 0.0, "int": 0.0, "smooth": smooth, "fea": feature}


def _crosses(mesh: Mesh, curve: SurfaceCurve) -> bool:
    """Whether a curve crosses or touches itself."""
    polyline = SurfacePoints(curve.faces, curve.barycentric)
    return len(crossing_segments(mesh, polyline, curve.closed)) > 0


def is_one_curve(curves: list[SurfaceCurve], closed: bool = True) -> bool:
    """Whether curves are a single one, closed or open, through all control points."""
    if len(curves) != 1 or curves[0].closed != closed:
        return False
    return bool((curves[0].control_index >= 0).all())


def _at_input_vertices(mesh: Mesh, problem: Problem, field: FloatArray) -> FloatArray:
    """φ in mesh units at the input vertices."""
    if problem.bundle is not None:
        field = np.abs(field)
    inputs = problem.working.input_vertex
    values = np.full(len(mesh.vertices), field.max() * problem.unit)
    values[inputs[inputs >= 0]] = field[inputs >= 0] * problem.unit
    return values
