"""Relax a curve on the surface by Levenberg–Marquardt steps on its own energy.

A level set is as fine as its mesh, and two strands of it a few edges apart block each other. It
decides where the curve runs. From there nodes move on the surface until the energy of Eq. 6 and 7,
taken along the curve, converges (`elastic_energy`).

Few nodes move far in a step, many resolve detail; so the number of nodes rises by levels. An
iteration is a few steps of the nodes, after which the curve is traced, and strands push each other:
a node whose segment could not be traced, or would cross another, stays for that iteration. So every
state in between is a simple curve.

A curve that has nearly converged, as one whose control point was dragged, may do without that: its
nodes move freely, and it is traced once they have converged. If it then crosses itself, it is
relaxed again from the start, simple throughout.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from ..geometry import tolerances
from ..geometry.array_types import BoolArray, FloatArray, IntArray
from ..geometry.curve import SurfaceCurve
from ..progress import CancelledError
from .curve_nodes import CurveSurface, Nodes
from .elastic_energy import (
    Balance,
    ElasticSystem,
    balance,
    bending_energy,
    damped_step,
    elastic_energy,
    elastic_system,
    feature_energy,
    predicted_fall,
)
from .noded_curve import (
    NodedCurve,
    drawn,
    is_simple,
    moved_along_conormals,
    noded_curve,
    redrawn,
    respaced,
    rounded,
    without_short_segments,
)


@dataclass(frozen=True)
class RelaxationConfig:
    """How the iteration runs; lengths are in mean steps from node to node.

    Attributes
    ----------
    levels : tuple of int
        Numbers of nodes, rising.
    steps : int
        Most in an iteration.
    longest_move : float
        Farthest that the linearised energy is trusted; the curve may move twice as far if that is
        seen to lower the energy further. Longer moves between one drawing and the next fold the
        curve where it bends.
    damping : float
        At the start of a level of 128 nodes, relative to the greatest diagonal entry. Far below 1,
        because that measures the stiffness of a zigzag from node to node, against which a slow
        swing of the whole curve has almost none: the more nodes, the less, by the third power.
    most_damping : float
        Where the search for a step ends.
    least_decrease : float
        Decrease of the energy, relative to the bending, that ends the last level,
    least_decrease_before : float
        and those before.
    stretch : float
        Ratio of the longest to the shortest step of a leg at which nodes are spaced anew.
    iterations : int
        The cap, over all levels of one attempt.
    work : float
        The same for moves of all nodes, taken or only tried; a move over many faces counts as
        several. Where a surface is so defective that few steps lower the energy, an iteration
        takes many of them.
    defer_tracing : bool
        Whether to try first without drawing the curve after every iteration.
    most_iterations : int
        The cap over all attempts.
    taut : float
        Factor of the tension in a pass with the fewest nodes before all others, which there is
        where this is above 1.
    """

    levels: tuple[int, ...] = (128, 512)
    steps: int = 8
    longest_move: float = 2.0
    damping: float = 1e-6
    most_damping: float = 1e2
    least_decrease: float = 2e-3
    least_decrease_before: float = 0.1
    stretch: float = 1.6
    iterations: int = 100
    work: float = 800.0
    defer_tracing: bool = False
    most_iterations: int = 200
    taut: float = 1.0


GUIDED = RelaxationConfig(levels=(64, 128, 512), least_decrease_before=1e-2, taut=30.0)
"""Where a map attracts: a lane has to be found while nodes are few, since many hardly move.

Few nodes take long steps along the surface until they converge. Such steps would inflate a fold of
the start to a bow from lane to lane, a local minimum far from the lowest energy; under 30 times the
tension, which a lane still withstands, folds are pulled straight.
"""

DAMPING_NODES = 128
"""Number of nodes that the damping is given for."""

DAMPING_FACTOR = 10.0
"""By which damping rises when a step does not lower the energy, and falls when one does."""

RELEASES = 2
"""Times in a level that nodes which could not follow are tried again after convergence."""

HELD_TRIES = 1
"""Times that an iteration is tried again without the nodes that could not follow."""

WORTHWHILE = 0.05
"""Share of the fall so far that another step of the same iteration has to promise."""

SURELY = 0.1
"""Share of the least decrease below which a step is not tried: damping makes forecasts small."""

MOST_STALLED = 4
"""Iterations in a row without a new least energy that end a level.

