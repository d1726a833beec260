"""Moves the nodes of a curve along conormals, by Levenberg–Marquardt steps that lower its energy.

The energy is linearised about the nodes (`elastic_energy`), and the least damped step that lowers
the energy itself is taken. Only nodes move here; `relaxing` traces the curve between them after
several steps.
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
    predicted_decrease,
)
from .noded_curve import moved_along_conormals
from .strand_contact import Contacts, NearStrands

DAMPING_NODES = 128
"""Number of nodes to which `StepConfig.damping` refers."""

DAMPING_FACTOR = 10.0
"""Factor by which damping rises after a failed step and falls after a successful one."""

WORTHWHILE = 0.05
"""Predicted decrease, relative to the decrease so far, above which another step is taken."""

FACES_OF_A_MOVE = 16.0
"""Number of faces that take as much time to cross as the rest of a move."""

DOUBLE_STEP_DECREASE = 4.0 / 3.0
"""Decrease of the energy above which a double step is tried.

It is relative to half the derivative of the energy along the step.
"""


@dataclass(frozen=True)
class StepConfig:
    """Settings of the steps. Lengths are in mean distances between neighbouring nodes.

    Attributes
    ----------
    steps : int
        Greatest number of steps in an iteration.
    longest_move : float
        Trust radius of the linearised energy. A move of twice this length is taken if it lowers the
        energy further. Longer moves between two traces would fold the curve where it bends.
    damping : float
        Damping at the start of a level of `DAMPING_NODES` nodes, relative to the greatest diagonal
        entry of the matrix. That entry is the stiffness against a zigzag from node to node. The
        stiffness against moves of the whole curve is far smaller, and the more nodes there are, the
        smaller it is. So damping is far below 1 and falls with the cube of the number of nodes.
    most_damping : float
        Damping above which the search for a step ends.
    """

    steps: int = 8
    longest_move: float = 2.0
    damping: float = 1e-6
    most_damping: float = 1e2

    def least_damping(self, n_nodes: int) -> float:
        """Damping of the first step for a number of nodes, and its lower bound afterwards."""
        return self.damping * (DAMPING_NODES / n_nodes) ** 3


@dataclass
class Work:
    """Number of moves of all nodes, whether taken or only tried, and a cap on it.

    On defective surfaces few trial steps lower the energy, so an iteration may try many moves. A
    move across many faces counts as several.
    """

    most: float
    spent: float = 0.0

    def exhausted(self) -> bool:
        """Whether no more moves may be tried."""
        return self.spent >= self.most


@dataclass(frozen=True)
class Stepping:
    """Data shared by the steps of one iteration.

    Attributes
    ----------
    surface : CurveSurface
    weights : Balance
    config : StepConfig
    work : Work
    strands : NearStrands or None
        Pairs of nodes that may be in contact; None if strands may cross.
    """

    surface: CurveSurface
    weights: Balance
    config: StepConfig
    work: Work
    strands: NearStrands | None = None

    def contacts(self, nodes: Nodes) -> Contacts | None:
        """Contacts between the nodes; None if strands may cross."""
        return None if self.strands is None else self.strands.contacts(nodes)

    def energy(self, nodes: Nodes) -> float:
        """Energy of the nodes, including contact."""
        return elastic_energy(nodes, self.weights, self.contacts(nodes))


@dataclass(frozen=True)
class Linearised:
    """Nodes with their energy and its linearisation."""

    nodes: Nodes
    energy: float
    system: ElasticSystem

    def predicted_decrease(self, free: BoolArray, config: StepConfig) -> float:
        """Predicted decrease of the energy by the least damped step of the free nodes, (n,)."""
        if not free.any():
            return 0.0
        damping = config.least_damping(len(free))
        return predicted_decrease(self.system, damped_step(self.system, free, damping))


@dataclass(frozen=True)
class Moved:
    """Nodes after one or more steps, each of which lowered the energy."""

    nodes: Nodes
    energy: float
    stayed: BoolArray  # (n,) which nodes reached a boundary
    damping: float  # of the first step
    farthest: float  # greatest length of a move, in mean distances between nodes


def linearised(stepping: Stepping, nodes: Nodes) -> Linearised:
    """Compute the energy of nodes and its linearisation about them."""
    surface, weights, contacts = stepping.surface, stepping.weights, stepping.contacts(nodes)
    energy = elastic_energy(nodes, weights, contacts)
    return Linearised(nodes, energy, elastic_system(surface, nodes, weights, contacts))


def take_steps(
    stepping: Stepping, start: Linearised, free: BoolArray, damping: float
) -> Moved | None:
    """Take steps as long as they are worthwhile.

    Parameters
    ----------
    stepping : Stepping
    start : Linearised
    free : (n,) bool array
        Which nodes may move.
    damping : float
        Damping of the first trial step.

    Returns
    -------
    Moved or None
        None if no step lowers the energy.
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
    """The damping after a step that lowered the energy."""
    return max(moved.damping / DAMPING_FACTOR, config.least_damping(len(moved.stayed)))


