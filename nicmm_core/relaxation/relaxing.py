"""Relaxes a curve on the surface until its energy converges, on levels of more and more nodes.

The start determines the course of the curve but not its shape: a level set has only the resolution
of its mesh, and in it strands a few edges apart block each other. From the start, nodes move over
the surface until the energy of Eq. 6 and 7 along the curve converges (`elastic_energy`).

A curve with few nodes moves far in a step, and a curve with many nodes resolves detail. So the
number of nodes increases from level to level. A start that bends little needs only the last level:
fewer nodes would not resolve thin parts of the surface, and the curve would lose its shape there.
If its energy is higher after that level than before, it is relaxed again on all levels.

An iteration takes several steps of the nodes
(`levenberg_marquardt`) and then retraces the curve. A node whose trace fails or would cross another
trace stays where it was for that iteration, so the curve is simple after every iteration. A contact
term repels strands.

For a curve that has nearly converged, such as one with a dragged control point, tracing can be
deferred: the nodes move without contact, and the curve is traced after convergence. If it then
crosses itself, it is relaxed again from the start, with a trace in every iteration.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace

import numpy as np

from ..geometry import tolerances
from ..geometry.array_types import BoolArray, FloatArray, IntArray
from ..geometry.curve import SurfaceCurve
from ..progress import CancelledError
from ..status import Status
from .curve_nodes import CurveSurface, Nodes
from .elastic_energy import balance, bending_energy, energy_scale, feature_energy
from .levenberg_marquardt import (
    DAMPING_FACTOR,
    Linearised,
    StepConfig,
    Stepping,
    Work,
    less_damping,
    linearised,
    take_steps,
)
from .noded_curve import (
    NodedCurve,
    is_simple,
    noded_curve,
    respaced,
    retraced,
    smoothed,
    traced_through,
    without_short_segments,
)
from .noded_energies import energies_of, scaled_bending
from .strand_contact import NearStrands


@dataclass(frozen=True)
class RelaxationConfig:
    """Settings of the schedule.

    Attributes
    ----------
    levels : tuple of int
        Number of nodes of each level, ascending.
    stepping : StepConfig
        Settings of the steps of an iteration.
    least_decrease : float
        Decrease of the energy in an iteration, relative to the bending energy, below which the last
        level has converged.
    least_decrease_before : float
        The same for all earlier levels.
    spacing_ratio : float
        Ratio of the longest to the shortest step of a leg above which nodes are respaced.
    iterations : int
        Cap on the iterations of one attempt, over all levels.
    most_iterations : int
        Cap on the iterations of all attempts together.
    work : float
        Cap on the `Work` of one attempt.
    defer_tracing : bool
        Whether a first attempt traces the curve only after convergence.
    tension_factor : float
        Factor of the tension in an additional first pass with the fewest nodes; there is no such
        pass if it is 1.
    fine_below : float
        L ∮ κ_g² ds of a start with nodes below which only the last level is used.
    """

    levels: tuple[int, ...] = (128, 512)
    stepping: StepConfig = field(default_factory=StepConfig)
    least_decrease: float = 2e-3
    least_decrease_before: float = 0.1
    spacing_ratio: float = 1.6
    iterations: int = 100
    most_iterations: int = 200
    work: float = 800.0
    defer_tracing: bool = False
    tension_factor: float = 1.0
    fine_below: float = 1e3


GUIDED = RelaxationConfig(
    levels=(64, 128, 512), least_decrease_before=1e-2, tension_factor=30.0, fine_below=0.0
)
"""Settings for maps with lanes, in which the curve must find a lane while it has few nodes.

Many nodes hardly move. Few nodes take long steps, which may inflate a fold of the start into an arc
from lane to lane, a local minimum far above the lowest energy. So a first pass with 30 times the
tension removes folds; lanes still hold the curve during that pass.
"""

TIGHTENED = RelaxationConfig(levels=(64, 128, 512), tension_factor=10.0, fine_below=0.0)
"""Settings for another attempt where a curve has kinks, as on rough surfaces.

The kinks are local minima. Tightening the start first leads to others, half of them lower.
"""

ACCEPTABLE = 80.0
"""L ∮ κ_g² ds up to which the energy may be higher than that of the start; twice that of a circle.

With the fewer nodes of the start, the energy of the same curve is slightly lower.
"""

RELEASES = 2
"""Number of times per level that held nodes are released after convergence."""

HELD_TRIES = 1
"""Number of times that an iteration is repeated, holding the nodes that could not be retraced."""

NEGLIGIBLE_PREDICTION = 0.1
"""Predicted decrease, relative to the least decrease, below which no step is tried.

