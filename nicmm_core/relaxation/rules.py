"""The rules of relaxation: the balance of its energy, contacts of strands, lengths of steps."""

from __future__ import annotations

import nicmm_kernels

from ..geometry import tolerances, tracing
from .curve_nodes import CurveSurface
from .elastic_energy import OVER_TENSION
from .even_nodes import SPACING

CLEARANCE = 2.0
"""Distance between strands, in mean distances between nodes, below which they repel."""

DIFFERENT_STRANDS = 4.0
"""Distance along the curve, in clearances, above which two nodes belong to different strands."""

SAME_SIDE = 0.3
"""Cosine between the normals of two nodes above which they may be in contact.

It excludes strands on opposite sides of a thin part.
"""

NEARBY = 2.0
"""Distance, in clearances, within which pairs of nodes are kept for contacts after short moves."""

CONTACT = 10.0
"""Contact energy of a curve whose strands touch everywhere, relative to its energy without maps."""

DAMPING = 1e-6
"""Least damping with `DAMPING_NODES` nodes, relative to the greatest diagonal entry of the matrix.

That entry is the stiffness against a zigzag from node to node. The stiffness against moves of the
whole curve is far smaller, and the more nodes there are, the smaller it is. So damping is far below
1 and falls with the cube of the number of nodes.
"""

DAMPING_NODES = 128

MOST_DAMPING = 1e2
"""Damping above which the search for a step ends."""

DAMPING_FACTOR = 10.0
"""Factor by which damping rises after a failed step and falls after a successful one."""

UNTIL_MOST_DAMPING = 64
"""A number of trial steps that damping does not reach."""


def relaxation_rules(
    surface: CurveSurface,
    smoothness: float,
    count: int,
    longest_move: float,
    contact: bool,
    tautness: float = 1.0,
    steps: int = 1,
    single: bool = False,
) -> nicmm_kernels.RelaxationRules:
    """Rules of the relaxation of curves.

    Parameters
    ----------
    surface : CurveSurface
    smoothness : float
        Divisor of the tension and of the weight of a map.
    count : int
        Number of nodes of a curve.
    longest_move : float
        Trust radius of the linearised energy, in mean distances between neighbouring nodes.
    contact : bool
        Whether strands are kept apart.
    tautness : float, default 1
        Additional factor of the tension only.
    steps : int, default 1
        Greatest number of steps in an iteration.
    single : bool, default False
        Whether an iteration tries steps until one lowers the energy, and doubles it if the energy
        falls far. A batch of curves is relaxed with one trial step in an iteration.
    """
    return nicmm_kernels.RelaxationRules(
        tracing.LIMITS,
        contact_rules(NEARBY if single else 1.0),
        SPACING,
        nicmm_kernels.EnergyRules(smoothness, tautness, OVER_TENSION, CONTACT if contact else 0.0),
        nicmm_kernels.StepRules(
            steps,
            UNTIL_MOST_DAMPING if single else 1,
            single,
            longest_move,
            least_damping(count),
            MOST_DAMPING,
            DAMPING_FACTOR,
            tolerances.SAME_POSITION * surface.mesh.diagonal,
        ),
    )


def contact_rules(nearby: float) -> nicmm_kernels.ContactRules:
    """When nodes are in contact; `nearby` is explained there."""
    return nicmm_kernels.ContactRules(
        CLEARANCE, DIFFERENT_STRANDS, SAME_SIDE, tolerances.ROUNDED, nearby
    )


def least_damping(count: int) -> float:
    """Damping of the first step for a number of nodes, and its lower bound afterwards."""
    return DAMPING * (DAMPING_NODES / count) ** 3
