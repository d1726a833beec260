"""The variational method: the same energy, with φ at the vertices of a narrow band as unknowns.

The paper compares itself with Zhang et al. ("Versatile curve design by level set with quadratic
convergence", 2024), whose code is not public. This module is the strongest method of that kind
known to us. Every iteration takes a damped Gauss–Newton step in the band around the current
curve and then replaces φ by the signed distance to the new curve, because the ridges of the old
distance would hold the curve back. If changing the sign of a vertex would split the curve or detach
it from a control point, the vertex is held for that step. So the zero set is always one simple
curve.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy import sparse

from ..geometry.array_types import BoolArray, FloatArray
from ..geometry.distances import build_distance_surface
from ..progress import checkpoint
from ..status import Status
from .losses import LossWeights, energy_of
from .narrow_band import NarrowBand, build_narrow_band, evaluate, gauss_newton_system
from .problem import Problem
from .redistancing import redistanced
from .solution import Solution
from .sparse_solver import factorised
from .topology import breaking_vertices
from .vertex_links import VertexLinks


@dataclass(frozen=True)
class VariationalConfig:
    """Settings of the solver; lengths are in mean edge lengths at the curve.

    Attributes
    ----------
    half_width : float
        Half width of the band. The Gaussian of the bending term ends at 3; wider bands cross the
        ridge between two strands of the curve more often.
    longest_move : float
        Maximum change of φ near the curve in one step, chosen so that the band contains the new
        curve.
    beside : float
        Distance to the curve within which that limit applies.
    damping : float
        Initial weight of the step's norm, relative to λ_sdf.
    least_damping : float
        Lower bound of that weight.
    patience : int
        Number of iterations after which the solver has converged if the least loss has fallen by
        less than the tolerance in them (section 4.5 of the paper).
    tolerance : float
        Decrease of the least loss that counts as progress, from the same section.
    iterations : int
        Maximum number of iterations.
    trials : int
        Maximum number of trial steps in one iteration.
    """

    half_width: float = 4.0
    longest_move: float = 1.5
    beside: float = 2.0
    damping: float = 1e-2
    least_damping: float = 1e-6
    patience: int = 10
    tolerance: float = 1e-5
    iterations: int = 100
    trials: int = 25


LEAST_GAIN = 1e-3
"""Least decrease of the energy for which a step is accepted, relative to the predicted decrease."""

GOOD_GAIN, POOR_GAIN = 0.75, 0.25
"""Relative decreases above which the damping is lowered, and below which it is raised."""


def solve(
    problem: Problem,
    weights: LossWeights,
    config: VariationalConfig,
    watch: Callable[[float, FloatArray], bool] | None = None,
) -> Solution:
    """Minimise the energy by Gauss–Newton steps on signed distances.

    Parameters
    ----------
    problem : Problem
    weights : LossWeights
    config : VariationalConfig
    watch : callable, optional
        Function called in every iteration with the progress, as a fraction of the maximum number of
        iterations, and the best φ so far. The solver stops when the function returns False.

    Returns
    -------
    Solution
        The best φ as a signed distance; its zero set is isotopic to that of φ₀.
    """
    h = problem.edge_length
    controls = problem.loop.control_vertices
    surface = build_distance_surface(problem.vertices, problem.working.faces, h)
    links = VertexLinks(problem.working, problem.bundle)
    reach = (config.half_width + 1.0) * h
    field = redistanced(surface, problem.initial_distance, controls, reach, problem.bundle)
    best_field, losses, least = field, [], []
    damping = config.damping
    status = Status.ITERATION_LIMIT
    for iteration in range(1, config.iterations + 1):
        band = build_narrow_band(problem, field, config.half_width * h)
        losses.append(evaluate(band, weights, field[band.unknowns]).energy)
        if not np.isfinite(losses[-1]):
            status = Status.DIVERGED
            break
        if losses[-1] <= min(losses):
            best_field = field
        least.append(min(losses))
        if watch is not None and not watch(iteration / config.iterations, best_field):
            status = Status.CANCELLED
            break
        if _has_converged(least, config):
            status = Status.CONVERGED
            break
        moved, damping = gauss_newton_step(problem, band, links, field, weights, damping, config)
        if moved is None:
            status = Status.CONVERGED
            break
        field = redistanced(surface, moved, controls, reach, problem.bundle)
    field = redistanced(surface, best_field, controls, bundle=problem.bundle)
    return Solution(field, energy_of(problem, field), losses, status, keeps_topology=True)


def _has_converged(least: list[float], config: VariationalConfig) -> bool:
    """Whether the least loss so far, in every iteration, has converged."""
    if len(least) <= config.patience:
        return False
    return least[-1 - config.patience] - least[-1] < config.tolerance


def gauss_newton_step(
    problem: Problem,
    band: NarrowBand,
    links: VertexLinks,
    field: FloatArray,
    weights: LossWeights,
    damping: float,
    config: VariationalConfig,
) -> tuple[FloatArray | None, float]:
    """Take one damped Gauss–Newton step (Levenberg–Marquardt).

    Parameters
    ----------
    problem : Problem
    band : NarrowBand
        Operators around the zero set of the field.
    links : VertexLinks
        Links of the working vertices.
    field : (n,) float array
        Current φ.
    weights : LossWeights
    damping : float
        Weight of the step's norm, relative to λ_sdf.
    config : VariationalConfig

    Returns
    -------
    (n,) float array or None
        The new φ, or None if no step lowers the energy.
    float
        Damping for the next step.
    """
    h = problem.edge_length
    values = field[band.unknowns]
    residuals = evaluate(band, weights, values)
    hessian, gradient = gauss_newton_system(band, weights, residuals)
    beside = np.abs(values) < config.beside * h
    free = np.ones(len(values), dtype=bool)
    for _ in range(config.trials):
        checkpoint()
        step = _damped_step(band, hessian, gradient, weights.sdf * damping, free)
        farthest = np.abs(step[beside]).max(initial=0.0)
        if farthest > config.longest_move * h:
            step *= config.longest_move * h / farthest
        moved = field.copy()
        moved[band.unknowns] += step
        breaking = breaking_vertices(links, field, moved, problem.loop.control_vertices)
        if len(breaking):
            free &= ~np.isin(band.unknowns, breaking)
            continue
        predicted = -(gradient @ step + 0.5 * (step @ (hessian @ step)))
        if not predicted > 0.0:
            return None, damping
        gain = (residuals.energy - evaluate(band, weights, values + step).energy) / predicted
        if not gain > LEAST_GAIN:  # also if it is NaN
            damping *= 4.0
            continue
        if gain > GOOD_GAIN:
            damping = max(damping / 4.0, config.least_damping)
        elif gain < POOR_GAIN:
            damping *= 2.0
        return moved, damping
    return None, damping


def _damped_step(
    band: NarrowBand,
    hessian: sparse.csr_array,
    gradient: FloatArray,
    damping: float,
    free: BoolArray,
) -> FloatArray:
    """Solve the damped system for the free unknowns; zero for the held ones, shape (u,)."""
    system = hessian + damping * band.damping
    step = np.zeros(len(gradient))
    step[free] = factorised(system[free][:, free])(-gradient[free])
    return step
