"""Relaxes several curves together, so that their energies can be compared.

Only nodes move; the curves are not traced between them. Each curve is relaxed on its own, with one
trial step in each iteration. It may cross itself, although the contact term resists it.
"""

from __future__ import annotations

from dataclasses import dataclass

import nicmm_kernels
import numpy as np

from ..geometry.array_types import BoolArray, IntArray
from ..geometry.surface_points import SurfacePoints
from ..progress import checkpoint
from .curve_nodes import CurveSurface, Nodes, nodes_among, nodes_at
from .rules import relaxation_rules


@dataclass(frozen=True)
class BatchConfig:
    """Settings. Lengths are in mean distances between neighbouring nodes.

    Attributes
    ----------
    iterations : int
        Greatest number of iterations, of one step each.
    longest_move : float
        Trust radius of the linearised energy.
    respacing : int
        Number of iterations from one respacing of the nodes to the next.
    least_decrease : float
        Relative decrease of the energy up to which an iteration counts as quiet, if no node has
        moved by more than half of `longest_move` either.
    quiet : int
        Number of consecutive quiet iterations after which a curve has converged.
    contact : bool
        Whether strands are kept apart.
    """

    iterations: int = 30
    longest_move: float = 1.0
    respacing: int = 3
    least_decrease: float = 1e-3
    quiet: int = 2
    contact: bool = True


def relax_batch(
    surface: CurveSurface,
    nodes: Nodes,
    fixed: BoolArray,
    smoothness: float,
    config: BatchConfig,
) -> Nodes:
    """Relax several curves without tracing them.

    Parameters
    ----------
    surface : CurveSurface
    nodes : Nodes
        c curves with n / c nodes each.
    fixed : (n,) bool array
        Which nodes must not move, such as control points. The first node of each curve must be
        fixed.
    smoothness : float
        Divisor of the tension and of the weight of a map.
    config : BatchConfig
    """
    size = nodes.per_curve
    rules = relaxation_rules(surface, smoothness, size, config.longest_move, config.contact)
    batch = nicmm_kernels.BatchRules(
        config.iterations, config.respacing, config.quiet, config.least_decrease
    )
    checkpoint()
    faces, barycentric = nodes.places.for_kernels
    faces, barycentric = nicmm_kernels.relax_curves(
        surface.for_kernels,
        faces.reshape(-1, size),
        barycentric.reshape(-1, size, 3),
        fixed.reshape(-1, size),
        None if nodes.corners is None else nodes.by_curve(nodes.corners),
        nodes.closed,
        rules,
        batch,
        checkpoint,
    )
    places = SurfacePoints(faces.ravel(), barycentric.reshape(-1, 3))
    return nodes_at(surface, places, nodes.closed, nodes.curves, nodes.corners)


def curves_of(nodes: Nodes, which: IntArray) -> Nodes:
    """Some of the curves, by their indices."""
    return nodes_among(nodes, which[:, None] * nodes.per_curve + np.arange(nodes.per_curve))
