"""Bring a curve on the surface to rest: Levenberg–Marquardt steps on its own energy.

A level set is as fine as its mesh, and two strands of it a few edges apart hold each other. What it
settles is where the curve runs. From there nodes move on the surface until the energy of Eq. 6
and 7, taken along the curve, rests (`elastic_energy`).

Few nodes move far in a step, many draw finely; so the number of nodes rises by levels. On the way
the curve may pass through itself, which only its end must not: strands often have to swap. When
they do not part again, the relaxation is done once more with strands that keep apart, where every
state in between is a simple curve (`exact_curve`). The same goes for nodes that are too far
apart for a thin limb, so that no straight way over the surface joins them: a level with more nodes
takes over from the start.
"""

from __future__ import annotations

import enum
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from .array_types import BoolArray
from .curve import SurfaceCurve
from .curve_nodes import CurveSurface, Nodes
from .elastic_energy import (
    Balance,
    balance,
    bending_energy,
    damped_step,
    elastic_energy,
    elastic_system,
    feature_energy,
)
from .exact_curve import ExactCurve, drawn, exact_curve, is_simple, redrawn, respaced, sideways


@dataclass(frozen=True)
class RelaxationConfig:
    """How the iteration runs; lengths are in mean steps from node to node.

    Attributes
    ----------
    levels : tuple of int
        Numbers of nodes, rising.
    longest_move : float
        Farthest that a node moves at once.
    damping : float
        At the start of a level, relative to the greatest diagonal entry. Far below 1, because that
        measures the stiffness of a zigzag from node to node, against which a slow swing of the
        whole curve has almost none.
    most_damping : float
        Where the search for a step ends.
    least_decrease : float
        Relative decrease of the energy that ends the last level,
    least_decrease_before : float
        and those before.
    stretch : float
        Ratio of the longest to the shortest step at which nodes are spaced anew.
    iterations : int
        The cap, over all levels of one attempt.
    """

    levels: tuple[int, ...] = (64, 128, 256, 512)
    longest_move: float = 4.0
    damping: float = 1e-8
    most_damping: float = 1e2
    least_decrease: float = 1e-4
    least_decrease_before: float = 1e-2
    stretch: float = 1.6
    iterations: int = 100


DAMPING_FACTOR = 10.0
"""By which damping rises when a step does not lower the energy, and falls when one does."""

HELD_TRIES = 3
"""Steps that are tried without the nodes that could not follow the one before."""

SMALL_MOVE = 0.1
"""Moves that do not disturb the spacing, in mean steps."""


@dataclass(frozen=True)
class Relaxed:
    """Where a relaxation ended.

    Attributes
    ----------
    curve : SurfaceCurve
        Simple.
    bending : float
        ∮ κ_g² ds, in 1/length.
    feature : float
        ∮ φ_fea² ds, in units of length.
    iterations : int
        Of all attempts.
    stopped : str
        "converged", "cap" or "cancelled".
    """

    curve: SurfaceCurve
    bending: float
    feature: float
    iterations: int
    stopped: str


Watch = Callable[[float, ExactCurve], bool]


def relax(
    surface: CurveSurface,
    start: SurfaceCurve,
    smoothness: float,
    config: RelaxationConfig,
    watch: Watch | None = None,
) -> Relaxed:
    """Let a curve come to rest.

    Parameters
    ----------
    surface : CurveSurface
    start : SurfaceCurve
        Simple, and through its control points in order.
    smoothness : float
        Divides the tension.
    config : RelaxationConfig
    watch : callable, optional
        Called with the fraction of the cap that is done and the curve after every iteration;
        relaxation stops when it returns False.
    """
    relaxation = _Relaxation(surface, smoothness, config, watch)
    first = exact_curve(surface, start, config.levels[0])
    curve = None
    for place in range(len(config.levels)):
        levels = config.levels[place:]
        curve = relaxation.run(first, levels, _Drawing.HOLD if len(levels) == 1 else _Drawing.END)
        if curve is not None:
            break
    assert curve is not None  # the last attempt does not end early
    if not is_simple(surface, curve) and relaxation.stopped != "cancelled":
        # Strands that cross here would do so with more nodes too.
        curve = relaxation.run(first, config.levels[1:] or config.levels, _Drawing.SIMPLE)
    if curve is None or not is_simple(surface, curve):
        curve = first  # cancelled on the way
    return Relaxed(
        curve.surface_curve(surface.mesh),
        bending_energy(curve.nodes),
        feature_energy(curve.nodes),
        relaxation.iterations,
        relaxation.stopped,
    )


