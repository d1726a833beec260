"""Places new nodes on several curves, evenly spaced between fixed nodes.

Nodes are closer together where the normals turn, as around the edge of a thin part.
"""

from __future__ import annotations

import nicmm_kernels
import numpy as np

from ..geometry.array_types import BoolArray, FloatArray, IntArray
from ..geometry.surface_points import SurfacePoints
from .curve_nodes import CurveSurface, Nodes, nodes_at
from .node_traces import NodeTraces, places_along, traces_between_nodes

NODES_PER_RADIAN = 1.0
"""Additional nodes per radian by which the normals turn."""

SHORT_MOVE = 1e-3
"""Move, in mean distances between nodes, below which a node stays when nodes are respaced."""

SPACING = nicmm_kernels.SpacingRules(NODES_PER_RADIAN, SHORT_MOVE)

LENGTH_WITHOUT_TRACE = 2.0
"""Assumed length of a step whose trace fails, relative to the distance between its nodes.

The trace fails around a thin part, where the way over the surface is longer.
"""


def resampled(
    surface: CurveSurface, nodes: Nodes, fixed: BoolArray, times: int
) -> tuple[Nodes, IntArray]:
    """Place new nodes, evenly spaced along the traces between the nodes.

    Around the edge of a thin part, a trace may be several times as long as the distance of its
    nodes, and gets as many more of the new nodes.

    Parameters
    ----------
    surface : CurveSurface
    nodes : Nodes
        c curves with n / c nodes each.
    fixed : (n,) bool array
        Which nodes stay. The first node of each curve is one of them, and the last one of each open
        curve.
    times : int
        Factor of the number of steps of each leg.

    Returns
    -------
    Nodes
        c curves with m nodes altogether.
    (m,) int array
        Index of the former node where a node was fixed, -1 elsewhere.
    """
    traces = traces_between_nodes(surface, nodes)
    node, share = _even_places(surface, nodes, traces, fixed, times)
    size = nodes.per_curve
    former = np.full((nodes.curves, len(node) // nodes.curves), -1)
    former[:, ::times] = np.where(fixed, np.arange(len(fixed)), -1).reshape(nodes.curves, size)
    former = former.ravel()
    stays, moves = np.flatnonzero(former >= 0), np.flatnonzero(former < 0)
    faces, barycentric = np.zeros(len(former), dtype=np.int64), np.zeros((len(former), 3))
    kept = nodes.places[former[stays]]
    faces[stays], barycentric[stays] = kept.faces, kept.barycentric
    new = places_along(surface, nodes, traces, node[moves], share[moves])
    faces[moves], barycentric[moves] = new.faces, new.barycentric
    places = SurfacePoints(faces, barycentric)
    corners = None
    if nodes.corners is not None:
        corners = (former >= 0) & nodes.corners[former]
    return nodes_at(surface, places, nodes.closed, nodes.curves, corners), former


def _even_places(
    surface: CurveSurface, nodes: Nodes, traces: NodeTraces, fixed: BoolArray, times: int
) -> tuple[IntArray, FloatArray]:
    """Where m new nodes lie: the node before each, (m,), and its share of the trace from there."""
    if surface.folded is not None:
        # Inside a fold a trace runs backward, and nodes spaced along it would change places.
        faces = traces.points.faces
        folded = np.bincount(traces.node[surface.folded[faces]], minlength=len(fixed)) > 0
        fixed = fixed | folded | nodes.before_each(folded)
    length = traces.lengths
    length = np.where(length > 0.0, length, LENGTH_WITHOUT_TRACE * nodes.step_lengths)
    at, share = nicmm_kernels.even_places(
        np.ascontiguousarray(nodes.normals).reshape(nodes.curves, -1, 3),
        nodes.by_curve(nodes.step_lengths),
        nodes.by_curve(length),
        nodes.by_curve(fixed),
        nodes.closed,
        times,
        SPACING,
    )
    return (nodes.first[:, None] + at).ravel(), share.ravel()
