"""Minimises the energy by damped Gauss–Newton steps in a narrow band (Levenberg–Marquardt).

Each step is looked for among the values of φ at the vertices (`variational`) or among the
parameters of the network (`fitting`). After a step φ is replaced by the signed distance to the new
curve, because the ridges of the old distance would hold the curve back. This may raise the energy,
so the curve fluctuates in the end, unless only steps that lower it are taken from then on. If
changing the sign of a vertex would split the curve or detach it from a control point, the step is
halved; if that does not help, it is solved again with this vertex held. So the zero set is always
one simple curve.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple, Protocol

import numpy as np
from scipy import sparse

from ..geometry import tolerances
from ..geometry.array_types import BoolArray, FloatArray
from ..geometry.distances import build_distance_surface
from ..progress import checkpoint
from ..status import Status
from .contour import signs_with_zeros
from .losses import LossWeights, energy_of
from .narrow_band import NarrowBand, build_narrow_band, evaluate, gauss_newton_system
from .problem import Problem
from .redistancing import redistanced
from .signed_distance import LEAST_DISTANCE
from .solution import Solution
from .topology import breaking_vertices
from .vertex_links import VertexLinks


@dataclass(frozen=True)
class SolverConfig:
    """Settings of the solver; lengths are in mean edge lengths at the initial path.

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
    settling : int, optional
        Number of iterations after which the solver returns to the best φ, if the least loss has
        fallen by less than the tolerance in them. From then on, it takes a step only if the signed
        distance to the new curve has less energy.
    patience : int
        Number of iterations after which the solver has converged, if the least loss has fallen by
        less than the tolerance in them. They count after it has settled.
    tolerance, relative_tolerance : float
        Decrease of the least loss that counts as progress: absolute, and relative to the loss.
    iterations : int
        Maximum number of iterations.
    trials : int
        Maximum number of trial steps in one iteration.
    halvings : int
        Number of times that a step is halved, if it breaks the topology, before vertices are held.
    holds : int
        Maximum number of times that vertices are added to those that are held in one iteration.
    """

    half_width: float = 4.0
    longest_move: float = 1.5
    beside: float = 2.0
    damping: float = 1e-2
    least_damping: float = 1e-6
    settling: int | None = None
    patience: int = 10
    tolerance: float = 1e-5
    relative_tolerance: float = 0.0
    iterations: int = 100
    trials: int = 25
    halvings: int = 2
    holds: int = 6


LEAST_GAIN = 1e-3
"""Least decrease of the energy for which a step is accepted, relative to the predicted decrease."""

GOOD_GAIN, POOR_GAIN = 0.75, 0.25
"""Relative decreases above which the damping is lowered, and below which it is raised."""

MORE_DAMPING = 4.0
"""Factor of the damping after a step that is not accepted; its inverse after one of good gain."""


class Steps(Protocol):
    """The steps among which the solver looks, for a band with u unknowns."""

    def linearise(
        self,
        band: NarrowBand,
        hessian: sparse.csr_array,
        gradient: FloatArray,
        beside: BoolArray,
    ) -> None:
        """Prepare for steps from the present φ.

        Parameters
        ----------
        band : NarrowBand
        hessian : (u, u) sparse array
            Second derivative of the energy, positive semidefinite.
        gradient : (u,) float array
        beside : (u,) bool array
            Whether each unknown lies beside the curve.
        """

    def solve(self, damping: float, held: BoolArray) -> FloatArray:
        """Solve for a step; return the change of φ at the unknowns to first order, (u,)."""

    def take(self, scale: float) -> FloatArray:
        """Change of φ at the unknowns, (u,), by a multiple of the last step."""

    def keep(self) -> None:
        """Make the last step taken permanent."""


class _LevelSet(NamedTuple):
    """A signed distance φ, (n,), with its band and its energy."""

    field: FloatArray
    band: NarrowBand
    energy: float


def minimise(
    problem: Problem,
    start: FloatArray,
    steps: Steps,
    weights: LossWeights,
    config: SolverConfig,
    watch: Callable[[float, FloatArray], bool] | None = None,
) -> Solution:
    """Minimise the energy from a level set whose zero set is isotopic to that of φ₀.

    Parameters
    ----------
    problem : Problem
    start : (n,) float array
    steps : Steps
    weights : LossWeights
    config : SolverConfig
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

    def level_set(field: FloatArray) -> _LevelSet:
        distance = redistanced(surface, field, controls, reach, problem.bundle)
        band = build_narrow_band(problem, distance, config.half_width * h)
        return _LevelSet(distance, band, evaluate(band, weights, distance[band.unknowns]).energy)

    present = best = level_set(start)
    losses: list[float] = []
    least: list[float] = []
    damping, n_held, is_settled = config.damping, 0, False
    status = Status.ITERATION_LIMIT
    for iteration in range(1, config.iterations + 1):
        losses.append(present.energy)
        if not np.isfinite(present.energy):
            status = Status.DIVERGED
            break
        if present.energy <= best.energy:
            best = present
        least.append(best.energy)
        if watch is not None and not watch(iteration / config.iterations, best.field):
            status = Status.CANCELLED
            break
        if _has_stalled(least, config.patience, config):
            status = Status.CONVERGED
            break
        if config.settling is not None and not is_settled:
            is_settled = _has_stalled(least, config.settling, config)
            if is_settled:
                present, least = best, [best.energy]
                damping = max(damping, config.damping)
        if iteration == config.iterations:
            break
        step = _step(problem, present.band, links, present.field, steps, weights, damping, config)
        if step is None:
            status = Status.CONVERGED
            break
        found, gain = level_set(step.field), step.gain
        if is_settled:
            gain = (present.energy - found.energy) / step.predicted
        damping = _next_damping(step.damping, gain, config)
        if not is_settled or gain > LEAST_GAIN:
            steps.keep()
            present, n_held = found, n_held + step.held
    field = signed_distance_of(problem, best.field)
    return Solution(field, energy_of(problem, field), losses, status, n_held)


