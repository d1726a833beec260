"""Designs a curve by the method of the paper or the variational method, as a zero set."""

from __future__ import annotations

import time
from dataclasses import replace
from functools import partial

import numpy as np

from ..design_result import Design
from ..geometry.array_types import FloatArray
from ..geometry.mesh import Mesh
from ..progress import CancelledError, checkpoint, subrange
from ..request import Request
from ..status import Status
from . import variational
from .losses import LossWeights, balanced, energy_of
from .problem import Problem, requested_problem
from .solution import Solution
from .zero_set import ZeroSet, zero_set


def level_set_design(mesh: Mesh, request: Request, started: float) -> Design:
    """Design a curve by a method other than "nicmm".

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
        zeros = zero_set(mesh, problem, solution.field, solution.keeps_topology)
    except CancelledError:
        if watch.shown is None:
            raise
        field = watch.shown.field
        solution = Solution(field, energy_of(problem, field), [], Status.CANCELLED)
        design = _design(mesh, problem, solution, watch.shown, started)
        return replace(design, iterations=watch.shown_after)
    return _design(mesh, problem, solution, zeros, started)


def _solution(problem: Problem, request: Request, watch: _FieldWatch) -> Solution:
    """Solve for the level set by the method of a request."""
    weights = balanced(LossWeights(smooth=request.smoothness * LossWeights.smooth), problem)
    if request.method == "variational":
        return variational.solve(problem, weights, variational.VariationalConfig(), watch)
    # These modules import PyTorch, which only this method needs.
    from .finetuning import FinetuningConfig, finetune
    from .weights_file import shipped_network

    network = shipped_network(problem.features.shape[1])
    return finetune(network, problem, weights, FinetuningConfig(), watch)


def _design(
    mesh: Mesh, problem: Problem, solution: Solution, zeros: ZeroSet, started: float
) -> Design:
    """The design whose curve is a zero set."""
    one = zeros.is_simple_curve(mesh, problem.loop.closed)
    return Design(
        status=solution.status if one else Status.NOT_ONE_CURVE,
        curves=zeros.curves,
        iterations=solution.iterations,
        seconds=time.perf_counter() - started,
        energy=solution.terms,
        breaking_vertices=zeros.breaking_vertices,
        find_field=partial(_at_input_vertices, mesh, problem, zeros.field),
    )


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