def _first_step(
    stepping: Stepping, start: Linearised, free: BoolArray, damping: float
) -> Moved | None:
    """The least damped step that lowers the energy; None if there is no such step."""
    nodes = start.nodes
    while damping <= stepping.config.most_damping and free.any() and not stepping.work.exhausted():
        move = damped_step(start.system, free, damping)
        if not np.isfinite(move).all():
            return None
        move, farthest = _trusted(nodes, move, stepping.config)
        moved, stayed = _moved(stepping, nodes, move)
        reached = stepping.energy(moved)
        # The Gauss–Newton matrix is too stiff where the curve bends strongly. If the energy falls
        # by more than this, the parabola through both energies, with the slope of the energy at the
        # start, is lower at twice the step.
        decrease = start.energy - reached
        if decrease > 0.0 and decrease > -DOUBLE_STEP_DECREASE * float(start.system.slope @ move):
            farther, also_stayed = _moved(stepping, nodes, 2.0 * move)
            reached_there = stepping.energy(farther)
            if reached_there < reached:
                return Moved(farther, reached_there, also_stayed, damping, 2.0 * farthest)
        if decrease > 0.0:
            return Moved(moved, reached, stayed, damping, farthest)
        damping *= DAMPING_FACTOR
    return None


def _further_step(
    stepping: Stepping, moved: Moved, free: BoolArray, damping: float, least: float
) -> Moved | None:
    """A step or half step that lowers the energy.

    None if neither does, or if the predicted decrease is not more than `least`.
    """
    nodes, free = moved.nodes, free & ~moved.stayed
    if not free.any() or stepping.work.exhausted():
        return None
    contacts = stepping.contacts(nodes)
    system = elastic_system(stepping.surface, nodes, stepping.weights, contacts)
    move = damped_step(system, free, damping)
    if not np.isfinite(move).all() or predicted_decrease(system, move) <= least:
        return None
    move, farthest = _trusted(nodes, move, stepping.config)
    for share in (1.0, 0.5):
        reached, stayed = _moved(stepping, nodes, share * move)
        energy = stepping.energy(reached)
        if energy < moved.energy:
            stayed = moved.stayed | stayed
            farthest = moved.farthest + share * farthest
            return Moved(reached, energy, stayed, moved.damping, farthest)
    return None


def _moved(stepping: Stepping, nodes: Nodes, step: FloatArray) -> tuple[Nodes, BoolArray]:
    """Nodes moved along conormals, and which of them reached a boundary."""
    moved, stayed, passed = moved_along_conormals(stepping.surface, nodes, step)
    stepping.work.spent += 1.0 + passed / FACES_OF_A_MOVE
    return moved, stayed


def _trusted(nodes: Nodes, move: FloatArray, config: StepConfig) -> tuple[FloatArray, float]:
    """A move limited to the trust radius, and its length in mean distances between nodes."""
    farthest = float(np.abs(move).max()) / float(nodes.lengths.mean())
    if farthest > config.longest_move:
        return move * (config.longest_move / farthest), config.longest_move
    return move, farthest
