"""Levenberg–Marquardt steps of the nodes of a curve: moves along conormals that lower its energy.

The energy is linearised about the nodes (`elastic_energy`), and the least damped step that lowers
the energy itself is taken. Nothing is traced between the nodes here: `relaxing` does that after a
few steps.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..geometry.array_types import BoolArray, FloatArray
from .curve_nodes import CurveSurface, Nodes
from .elastic_energy import (
    Balance,
    ElasticSystem,
    damped_step,
    elastic_energy,
    elastic_system,
    predicted_fall,
)
from .noded_curve import moved_along_conormals

DAMPING_NODES = 128
"""Number of nodes that the damping is given for."""

DAMPING_FACTOR = 10.0
"""By which damping rises when a step does not lower the energy, and falls when one does."""

WORTHWHILE = 0.05
"""Share of the fall so far that another step of the same iteration has to promise."""

FACES_OF_A_MOVE = 16.0
"""Faces that nodes pass one after the other in the time that the rest of a move takes."""

TWICE = 4.0 / 3.0
"""Fall of the energy, relative to half its slope along a step, from which twice of it may pay."""


@dataclass(frozen=True)
class StepConfig:
    """How steps are taken; lengths are in mean steps from node to node.

    Attributes
    ----------
    steps : int
        Most in an iteration.
    longest_move : float
        Farthest that the linearised energy is trusted; the curve may move twice as far if that is
        seen to lower the energy further. Longer moves between one tracing and the next fold the
        curve where it bends.
    damping : float
        At the start of a level of `DAMPING_NODES`, relative to the greatest diagonal entry. Far
        below 1, because that measures the stiffness of a zigzag from node to node, against which a
        slow swing of the whole curve has almost none: the more nodes, the less, by the third power.
    most_damping : float
        Where the search for a step ends.
    """

    steps: int = 8
    longest_move: float = 2.0
    damping: float = 1e-6
    most_damping: float = 1e2

    def least_damping(self, n_nodes: int) -> float:
        """The damping of a first step."""
        return self.damping * (DAMPING_NODES / n_nodes) ** 3


@dataclass
class Work:
    """Moves of all nodes, taken or only tried, and how many there may be.

    Where a surface is so defective that few steps lower the energy, an iteration takes many moves;
    a move over many faces counts as several.
    """

    most: float
    spent: float = 0.0

    def exhausted(self) -> bool:
        """Whether no more moves may be tried."""
        return self.spent >= self.most


@dataclass(frozen=True)
class Stepping:
    """What steps of one iteration have in common: the surface, the weights and the bounds."""

    surface: CurveSurface
    weights: Balance
    config: StepConfig
    work: Work


@dataclass(frozen=True)
class Linearised:
    """Nodes with their energy and its linearisation."""

    nodes: Nodes
    energy: float
    system: ElasticSystem

    def may_fall(self, free: BoolArray, config: StepConfig) -> float:
        """By how much the least damped step of the free nodes, (n,), would lower the energy."""
        if not free.any():
            return 0.0
        damping = config.least_damping(len(free))
        return predicted_fall(self.system, damped_step(self.system, free, damping))


@dataclass(frozen=True)
class Moved:
    """Nodes after one or more steps, each of which lowered the energy."""

    nodes: Nodes
    energy: float
    stayed: BoolArray  # (n,) nodes that came to a boundary
    damping: float  # of the first step
    farthest: float  # move, in mean steps from node to node


def linearised(surface: CurveSurface, nodes: Nodes, weights: Balance) -> Linearised:
    """The energy of nodes, and its linearisation about them."""
    energy = elastic_energy(nodes, weights)
    return Linearised(nodes, energy, elastic_system(surface, nodes, weights))


def take_steps(
    stepping: Stepping, start: Linearised, free: BoolArray, damping: float
) -> Moved | None:
    """As many steps as are worthwhile.

    Parameters
    ----------
    stepping : Stepping
    start : Linearised
    free : (n,) bool array
        Nodes that may move.
    damping : float
        Of the first step that is tried.

    Returns
    -------
    Moved or None
        None when not even one lowers the energy.
    """
    moved = _first_step(stepping, start, free, damping)
    if moved is None:
        return None
    damping = less_damping(moved, stepping.config)
    for _ in range(stepping.config.steps - 1):
        least = WORTHWHILE * (start.energy - moved.energy)
        further = _further_step(stepping, moved, free, damping, least)
        if further is None:
            break
        moved = further
    return moved


def less_damping(moved: Moved, config: StepConfig) -> float:
    """The damping to go on with after a step that lowered the energy."""
    return max(moved.damping / DAMPING_FACTOR, config.least_damping(len(moved.stayed)))


def _first_step(
    stepping: Stepping, start: Linearised, free: BoolArray, damping: float
) -> Moved | None:
    """The least damped step that lowers the energy; None when there is none."""
    nodes, weights = start.nodes, stepping.weights
    while damping <= stepping.config.most_damping and free.any() and not stepping.work.exhausted():
        move = damped_step(start.system, free, damping)
        if not np.isfinite(move).all():
            return None
        move, farthest = _trusted(nodes, move, stepping.config)
        moved, stayed = _moved(stepping, nodes, move)
        reached = elastic_energy(moved, weights)
        # Gauss-Newton's matrix is too stiff where the curve bends a lot. The parabola through
        # both energies with the slope here is lower at twice the step after such a fall.
        fallen = start.energy - reached
        if fallen > 0.0 and fallen > -TWICE * float(start.system.slope @ move):
            farther, also_stayed = _moved(stepping, nodes, 2.0 * move)
            reached_there = elastic_energy(farther, weights)
            if reached_there < reached:
                return Moved(farther, reached_there, also_stayed, damping, 2.0 * farthest)
        if fallen > 0.0:
            return Moved(moved, reached, stayed, damping, farthest)
        damping *= DAMPING_FACTOR
    return None


def _further_step(
    stepping: Stepping, moved: Moved, free: BoolArray, damping: float, least: float
) -> Moved | None:
    """A step, or half of it, that lowers the energy; None when it promises less than that."""
    nodes, free = moved.nodes, free & ~moved.stayed
    if not free.any() or stepping.work.exhausted():
        return None
    system = elastic_system(stepping.surface, nodes, stepping.weights)
    move = damped_step(system, free, damping)
    if not np.isfinite(move).all() or predicted_fall(system, move) <= least:
        return None
    move, farthest = _trusted(nodes, move, stepping.config)
    for share in (1.0, 0.5):
        reached, stayed = _moved(stepping, nodes, share * move)
        energy = elastic_energy(reached, stepping.weights)
        if energy < moved.energy:
            stayed = moved.stayed | stayed
            farthest = moved.farthest + share * farthest
            return Moved(reached, energy, stayed, moved.damping, farthest)
    return None


def _moved(stepping: Stepping, nodes: Nodes, step: FloatArray) -> tuple[Nodes, BoolArray]:
    """Nodes moved across the curve, and which came to a boundary."""
    moved, stayed, passed = moved_along_conormals(stepping.surface, nodes, step)
    stepping.work.spent += 1.0 + passed / FACES_OF_A_MOVE
    return moved, stayed


def _trusted(nodes: Nodes, move: FloatArray, config: StepConfig) -> tuple[FloatArray, float]:
    """A move no longer than the linearised energy is trusted, and its length in mean steps."""
    farthest = float(np.abs(move).max()) / float(nodes.lengths.mean())
    if farthest > config.longest_move:
        return move * (config.longest_move / farthest), config.longest_move
    return move, farthest
