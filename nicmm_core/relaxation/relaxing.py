"""Relaxes a curve on the surface until its energy converges, on levels of more and more nodes.

The start determines the course of the curve but not its shape: a level set has only the resolution
of its mesh, and in it strands a few edges apart block each other. From the start, nodes move over
the surface until the energy of Eq. 6 and 7 along the curve converges (`elastic_energy`).

A curve with few nodes moves far in a step, and a curve with many nodes resolves detail. So the
number of nodes increases from level to level. A start that bends little needs only the last level:
fewer nodes would not resolve thin parts of the surface, and the curve would lose its shape there.
If its energy is higher after that level than before, it is relaxed again on all levels.

An iteration takes several steps of the nodes and then retraces the curve. A node whose trace fails
or would cross another trace stays where it was for that iteration, so the curve is simple after
every iteration. A contact term repels strands.

For a curve that has nearly converged, such as one with a dragged control point, tracing can be
deferred: the nodes move without contact, and the curve is traced after convergence. If it then
crosses itself, it is relaxed again from the start, with a trace in every iteration.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace

from nicmm_kernels import CurveRelaxation, LevelOutcome, LevelRules, LevelState, RelaxationRules

from ..geometry.array_types import BoolArray, FloatArray
from ..geometry.crossings import TOUCHING
from ..geometry.curve import SurfaceCurve
from ..progress import CancelledError, checkpoint
from ..status import Status
from .curve_energies import energies_of, scaled_bending
from .curve_nodes import CurveSurface
from .discrete_curve import (
    DiscreteCurve,
    curve_from_kernels,
    is_simple,
    place_nodes,
    placement_rules,
    without_short_segments,
)
from .elastic_energy import bending_energy, feature_energy
from .node_traces import step_limits
from .rules import relaxation_rules


@dataclass(frozen=True)
class RelaxationConfig:
    """Settings of the schedule.

    Attributes
    ----------
    levels : tuple of int
        Number of nodes of each level, ascending.
    steps : int
        Greatest number of steps in an iteration.
    longest_move : float
        Trust radius of the linearised energy, in mean distances between neighbouring nodes. A move
        of twice this length is taken if it lowers the energy further. Longer moves between two
        traces would fold the curve where it bends.
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
        Cap on the moves of all nodes in one attempt, whether taken or only tried. On defective
        surfaces few of them lower the energy.
    defer_tracing : bool
        Whether a first attempt traces the curve only after convergence.
    tension_factor : float
        Factor of the tension in an additional first pass with the fewest nodes; there is no such
        pass if it is 1.
    fine_below : float
        L ∮ κ_g² ds of a start with nodes below which only the last level is used.
    """

    levels: tuple[int, ...] = (128, 512)
    steps: int = 8
    longest_move: float = 2.0
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


@dataclass(frozen=True)
class Relaxed:
    """Result of a relaxation.

    Attributes
    ----------
    curve : SurfaceCurve
        The relaxed curve, which is simple.
    discrete_curve : DiscreteCurve
        The same curve with its nodes.
    bending : float
        ∮ (κ_g² + w κ_n²) ds, in 1/length, with the weight w of the normal curvature.
    feature : float
        ∮ φ_fea² ds, in units of length.
    iterations : int
        Number of iterations of all attempts.
    status : Status
        `CONVERGED`, `ITERATION_LIMIT` or `CANCELLED`; `UNRELAXED` if strands of the start are too
        close together to place nodes on it without contact. The curve is then the start itself.
    work : float
        Number of moves of all nodes in all attempts, a measure of the duration.
    collided : bool
        Whether the curve crossed itself after an attempt with deferred tracing.
    """

    curve: SurfaceCurve
    discrete_curve: DiscreteCurve
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
    start: SurfaceCurve | DiscreteCurve,
    smoothness: float,
    config: RelaxationConfig,
    watch: Watch | None = None,
    movable: Movable | None = None,
    corners: BoolArray | None = None,
) -> Relaxed:
    """Relax a curve.

    Parameters
    ----------
    surface : CurveSurface
    start : SurfaceCurve or DiscreteCurve
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
    corners : (k,) bool array, optional
        Control points of a SurfaceCurve at which the curve may turn freely.

    Returns
    -------
    Relaxed
        The start itself, with the status `UNRELAXED`, if no simple relaxed curve was found.
    """
    task = _Task(surface, smoothness, config, watch, movable)
    if isinstance(start, SurfaceCurve):
        first = place_nodes(surface, start, config.levels[0], corners)
        return _relaxed(task, config.levels, first, start)
    if len(config.levels) == 1 or scaled_bending(start) >= config.fine_below:
        return _relaxed(task, config.levels, start)
    fine = _relaxed(task, config.levels[-1:], start)
    stopped = fine.status is Status.CANCELLED or fine.iterations >= config.most_iterations
    before, after = energies_of(surface, [start, fine.discrete_curve], smoothness)
    good = after <= before or scaled_bending(fine.discrete_curve) <= ACCEPTABLE
    if stopped or (good and fine.status is not Status.UNRELAXED):
        return fine
    again = _relaxed(task, config.levels, start)
    one, other = energies_of(surface, [fine.discrete_curve, again.discrete_curve], smoothness)
    if other < one:
        return again
    status = Status.CANCELLED if again.status is Status.CANCELLED else fine.status
    return replace(fine, iterations=again.iterations, work=again.work, status=status)


@dataclass
class _Task:
    """The arguments of `relax`, with the iterations and the work of all attempts so far."""

    surface: CurveSurface
    smoothness: float
    config: RelaxationConfig
    watch: Watch | None
    movable: Movable | None
    iterations: int = 0
    work: float = 0.0

    def mask(self, relaxation: CurveRelaxation) -> BoolArray | None:
        """Which of the present nodes may move, (n,); None for all."""
        return None if self.movable is None else self.movable(relaxation.positions)


def _relaxed(
    task: _Task,
    levels: tuple[int, ...],
    first: DiscreteCurve,
    start: SurfaceCurve | None = None,
) -> Relaxed:
    """Relax on some levels, at first without tracing the curve if that may be deferred.

    If that fails, the result is `start`, by default `first` itself.
    """
    most_work, collided = task.config.work - task.work, False
    for is_traced in (False, True) if task.config.defer_tracing else (True,):
        curve, status = _attempt(task, levels, first, is_traced, most_work)
        good = curve is not None and is_simple(task.surface, curve)
        if good or status is Status.CANCELLED:
            break
        collided = not is_traced
    if curve is not None and good:
        result = without_short_segments(task.surface.mesh, curve)
    else:
        curve = first
        result = first.surface_curve(task.surface.mesh) if start is None else start
        status = Status.CANCELLED if status is Status.CANCELLED else Status.UNRELAXED
    return replace(
        unrelaxed(task.surface, curve, status),
        curve=result,
        iterations=task.iterations,
        work=task.work,
        collided=collided,
    )


def unrelaxed(surface: CurveSurface, curve: DiscreteCurve, status: Status) -> Relaxed:
    """A simple curve as the result of no iterations."""
    bending = bending_energy(curve.nodes, surface.normal_bending)
    return Relaxed(
        curve.surface_curve(surface.mesh),
        curve,
        bending,
        feature_energy(curve.nodes),
        0,
        status,
        0.0,
    )


def _attempt(
    task: _Task, levels: tuple[int, ...], first: DiscreteCurve, is_traced: bool, most_work: float
) -> tuple[DiscreteCurve | None, Status]:
    """Relax a curve level by level; no curve if it cannot be traced."""
    config, surface = task.config, task.surface
    state = LevelState(
        iterations=task.iterations,
        most_iterations=min(task.iterations + config.iterations, config.most_iterations),
        work=task.work,
        most_work=task.work + most_work,
    )
    passes = [(count, 1.0) for count in levels]
    if config.tension_factor > 1.0:
        passes.insert(0, (levels[0], config.tension_factor))
    traced, status = first.for_kernels, Status.CONVERGED
    relaxation = CurveRelaxation(surface.for_kernels, traced)
    try:
        for number, (count, tautness) in enumerate(passes):
            is_last = number == len(passes) - 1
            least = config.least_decrease if is_last else config.least_decrease_before
            rules = relaxation_rules(
                surface,
                task.smoothness,
                count,
                config.longest_move,
                contact=is_traced,
                tautness=tautness,
                steps=config.steps,
                single=True,
            )
            level = level_rules(surface, count, config.spacing_ratio, least, is_traced)
            relaxation.begin_level(rules, level)
            traced = relaxation.arrays
            status = _relax_on_level(task, relaxation, rules, level, state)
            is_lost = state.outcome == LevelOutcome.LOST
            if is_lost or not (is_traced or relaxation.trace(rules, level)):
                return None, status
            if status is not Status.CONVERGED:
                break
            if is_last and state.outcome == LevelOutcome.STALLED:
                status = Status.ITERATION_LIMIT
    except CancelledError:
        last = relaxation.arrays if is_traced else traced
        return curve_from_kernels(surface, last), Status.CANCELLED
    return curve_from_kernels(surface, relaxation.arrays), status


def level_rules(
    surface: CurveSurface,
    count: int,
    spacing_ratio: float,
    least_decrease: float,
    is_traced: bool,
) -> LevelRules:
    """The rules of a level with about `count` nodes; see `RelaxationConfig` for the others."""
    detour, fold_margin, _ = step_limits(surface)
    return LevelRules(
        placement_rules(surface),
        detour,
        fold_margin,
        TOUCHING,
        spacing_ratio,
        least_decrease,
        count,
        is_traced,
    )


def _relax_on_level(
    task: _Task,
    relaxation: CurveRelaxation,
    rules: RelaxationRules,
    level: LevelRules,
    state: LevelState,
) -> Status:
    """Iterate with a fixed number of nodes until the energy has converged."""
    state.outcome, state.releases, state.stalled = LevelOutcome.GOES_ON, 0, 0
    state.damping, state.least_energy = rules.steps.least_damping, math.inf
    while state.outcome == LevelOutcome.GOES_ON:
        checkpoint()
        relaxation.iterate(rules, level, task.mask(relaxation), state)
        task.iterations, task.work = state.iterations, state.work
        left = (state.most_iterations - state.iterations) / task.config.iterations
        if (
            state.has_moved
            and task.watch is not None
            and not task.watch(1.0 - left, relaxation.positions)
        ):
            return Status.CANCELLED
    if state.outcome == LevelOutcome.LIMITED:
        return Status.ITERATION_LIMIT
    return Status.CONVERGED