On folds and needles spacing the nodes anew may raise the energy by more than steps lower it.
"""

FACES_OF_A_MOVE = 16.0
"""Faces that nodes pass one after the other in the time that the rest of a move takes."""

STRAIGHT = 2e-3
"""Share of bending in the energy below which a curve is straight enough not to go on for it."""

TWICE = 4.0 / 3.0
"""Fall of the energy, relative to half its slope along a step, from which twice of it may pay."""

SMALL_MOVE = 0.1
"""Moves that do not disturb the spacing, in mean steps."""


@dataclass(frozen=True)
class Relaxed:
    """Where a relaxation ended.

    Attributes
    ----------
    curve : SurfaceCurve
        Simple.
    noded_curve : NodedCurve
        The same with its nodes.
    bending : float
        ∮ κ_g² ds, in 1/length.
    feature : float
        ∮ φ_fea² ds, in units of length.
    iterations : int
        Of all attempts.
    stopped : str
        "converged", "cap" or "cancelled"; "unrelaxed" where strands of the start are so close to
        one another that nodes on it would touch.
    collided : bool
        Whether the curve crossed itself where it was not traced after every iteration.
    """

    curve: SurfaceCurve
    noded_curve: NodedCurve
    bending: float
    feature: float
    iterations: int
    stopped: str
    collided: bool = False


Watch = Callable[[float, FloatArray], bool]


def relax(
    surface: CurveSurface,
    start: SurfaceCurve | NodedCurve,
    smoothness: float,
    config: RelaxationConfig,
    watch: Watch | None = None,
) -> Relaxed:
    """Relax a curve.

    Parameters
    ----------
    surface : CurveSurface
    start : SurfaceCurve or NodedCurve
        Simple, and through its control points in order.
    smoothness : float
        Divides the tension.
    config : RelaxationConfig
    watch : callable, optional
        Called with the fraction of an attempt's cap that is done and the nodes' positions, (n, 3),
        after every iteration; relaxation stops when it returns False. It also stops, with the
        curve as it was last drawn, where `progress` says so.
    """
    relaxation = _Relaxation(surface, smoothness, config, watch)
    if isinstance(start, NodedCurve):
        first, start = start, start.surface_curve(surface.mesh)
    else:
        first = noded_curve(surface, start, config.levels[0])
    relaxation.drawn = first
    collided = False
    try:
        for simple in (False, True) if config.defer_tracing else (True,):
            curve = relaxation.run(first, simple)
            if relaxation.stopped == "cancelled" or _is_simple(surface, curve):
                break
            collided = not simple
    except CancelledError:
        curve, relaxation.stopped = relaxation.drawn, "cancelled"
    if curve is not None and _is_simple(surface, curve):
        result, stopped = without_short_segments(surface.mesh, curve), relaxation.stopped
    else:
        curve, result = first, start
        stopped = "cancelled" if relaxation.stopped == "cancelled" else "unrelaxed"
    nodes = curve.nodes
    return Relaxed(
        result,
        curve,
        bending_energy(nodes),
        feature_energy(nodes),
        relaxation.iterations,
        stopped,
        collided,
    )


def _is_simple(surface: CurveSurface, curve: NodedCurve | None) -> bool:
    return curve is not None and is_simple(surface, curve)


def _unevenness(nodes: Nodes, control_nodes: IntArray) -> float:
    """Greatest ratio of the longest to the shortest step of one leg."""
    lengths = nodes.lengths
    first = control_nodes[control_nodes < len(lengths)]
    longest, shortest = np.maximum.reduceat(lengths, first), np.minimum.reduceat(lengths, first)
    return float((longest / np.maximum(shortest, tolerances.TINY)).max())


@dataclass(frozen=True)
class _State:
    """A curve between two iterations, with its energy linearised."""

    curve: NodedCurve  # as it was last drawn
    nodes: Nodes
    held: BoolArray  # (n,) nodes that could not follow
    weights: Balance
    energy: float
    system: ElasticSystem

    @property
    def free(self) -> BoolArray:
        """Nodes that may move, (n,)."""
        free = ~self.held
        free[self.curve.control_nodes] = False
        return free


@dataclass(frozen=True)
class _Moved:
    """Nodes after one or more steps, each of which lowered the energy."""

    nodes: Nodes
    energy: float
    stayed: BoolArray  # (n,) nodes that came to a boundary
    damping: float  # of the first step
    farthest: float  # move, in mean steps from node to node


@dataclass(frozen=True)
class _Iteration:
    """Steps that lowered the energy, drawn."""

    curve: NodedCurve  # as it was last drawn
    nodes: Nodes
    energy: float
    held: BoolArray  # (n,) nodes that could not follow
    damping: float  # for the next one
    farthest: float  # move, in mean steps from node to node


class _LostError(Exception):
    """The curve cannot be drawn through its nodes."""


class _Relaxation:
    """Attempts from one start; counts iterations and keeps the reason of the last stop."""

    def __init__(
        self,
        surface: CurveSurface,
        smoothness: float,
        config: RelaxationConfig,
        watch: Watch | None,
    ) -> None:
        self.surface, self.smoothness, self.config, self.watch = surface, smoothness, config, watch
        self.iterations, self.work, self.stopped = 0, 0.0, "converged"
        self.drawn: NodedCurve | None = None  # the last state, if it is stopped at once

    def run(self, curve: NodedCurve, simple: bool) -> NodedCurve | None:
        """Relax a curve level by level; None where it could not be traced."""
        config = self.config
        last_iteration = min(self.iterations + config.iterations, config.most_iterations)
        self.work, self.stopped = 0.0, "converged"
        passes = [(level, 1.0) for level in config.levels]
        if config.taut > 1.0:
            passes.insert(0, (config.levels[0], config.taut))
        try:
            for number, (level, taut) in enumerate(passes):
                last = number == len(passes) - 1
                least = config.least_decrease if last else config.least_decrease_before
                curve = self._level(curve, level, least, last_iteration, simple, taut)
                if self.stopped != "converged":
                    break
        except _LostError:
            return None
        return curve

    def _level(
        self,
        curve: NodedCurve,
        level: int,
        least: float,
        last_iteration: int,
        simple: bool,
        taut: float,
    ) -> NodedCurve:
        """Iterations with one number of nodes until the energy falls by less than a share."""
        config, least_damping = self.config, self._least_damping(level)
        damping = least_damping
        curve = self.drawn = self._respaced(curve, level, simple)
        nodes = curve.nodes
        held = np.zeros(len(nodes.positions), dtype=bool)
        releases = stalled = 0
        least_energy = np.inf
        while True:
            weights = balance(self.surface, nodes, self.smoothness, simple, taut)
            before = elastic_energy(nodes, weights)
            system = elastic_system(self.surface, nodes, weights)
            scale = max(bending_energy(nodes), STRAIGHT * before)
            state = _State(curve, nodes, held, weights, before, system)
            done = None
            if self._may_fall(state) > SURELY * least * scale:
                if self.iterations == last_iteration or self._worked_out():
                    self.stopped = "cap"
                    break
                self.iterations += 1
                done = self._iteration(state, damping, simple)
                if done is None and self._worked_out():
                    self.stopped = "cap"
                    break
            if done is not None:
                curve, nodes, damping, held = done.curve, done.nodes, done.damping, held | done.held
                self.drawn = curve
                share = 1.0 - (last_iteration - self.iterations) / config.iterations
                if self.watch is not None and not self.watch(share, nodes.positions):
                    self.stopped = "cancelled"
                    break
                scale = max(bending_energy(nodes), STRAIGHT * before)
                stalled = 0 if done.energy < least_energy else stalled + 1
                least_energy = min(least_energy, done.energy)
                if stalled == MOST_STALLED:
                    self.stopped = "cap" if level == config.levels[-1] else "converged"
                    break
            if done is None or before - done.energy <= least * scale:
                if releases == RELEASES or not held.any():
                    break
                # Converged with nodes that once could not follow: perhaps they can now.
                releases, damping = releases + 1, least_damping
                held = np.zeros(len(held), dtype=bool)
            moved = done is not None and done.farthest > SMALL_MOVE
            if moved and _unevenness(nodes, curve.control_nodes) > config.stretch:
                curve = self.drawn = self._respaced(self._drawn(curve, nodes), level, simple)
                nodes = curve.nodes
                held = np.zeros(len(nodes.positions), dtype=bool)
        return self._drawn(curve, nodes)

    def _least_damping(self, n_nodes: int) -> float:
        return self.config.damping * (DAMPING_NODES / n_nodes) ** 3

    def _may_fall(self, state: _State) -> float:
        """By how much the least damped step is going to lower the energy."""
        free = state.free
        if not free.any():
            return 0.0
        damping = self._least_damping(len(free))
        return predicted_fall(state.system, damped_step(state.system, free, damping))

    def _iteration(self, state: _State, damping: float, simple: bool) -> _Iteration | None:
        """Steps from a curve, drawn if it is to stay simple; None when none lowers the energy."""
        free = state.free
        tries = 0
        while True:
            moved = self._steps(state, free, damping)
            if moved is None:
                return None
            curve, nodes, energy, stayed = state.curve, moved.nodes, moved.energy, moved.stayed
            if simple:
                curve, kept = redrawn(self.surface, state.curve, nodes)
                if kept.any() and tries < HELD_TRIES:
                    free &= ~kept
                    tries += 1
                    continue
                nodes, stayed = curve.nodes, stayed | kept
                if kept.any():
                    energy = elastic_energy(nodes, state.weights)
            if energy < state.energy:
                return _Iteration(
                    curve, nodes, energy, stayed, self._less_damping(moved), moved.farthest
                )
            damping = moved.damping * DAMPING_FACTOR

    def _steps(self, state: _State, free: BoolArray, damping: float) -> _Moved | None:
        """As many steps as are worthwhile; None when not even one lowers the energy."""
        moved = self._first_step(state, free, damping)
        if moved is None:
            return None
        damping = self._less_damping(moved)
        for _ in range(self.config.steps - 1):
            least = WORTHWHILE * (state.energy - moved.energy)
            further = self._further_step(moved, free, state.weights, damping, least)
            if further is None:
                break
            moved = further
        return moved

    def _less_damping(self, moved: _Moved) -> float:
        """The damping to go on with after a step that lowered the energy."""
        return max(moved.damping / DAMPING_FACTOR, self._least_damping(len(moved.stayed)))

    def _first_step(self, state: _State, free: BoolArray, damping: float) -> _Moved | None:
        """The least damped step that lowers the energy; None when there is none."""
        nodes, weights = state.nodes, state.weights
        while damping <= self.config.most_damping and free.any() and not self._worked_out():
            move = damped_step(state.system, free, damping)
            if not np.isfinite(move).all():
                return None
            move, farthest = self._trusted(nodes, move)
            moved, stayed = self._moved(nodes, move)
            reached = elastic_energy(moved, weights)
            # Gauss-Newton's matrix is too stiff where the curve bends a lot. The parabola through
            # both energies with the slope here is lower at twice the step after such a fall.
            fallen = state.energy - reached
            if fallen > 0.0 and fallen > -TWICE * float(state.system.slope @ move):
                farther, also_stayed = self._moved(nodes, 2.0 * move)
                reached_there = elastic_energy(farther, weights)
                if reached_there < reached:
                    return _Moved(farther, reached_there, also_stayed, damping, 2.0 * farthest)
            if fallen > 0.0:
                return _Moved(moved, reached, stayed, damping, farthest)
            damping *= DAMPING_FACTOR
        return None

    def _further_step(
        self, moved: _Moved, free: BoolArray, weights: Balance, damping: float, least: float
    ) -> _Moved | None:
        """A step, or half of it, that lowers the energy; None when it promises less than that."""
        surface, nodes, free = self.surface, moved.nodes, free & ~moved.stayed
        if not free.any() or self._worked_out():
            return None
        system = elastic_system(surface, nodes, weights)
        move = damped_step(system, free, damping)
        if not np.isfinite(move).all() or predicted_fall(system, move) <= least:
            return None
        move, farthest = self._trusted(nodes, move)
        for share in (1.0, 0.5):
            reached, stayed = self._moved(nodes, share * move)
            energy = elastic_energy(reached, weights)
            if energy < moved.energy:
                stayed = moved.stayed | stayed
                farthest = moved.farthest + share * farthest
                return _Moved(reached, energy, stayed, moved.damping, farthest)
        return None

    def _worked_out(self) -> bool:
        """Whether an attempt has taken all the work that it may."""
        return self.work >= self.config.work

    def _moved(self, nodes: Nodes, step: FloatArray) -> tuple[Nodes, BoolArray]:
        """Nodes moved across the curve, and which came to a boundary."""
        moved, stayed, passed = moved_along_conormals(self.surface, nodes, step)
        self.work += 1.0 + passed / FACES_OF_A_MOVE
        return moved, stayed

    def _trusted(self, nodes: Nodes, move: FloatArray) -> tuple[FloatArray, float]:
        """A move no longer than the linearised energy is trusted, and its length in mean steps."""
        farthest = float(np.abs(move).max()) / float(nodes.lengths.mean())
        longest = self.config.longest_move
        if farthest > longest:
            return move * (longest / farthest), longest
        return move, farthest

    def _drawn(self, curve: NodedCurve, nodes: Nodes) -> NodedCurve:
        """The curve through its nodes, which may have moved since it was last drawn."""
        changed = curve if nodes is curve.nodes else drawn(self.surface, curve, nodes)
        if changed is None:
            raise _LostError
        return changed

    def _respaced(self, curve: NodedCurve, level: int, simple: bool) -> NodedCurve:
        """Nodes at about equal distances; where they would make strands touch, those it has."""
        alike = abs(len(curve.nodes.positions) - level) <= len(curve.control_nodes)
        if alike and _unevenness(curve.nodes, curve.control_nodes) <= self.config.stretch:
            return curve
        changed = respaced(self.surface, curve, level)
        if simple and not is_simple(self.surface, changed):
            return curve
        return changed if alike else self._rounded(curve, changed)

    def _rounded(self, coarse: NodedCurve, fine: NodedCurve) -> NodedCurve:
        """The fine nodes on a smooth curve through the coarse ones, if that bends less."""
        if len(fine.nodes.positions) < len(coarse.nodes.positions):
            return fine
        changed = rounded(self.surface, coarse, fine)
        less = bending_energy(changed.nodes) < bending_energy(fine.nodes)
        return changed if less else fine