It is far below 1, because damping makes predictions too small.
"""

MOST_STALLED = 4
"""Number of consecutive iterations without a new least energy after which a level ends.

On folds and needles, respacing the nodes may raise the energy by more than the steps lower it.
"""

LEAST_BENDING = 2e-3
"""Lower bound, as a share of the energy, on the bending energy used in the convergence test."""

SMALL_MOVE = 0.1
"""Greatest move that does not disturb the spacing, in mean distances between nodes."""


@dataclass(frozen=True)
class Relaxed:
    """Result of a relaxation.

    Attributes
    ----------
    curve : SurfaceCurve
        The relaxed curve, which is simple.
    noded_curve : NodedCurve
        The same curve with its nodes.
    bending : float
        ∮ κ_g² ds, in 1/length.
    feature : float
        ∮ φ_fea² ds, in units of length.
    iterations : int
        Number of iterations of all attempts.
    status : Status
        `CONVERGED`, `ITERATION_LIMIT` or `CANCELLED`; `UNRELAXED` if strands of the start are too
        close together to place nodes on it without contact. The curve is then the start itself.
    work : float
        Number of moves of all nodes in all attempts, a measure of the duration (`Work`).
    collided : bool
        Whether the curve crossed itself after an attempt with deferred tracing.
    """

    curve: SurfaceCurve
    noded_curve: NodedCurve
    bending: float
    feature: float
    iterations: int
    status: Status
    work: float
    collided: bool = False


Watch = Callable[[float, FloatArray], bool]

Movable = Callable[[FloatArray], BoolArray]
"""Tells which nodes may move, (n,), from their positions, (n, 3)."""


def relax(
    surface: CurveSurface,
    start: SurfaceCurve | NodedCurve,
    smoothness: float,
    config: RelaxationConfig,
    watch: Watch | None = None,
    movable: Movable | None = None,
) -> Relaxed:
    """Relax a curve.

    Parameters
    ----------
    surface : CurveSurface
    start : SurfaceCurve or NodedCurve
        A simple curve that passes through its control points in order.
    smoothness : float
        Divisor of the tension and of the weight of a map.
    config : RelaxationConfig
    watch : callable, optional
        Called after every iteration with 1 minus the remaining iterations, relative to
        `RelaxationConfig.iterations`, and the positions of the nodes, (n, 3). Relaxation stops when
        it returns False. It also stops, with the last traced curve, when `progress.checkpoint`
        raises `CancelledError`.
    movable : callable, optional
        Which nodes may move; by default all but the control points.

    Returns
    -------
    Relaxed
        The start itself, with the status `UNRELAXED`, if no simple relaxed curve was found.
    """
    relaxing = _Relaxing(surface, smoothness, config, watch, movable)
    if isinstance(start, SurfaceCurve):
        first = noded_curve(surface, start, config.levels[0])
        return relaxing.on_levels(config.levels, first, start)
    whole = start.surface_curve(surface.mesh)
    if len(config.levels) == 1 or scaled_bending(start) >= config.fine_below:
        return relaxing.on_levels(config.levels, start, whole)
    fine = relaxing.on_levels(config.levels[-1:], start, whole)
    stopped = fine.status is Status.CANCELLED or fine.iterations >= config.most_iterations
    before, after = energies_of(surface, [start, fine.noded_curve], smoothness)
    good = after <= before or scaled_bending(fine.noded_curve) <= ACCEPTABLE
    if stopped or (good and fine.status is not Status.UNRELAXED):
        return fine
    again = relaxing.on_levels(config.levels, start, whole, fine)
    one, other = energies_of(surface, [fine.noded_curve, again.noded_curve], smoothness)
    if other < one:
        return again
    status = Status.CANCELLED if again.status is Status.CANCELLED else fine.status
    return replace(fine, iterations=again.iterations, work=again.work, status=status)


@dataclass(frozen=True)
class _Relaxing:
    """The arguments of `relax` that are the same for all attempts."""

    surface: CurveSurface
    smoothness: float
    config: RelaxationConfig
    watch: Watch | None
    movable: Movable | None

    def on_levels(
        self,
        levels: tuple[int, ...],
        first: NodedCurve,
        start: SurfaceCurve,
        before: Relaxed | None = None,
    ) -> Relaxed:
        """Relax on some levels, at first without tracing the curve if that may be deferred.

        The result includes the iterations and the work of the attempt `before`.
        """
        config, surface = replace(self.config, levels=levels), self.surface
        iterations, work, collided = 0, 0.0, False
        if before is not None:
            iterations, work = before.iterations, before.work
            config = replace(config, work=config.work - work)
        for traces_every_iteration in (False, True) if config.defer_tracing else (True,):
            attempt = _Attempt(
                surface,
                self.smoothness,
                config,
                self.watch,
                self.movable,
                traces_every_iteration,
                first,
                iterations,
            )
            curve = attempt.run()
            iterations, work = attempt.iterations, work + attempt.work.spent
            good = curve is not None and is_simple(surface, curve)
            if good or attempt.status is Status.CANCELLED:
                break
            collided = not traces_every_iteration
        status = attempt.status
        if curve is not None and good:
            result = without_short_segments(surface.mesh, curve)
        else:
            curve, result = first, start
            status = Status.CANCELLED if status is Status.CANCELLED else Status.UNRELAXED
        bending, feature = bending_energy(curve.nodes), feature_energy(curve.nodes)
        return Relaxed(result, curve, bending, feature, iterations, status, work, collided)


def _unevenness(nodes: Nodes, control_nodes: IntArray) -> float:
    """Greatest ratio of the longest to the shortest step on a leg."""
    lengths = nodes.lengths
    first = control_nodes[control_nodes < len(lengths)]
    longest, shortest = np.maximum.reduceat(lengths, first), np.minimum.reduceat(lengths, first)
    return float((longest / np.maximum(shortest, tolerances.TINY)).max())


@dataclass(frozen=True)
class _State:
    """A curve between two iterations, with its linearised energy."""

    curve: NodedCurve  # as last traced
    here: Linearised
    held: BoolArray  # (n,) which nodes must not move
    stepping: Stepping
    movable: BoolArray | None  # (n,) None if all nodes may move

    @property
    def free(self) -> BoolArray:
        """Which nodes may move, (n,)."""
        free = ~self.held if self.movable is None else self.movable & ~self.held
        free[self.curve.control_nodes] = False
        return free

    @property
    def energy_scale(self) -> float:
        """Energy that decreases are compared with."""
        return energy_scale(self.here.nodes, self.stepping.weights, self.here.energy)

    @property
    def predicted_decrease(self) -> float:
        """Predicted decrease of the energy by the least damped step."""
        return self.here.predicted_decrease(self.free, self.stepping.config)


@dataclass(frozen=True)
class _Iteration:
    """The result of an iteration that lowered the energy."""

    curve: NodedCurve  # as last traced
    nodes: Nodes
    energy: float
    held: BoolArray  # (n,) which nodes could not move
    damping: float  # for the next iteration
    farthest: float  # greatest length of a move, in mean distances between nodes


class _TraceError(Exception):
    """The curve cannot be traced through its nodes."""


class _Attempt:
    """One pass through all levels, from one start."""

    def __init__(
        self,
        surface: CurveSurface,
        smoothness: float,
        config: RelaxationConfig,
        watch: Watch | None,
        movable: Movable | None,
        traces_every_iteration: bool,
        start: NodedCurve,
        iterations: int,
    ) -> None:
        self.surface, self.smoothness, self.config, self.watch = surface, smoothness, config, watch
        self.movable, self.traces_every_iteration = movable, traces_every_iteration
        self.iterations = iterations  # including those of earlier attempts
        self.last_iteration = min(iterations + config.iterations, config.most_iterations)
        self.work = Work(config.work)
        self.status = Status.CONVERGED
        self.traced = start  # the result if cancelled

    def run(self) -> NodedCurve | None:
        """Relax the curve level by level; None if it cannot be traced."""
        config, curve = self.config, self.traced
        passes = [(level, 1.0) for level in config.levels]
        if config.tension_factor > 1.0:
            passes.insert(0, (config.levels[0], config.tension_factor))
        try:
            for number, (level, tension_factor) in enumerate(passes):
                last = number == len(passes) - 1
                least = config.least_decrease if last else config.least_decrease_before
                curve = self._level(curve, level, least, tension_factor)
                if self.status is not Status.CONVERGED:
                    break
        except _TraceError:
            return None
        except CancelledError:
            self.status = Status.CANCELLED
            return self.traced
        return curve

    def _level(
        self, curve: NodedCurve, level: int, least: float, tension_factor: float
    ) -> NodedCurve:
        """Iterate with a fixed number of nodes until the energy decreases by less than `least`."""
        config, least_damping = self.config, self.config.stepping.least_damping(level)
        damping = least_damping
        curve = self.traced = self._respaced(curve, level)
        nodes = curve.nodes
        held = np.zeros(len(nodes.positions), dtype=bool)
        releases = stalled = 0
        least_energy = np.inf
        while True:
            state = self._state(curve, nodes, held, tension_factor)
            before, least_scale = state.here.energy, LEAST_BENDING * state.energy_scale
            scale = max(bending_energy(nodes), least_scale)
            done = None
            if state.predicted_decrease > NEGLIGIBLE_PREDICTION * least * scale:
                if self.iterations == self.last_iteration or self.work.exhausted():
                    self.status = Status.ITERATION_LIMIT
                    break
                self.iterations += 1
                done = self._iteration(state, damping)
                if done is None and self.work.exhausted():
                    self.status = Status.ITERATION_LIMIT
                    break
            if done is not None:
                curve, nodes, damping, held = done.curve, done.nodes, done.damping, held | done.held
                self.traced = curve
                share = 1.0 - (self.last_iteration - self.iterations) / config.iterations
                if self.watch is not None and not self.watch(share, nodes.positions):
                    self.status = Status.CANCELLED
                    break
                scale = max(bending_energy(nodes), least_scale)
                stalled = 0 if done.energy < least_energy else stalled + 1
                least_energy = min(least_energy, done.energy)
                if stalled == MOST_STALLED:
                    if level == config.levels[-1]:
                        self.status = Status.ITERATION_LIMIT
                    break
            if done is None or before - done.energy <= least * scale:
                if releases == RELEASES or not held.any():
                    break
                # Converged with held nodes: release them, as they may be able to move now.
                releases, damping = releases + 1, least_damping
                held = np.zeros(len(held), dtype=bool)
            moved = done is not None and done.farthest > SMALL_MOVE
            if moved and _unevenness(nodes, curve.control_nodes) > config.spacing_ratio:
                curve = self.traced = self._respaced(self._traced(curve, nodes), level)
                nodes = curve.nodes
                held = np.zeros(len(nodes.positions), dtype=bool)
        return self._traced(curve, nodes)

    def _state(
        self, curve: NodedCurve, nodes: Nodes, held: BoolArray, tension_factor: float
    ) -> _State:
        weights = balance(
            self.surface, nodes, self.smoothness, self.traces_every_iteration, tension_factor
        )
        strands = NearStrands(nodes) if self.traces_every_iteration else None
        stepping = Stepping(self.surface, weights, self.config.stepping, self.work, strands)
        movable = None if self.movable is None else self.movable(nodes.positions)
        return _State(curve, linearised(stepping, nodes), held, stepping, movable)

    def _iteration(self, state: _State, damping: float) -> _Iteration | None:
        """Take steps and retrace the curve, unless deferred; None if no step lowers the energy."""
        free, stepping = state.free, state.stepping
        tries = 0
        while True:
            moved = take_steps(stepping, state.here, free, damping)
            if moved is None:
                return None
            curve, nodes, energy, stayed = state.curve, moved.nodes, moved.energy, moved.stayed
            if self.traces_every_iteration:
                curve, kept = retraced(self.surface, state.curve, nodes)
                if kept.any() and tries < HELD_TRIES:
                    free &= ~kept
                    tries += 1
                    continue
                nodes, stayed = curve.nodes, stayed | kept
                if kept.any():
                    energy = stepping.energy(nodes)
            if energy < state.here.energy:
                damping = less_damping(moved, stepping.config)
                return _Iteration(curve, nodes, energy, stayed, damping, moved.farthest)
            damping = moved.damping * DAMPING_FACTOR

    def _traced(self, curve: NodedCurve, nodes: Nodes) -> NodedCurve:
        """The curve traced through its nodes if they have moved since the last trace."""
        changed: NodedCurve | None = curve
        if nodes is not curve.nodes:
            # A straight trace may fail where the start has a bypass and nodes may not move.
            still = None if self.movable is None else ~self.movable(nodes.positions)
            changed = traced_through(self.surface, curve, nodes, still)
        if changed is None:
            raise _TraceError
        return changed

    def _respaced(self, curve: NodedCurve, level: int) -> NodedCurve:
        """Respace the nodes if necessary, unless that would make strands touch."""
        alike = abs(len(curve.nodes.positions) - level) <= len(curve.control_nodes)
        if alike and _unevenness(curve.nodes, curve.control_nodes) <= self.config.spacing_ratio:
            return curve
        changed = respaced(self.surface, curve, level)
        if self.traces_every_iteration and not is_simple(self.surface, changed):
            return curve
        return changed if alike else self._smoothed(curve, changed)

    def _smoothed(self, coarse: NodedCurve, fine: NodedCurve) -> NodedCurve:
        """Move fine nodes onto a smooth curve through the coarse ones, if that bends less."""
        if len(fine.nodes.positions) < len(coarse.nodes.positions):
            return fine
        changed = smoothed(self.surface, coarse, fine)
        less = bending_energy(changed.nodes) < bending_energy(fine.nodes)
        return changed if less else fine