def signed_distance_of(problem: Problem, field: FloatArray) -> FloatArray:
    """Signed distance to the zero set of a field, at all vertices, (n,)."""
    surface = build_distance_surface(problem.vertices, problem.working.faces, problem.edge_length)
    return redistanced(surface, field, problem.loop.control_vertices, bundle=problem.bundle)


def _has_stalled(least: list[float], patience: int, config: SolverConfig) -> bool:
    """Whether the least loss so far, in every iteration, has hardly fallen in the last ones."""
    if len(least) <= patience:
        return False
    decrease = least[-1 - patience] - least[-1]
    return decrease < max(config.tolerance, config.relative_tolerance * least[-1])


class _Step(NamedTuple):
    """A step that lowers the energy.

    Attributes
    ----------
    field : (n,) float array
        φ after the step.
    damping : float
        Damping with which it was found.
    predicted, gain : float
        Decrease of the energy to second order, and the decrease relative to it.
    held : int
        Number of vertices that had to keep their signs.
    """

    field: FloatArray
    damping: float
    predicted: float
    gain: float
    held: int


def _next_damping(damping: float, gain: float, config: SolverConfig) -> float:
    """Damping for the step after one with some gain."""
    if not gain > LEAST_GAIN:  # also if it is NaN
        return MORE_DAMPING * damping
    if gain > GOOD_GAIN:
        return max(damping / MORE_DAMPING, config.least_damping)
    return 2.0 * damping if gain < POOR_GAIN else damping


def _step(
    problem: Problem,
    band: NarrowBand,
    links: VertexLinks,
    field: FloatArray,
    steps: Steps,
    weights: LossWeights,
    damping: float,
    config: SolverConfig,
) -> _Step | None:
    """Find a step from φ (n,), or None if no step lowers the energy."""
    h, controls = problem.edge_length, problem.loop.control_vertices
    values = field[band.unknowns]
    residuals = evaluate(band, weights, values)
    hessian, gradient = gauss_newton_system(band, weights, residuals)
    beside = np.abs(values) < config.beside * h
    steps.linearise(band, hessian, gradient, beside)
    held = np.zeros(len(values), dtype=bool)
    holds = 0
    for _ in range(config.trials):
        checkpoint()
        change = steps.solve(weights.sdf * damping, held)
        farthest = np.abs(change[beside]).max(initial=0.0)
        scale = min(1.0, config.longest_move * h / max(farthest, tolerances.TINY))
        for halvings in range(config.halvings + 1):
            moved = field.copy()
            moved[band.unknowns] += steps.take(0.5**halvings * scale)
            breaking = breaking_vertices(links, field, moved, controls)
            if not len(breaking):
                break
        if len(breaking) and holds < config.holds:
            holds += 1
            held |= np.isin(band.unknowns, breaking)
            continue
        change *= 0.5**halvings * scale
        predicted = -(gradient @ change + 0.5 * (change @ (hessian @ change)))
        if not predicted > 0.0:
            return None
        moved[breaking] = LEAST_DISTANCE * h * signs_with_zeros(field, controls)[breaking]
        energy = evaluate(band, weights, moved[band.unknowns]).energy
        gain = (residuals.energy - energy) / predicted
        if gain > LEAST_GAIN:
            n_held = len(np.union1d(band.unknowns[held], breaking))
            return _Step(moved, damping, predicted, gain, n_held)
        damping = _next_damping(damping, gain, config)
    return None
