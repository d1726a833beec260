"""Designs a curve as a zero set, by the method of the paper or the variational method."""

from __future__ import annotations

import time
from functools import partial

import numpy as np

from ..design_result import Design
from ..geometry.array_types import FloatArray
from ..geometry.curve import SurfaceCurve
from ..geometry.mesh import Mesh
from ..progress import CancelledError, checkpoint, subrange, watched
from ..request import Request
from ..status import Status
from . import fitting, variational
from .level_set_solver import signed_distance_of
from .losses import LossWeights, balanced, energy_of
from .problem import Problem, requested_problem
from .solution import Solution
from .weights_file import shipped_network
from .zero_set import is_simple_curve, zero_set


def level_set_design(mesh: Mesh, request: Request, started: float) -> Design:
    """Design a curve by the method "nicmm" or "variational".

    Parameters
    ----------
    mesh : Mesh
        A mesh whose faces all have an area and whose edges have at most two faces.
    request : Request
    started : float
        Value of `time.perf_counter` when the design began.

    Raises
    ------
    UnreachableError
        If no simple curve passes through the points in this order.
    """
    with subrange(0.0, 0.3):
        problem = requested_problem(mesh, request)
    watch = _FieldWatch(mesh, problem)
    try:
        with subrange(0.3, 0.9):
            solution = _solution(problem, request, watch)
        curves = zero_set(mesh, problem, solution.field)
        iterations = solution.iterations
    except CancelledError:
        if watch.shown is None:
            raise
        shown, curves, iterations = watch.shown
        with watched(None):  # the progress function has already cancelled
            field = signed_distance_of(problem, shown)
        solution = Solution(field, energy_of(problem, field), [], Status.CANCELLED)
    one = is_simple_curve(mesh, curves, problem.loop.closed)
    return Design(
        status=solution.status if one else Status.NOT_ONE_CURVE,
        curves=curves,
        iterations=iterations,
        seconds=time.perf_counter() - started,
        energy=solution.terms,
        breaking_vertices=solution.held,
        find_field=partial(_at_input_vertices, mesh, problem, solution.field),
    )


def _solution(problem: Problem, request: Request, watch: _FieldWatch) -> Solution:
    """Solve for the level set by the method of a request."""
    weights = balanced(LossWeights(smooth=request.smoothness * LossWeights.smooth), problem)
    if request.method == "variational":
        return variational.solve(problem, weights, watch=watch)
    network = shipped_network(problem.features.shape[1])
    return fitting.fit(network, problem, weights, watch=watch)


class _FieldWatch:
    """Reports the zero set while a level set is computed.

    `shown` is the last one reported: φ, its zero set and the number of iterations.
    """

    def __init__(self, mesh: Mesh, problem: Problem) -> None:
        self._mesh, self._problem = mesh, problem
        self._iterations = 0
        self.shown: tuple[FloatArray, list[SurfaceCurve], int] | None = None

    def __call__(self, done: float, field: FloatArray) -> bool:
        self._iterations += 1
        checkpoint(done, partial(self._show, field, self._iterations))
        return True

    def _show(self, field: FloatArray, iteration: int) -> FloatArray:
        curves = zero_set(self._mesh, self._problem, field)
        self.shown = field, curves, iteration
        return curves[0].points if curves else np.zeros((0, 3))


def _at_input_vertices(mesh: Mesh, problem: Problem, field: FloatArray) -> FloatArray:
    """φ at the input vertices, in mesh units; vertices without φ get the largest value."""
    if problem.bundle is not None:
        # A section of a sign bundle has no sign at a vertex: the sign depends on the face.
        field = np.abs(field)
    inputs = problem.working.input_vertex
    values = np.full(len(mesh.vertices), field.max() * problem.unit)
    values[inputs[inputs >= 0]] = field[inputs >= 0] * problem.unit
    return values
