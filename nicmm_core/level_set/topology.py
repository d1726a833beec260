"""Keep the topology of the zero set: one loop.

A level set can split, merge and miss points (the paper's Fig. 16), and often does on thin limbs.
Flipping the sign of one vertex preserves the topology of the zero set exactly if the signs around
its link form one positive and one negative run: a simple vertex. The start is a field whose zero
set is one simple loop through the control points. Each vertex with another sign in the solution is
flipped as soon as it is simple. If all can be flipped, the solution is isotopic to the start: one
simple loop through the control points in the same order. Around the others, the solution is blended
with the start over a few edges.
"""

from __future__ import annotations

from collections import deque

import numpy as np
from scipy.sparse import csgraph

from ..geometry.array_types import FloatArray, IntArray
from ..path.initial_loop import InitialLoop
from ..path.virtual_splits import WorkingMesh
from ..progress import checkpoint
from .contour import signs_with_zeros
from .sign_bundle import SignBundle
from .vertex_links import VertexLinks

FALLBACK_RADIUS = 4.0
"""Radius around a topology-breaking vertex within which the start replaces the solution.

In edge lengths at the loop; the blend ends at three times that.
"""

FALLBACK_GROWTH = 1.3
"""Growth of that radius from one attempt to the next."""

FALLBACK_ATTEMPTS = 12
"""Attempts before the start replaces the solution everywhere."""


def keep_topology(
    working: WorkingMesh,
    loop: InitialLoop,
    start: FloatArray,
    wanted: FloatArray,
    bundle: SignBundle | None = None,
) -> tuple[FloatArray, int]:
    """Follow a field wherever its zero set stays isotopic to that of the start.

    Parameters
    ----------
    working : WorkingMesh
    loop : InitialLoop
    start : (n,) float array
        A field whose zero set is one simple loop through the control vertices.
    wanted : (n,) float array
        The field to follow, in the same unit.
    bundle : SignBundle, optional
        Signs with which faces read the values of their corners.

    Returns
    -------
    (n,) float array
        ``wanted`` if it keeps the topology, otherwise a blend of both.
    int
        Number of vertices whose sign in ``wanted`` breaks the topology; 0 if ``wanted`` is
        returned.
    """
    links = VertexLinks(working, bundle)
    control_vertices = loop.control_vertices
    breaking = breaking_vertices(links, start, wanted, control_vertices)
    n_breaking = len(breaking)
    field, all_breaking = wanted, breaking
    for attempt in range(FALLBACK_ATTEMPTS):
        if not len(breaking):
            return field, n_breaking
        checkpoint()
        radius = FALLBACK_RADIUS * FALLBACK_GROWTH**attempt * loop.edge_length
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
    """Vertices whose wanted sign no sequence of simple flips reaches.

    Parameters
    ----------
    links : VertexLinks
    start : (n,) float array
        A field whose zero set is one simple loop through the control vertices.
    wanted : (n,) float array
    control_vertices : (k,) int array

    Returns
    -------
    (q,) int array
        Empty if the zero set of ``wanted`` is isotopic to that of ``start``.
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
        # A flip can make neighbours simple and, beside a control point, those of the point.
        freed = set(around).union(*(links.neighbours(v) for v in controls_around))
        for other in sorted(freed):
            if sign[other] != goal[other] and not queued[other]:
                queue.append(other)
                queued[other] = True
    return np.flatnonzero(sign != goal)


def _smooth_step(fraction: FloatArray) -> FloatArray:
    """A smooth step from 0 at 0 to 1 at 2."""
    t = np.clip(0.5 * fraction, 0.0, 1.0)
    return t * t * (3.0 - 2.0 * t)