class _Drawing(enum.Enum):
    """What happens where the curve cannot be drawn through nodes that have moved."""

    END = "the attempt ends"
    HOLD = "those nodes stay"
    SIMPLE = "those nodes stay, and so do nodes whose strands would cross"


@dataclass(frozen=True)
class _Step:
    """A step that lowered the energy."""

    curve: ExactCurve
    held: BoolArray  # (n,) nodes that could not follow
    damping: float  # for the next step
    farthest: float  # move, in mean steps


class _LostError(Exception):
    """The curve cannot be drawn with so few nodes."""


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
        self.iterations, self.stopped = 0, "converged"

    def run(
        self, curve: ExactCurve, levels: tuple[int, ...], drawing: _Drawing
    ) -> ExactCurve | None:
        """Bring a curve to rest level by level; None where the attempt ended early."""
        last_iteration = self.iterations + self.config.iterations
        self.stopped = "converged"
        try:
            for level in levels:
                least = self.config.least_decrease_before
                if level == levels[-1]:
                    least = self.config.least_decrease
                curve = self._level(curve, level, least, last_iteration, drawing)
                if self.stopped != "converged":
                    break
        except _LostError:
            return None
        return curve

    def _level(
        self,
        curve: ExactCurve,
        level: int,
        least: float,
        last_iteration: int,
        drawing: _Drawing,
    ) -> ExactCurve:
        """Steps with one number of nodes until the energy falls by less than the least share."""
        config, damping = self.config, self.config.damping
        curve = respaced(self.surface, curve, level)
        held = np.zeros(len(curve.nodes.positions), dtype=bool)
        released = False
        while self.iterations < last_iteration:
            self.iterations += 1
            weights = balance(
                self.surface, curve.nodes, self.smoothness, drawing is _Drawing.SIMPLE
            )
            before = elastic_energy(curve.nodes, weights)
            step = self._step(curve, held, weights, damping, drawing)
            if step is not None:
                curve, damping, held = step.curve, step.damping, held | step.held
                if self.watch is not None:
                    done = self.iterations / max(last_iteration, self.iterations)
                    if not self.watch(done, curve):
                        self.stopped = "cancelled"
                        return curve
            if step is not None and elastic_energy(curve.nodes, weights) < (1.0 - least) * before:
                released = False
            elif released or not held.any():
                return curve
            else:
                # At rest with nodes that once could not follow: perhaps they can now.
                released, damping = True, config.damping
                held = np.zeros(len(held), dtype=bool)
            lengths = curve.nodes.lengths
            moved = step is not None and step.farthest > SMALL_MOVE
            if moved and lengths.max() > config.stretch * lengths.min():
                curve = respaced(self.surface, curve, level)
                held = np.zeros(len(curve.nodes.positions), dtype=bool)
        self.stopped = "cap"
        return curve

    def _step(
        self,
        curve: ExactCurve,
        held: BoolArray,
        weights: Balance,
        damping: float,
        drawing: _Drawing,
    ) -> _Step | None:
        """The least damped step that lowers the energy; None when there is none."""
        config, surface, nodes = self.config, self.surface, curve.nodes
        energy = elastic_energy(nodes, weights)
        system = elastic_system(surface, nodes, weights)
        spacing = float(nodes.lengths.mean())
        free = ~held
        free[curve.control_nodes] = False
        tries = 0
        while damping <= config.most_damping and free.any():
            move = damped_step(system, free, damping)
            farthest = float(np.abs(move).max()) / spacing
            if not np.isfinite(farthest):
                return None
            if farthest > config.longest_move:
                move *= config.longest_move / farthest
            moved, stayed = sideways(surface, nodes, move)
            lowered = elastic_energy(moved, weights) < energy
            if lowered:
                changed, kept = self._drawn(curve, moved, drawing)
                if kept.any() and tries < HELD_TRIES:
                    free &= ~kept
                    tries += 1
                    continue
                stayed |= kept
                lowered = not kept.any() or elastic_energy(changed.nodes, weights) < energy
            if lowered:
                damping = max(damping / DAMPING_FACTOR, config.damping)
                return _Step(changed, stayed, damping, min(farthest, config.longest_move))
            damping *= DAMPING_FACTOR
        return None

    def _drawn(
        self, curve: ExactCurve, nodes: Nodes, drawing: _Drawing
    ) -> tuple[ExactCurve, BoolArray]:
        if drawing is not _Drawing.END:
            return redrawn(self.surface, curve, nodes, drawing is _Drawing.SIMPLE)
        changed = drawn(self.surface, curve, nodes)
        if changed is None:
            raise _LostError
        return changed, np.zeros(len(nodes.positions), dtype=bool)
