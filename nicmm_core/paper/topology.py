"""Correct a solver's φ so that its zero set remains one simple curve.

A level set can split, merge and miss points (the paper's Fig. 16), and often does on thin limbs.
Flipping the sign of one vertex preserves the topology of the zero set exactly if the vertex is
simple, that is, if the signs around its link form one positive and one negative run. The start is a
field whose zero set is one simple curve through the control points. Each vertex that has another
sign in the solution is flipped as soon as it is simple. If all of these vertices can be flipped,
the zero set of the solution is isotopic to that of the start: one simple curve through the control
points in the same order. Around vertices that cannot be flipped, the solution is blended with the
start over a few edges.
"""

from __future__ import annotations

from collections import deque

import numpy as np
from scipy.sparse import csgraph

from ..geometry.array_types import FloatArray, IntArray
from ..path.virtual_splits import WorkingMesh
from ..progress import checkpoint
from .contour import signs_with_zeros
from .initial_loop import InitialLoop
from .sign_bundle import SignBundle
from .vertex_links import VertexLinks

FALLBACK_RADIUS = 4.0
"""Radius around a breaking vertex within which the start replaces the solution.

The unit is the mean edge length at the loop. At three times this radius the blend ends.
"""


def keep_topology(
    working: WorkingMesh,
    loop: InitialLoop,
    start: FloatArray,
    wanted: FloatArray,
    bundle: SignBundle | None = None,
) -> tuple[FloatArray, int]:
    """Follow a field as far as the zero set stays isotopic to that of the start.

    Parameters
    ----------
    working : WorkingMesh
    loop : InitialLoop
    start : (n,) float array
        Field whose zero set is one simple curve through the control vertices.
    wanted : (n,) float array
        Field to follow, in the same unit.
    bundle : SignBundle, optional
        Signs with which faces read the values of their corners.

    Returns
    -------
    (n,) float array
        ``wanted`` if it keeps the topology, otherwise a blend of both fields, or ``start`` if no
        blend keeps the topology.
    int
        Number of vertices whose sign in ``wanted`` breaks the topology; 0 if ``wanted`` is
        returned.
    """
    links = VertexLinks(working, bundle)
    control_vertices = loop.control_vertices
    breaking = breaking_vertices(links, start, wanted, control_vertices)
    n_breaking = len(breaking)
    field, all_breaking = wanted, breaking
    for attempt in range(12):
        if not len(breaking):
            return field, n_breaking
        checkpoint()
        radius = FALLBACK_RADIUS * 1.3**attempt * loop.edge_length
        graph = working.edge_graph()
        away = csgraph.dijkstra(graph, directed=False, indices=all_breaking, min_only=True)
        share = _smooth_step(away / radius - 1.0)
        field = start + share * (wanted - start)
        breaking = breaking_vertices(links, start, field, control_vertices)
        all_breaking = np.union1d(all_breaking, breaking)
    return start, n_breaking


def breaking_vertices(
    links: VertexLinks, start: FloatArray, wanted: FloatArray, control_vertices: IntArray
) -> IntArray:
    """Find the vertices that cannot be changed to their wanted signs by flips of simple vertices.

    Vertices are flipped greedily, so another sequence of flips might leave fewer of them.

    Parameters
    ----------
    links : VertexLinks
        Links of the vertices.
    start : (n,) float array
        Field whose zero set is one simple curve through the control vertices.
    wanted : (n,) float array
        Field with the wanted signs.
    control_vertices : (k,) int array

    Returns
    -------
    (q,) int array
        Vertices that keep the sign of ``start``. If there are none, the zero set of ``wanted`` is
        isotopic to that of ``start``.
    """
    sign = signs_with_zeros(start, control_vertices)
    goal = signs_with_zeros(wanted, control_vertices)
    changes_at_control = {v: links.sign_changes(v, sign) for v in control_vertices.tolist()}
    queue = deque(np.flatnonzero(sign != goal).tolist())
    queued = sign != goal
    while queue:
        checkpoint()
        vertex = queue.popleft()
        queued[vertex] = False
        if not links.is_simple(vertex, sign):
            continue
        sign[vertex] = goal[vertex]
        around = links.neighbours(vertex)
        controls_around = [v for v in around if v in changes_at_control]
        if any(links.sign_changes(v, sign) != changes_at_control[v] for v in controls_around):
            sign[vertex] = -goal[vertex]
            continue
        # A flip can make neighbours simple, and beside a control point also the point's neighbours.
        freed = set(around).union(*(links.neighbours(v) for v in controls_around))
        for other in sorted(freed):
            if sign[other] != goal[other] and not queued[other]:
                queue.append(other)
                queued[other] = True
    return np.flatnonzero(sign != goal)


def _smooth_step(fraction: FloatArray) -> FloatArray:
    """A smooth step that rises from 0 at 0 to 1 at 2."""
    t = np.clip(0.5 * fraction, 0.0, 1.0)
    return t * t * (3.0 - 2.0 * t)
