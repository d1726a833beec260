"""Removes self-crossings of a curve by joining its nodes in another order.

Where two strands cross twice, without a control point between the crossings, they exchange the
parts between them. A loop with at most one control point is traversed in the other direction. Both
moves keep all nodes and the order of the control points. If the control points may be visited in
any order, every other loop is reversed as well ("2-opt": Croes, "A method for solving
traveling-salesman problems", 1958).
"""

from __future__ import annotations

import nicmm_kernels
import numpy as np

from ..geometry.array_types import BoolArray, IntArray
from ..geometry.crossings import TOUCHING
from ..geometry.surface_points import SurfacePoints
from ..geometry.tracing import strictly_inside
from ..progress import checkpoint
from ..relaxation.curve_nodes import CurveSurface, Nodes, nodes_among
from ..relaxation.node_traces import step_limits

ROUNDS = 4
"""Rounds in which crossings are removed; steps between nodes in a new order may cross again."""

MOST_CROSSINGS = 200
"""Number of crossings of a curve above which the curve is left unchanged."""


def remove_crossings(
    surface: CurveSurface, nodes: Nodes, visit: IntArray, any_order: bool
) -> tuple[Nodes, IntArray, BoolArray]:
    """Remove crossings of curves by joining their nodes in another order.

    Parameters
    ----------
    surface : CurveSurface
    nodes : Nodes
        Curves that begin at a control point.
    visit : (n,) int array
        Index of the control point at each node, -1 where there is none.
    any_order : bool
        Whether control points may be visited in another order.

    Returns
    -------
    Nodes
        The nodes in their new order.
    (n,) int array
        Index of the control point at each of these nodes, -1 where there is none.
    (c,) bool array
        Which curves do not cross themselves. Steps whose trace fails are not tested.
    """
    checkpoint()
    order, simple = nicmm_kernels.remove_crossings(
        surface.for_kernels,
        nodes.for_kernels,
        SurfacePoints(nodes.places.faces, strictly_inside(nodes.places.barycentric)).for_kernels,
        step_limits(surface),
        nodes.by_curve(visit >= 0),
        nicmm_kernels.UncrossingRules(ROUNDS, MOST_CROSSINGS, any_order, TOUCHING),
        checkpoint,
    )
    if (order == np.arange(nodes.per_curve)).all():
        return nodes, visit, simple
    among = order + nodes.first[:, None]
    return nodes_among(nodes, among), visit[among.ravel()], simple
