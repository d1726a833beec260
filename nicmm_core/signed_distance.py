"""The initial signed distance φ₀ (section 3.1): heat method for size, flood fill for sign."""

from __future__ import annotations

import igl
import numpy as np
from scipy import sparse
from scipy.sparse import csgraph

from .array_types import FloatArray, IntArray
from .errors import UnreachableError
from .finite_elements import FiniteElements
from .initial_loop import InitialLoop
from .virtual_splits import WorkingMesh

LEAST_DISTANCE = 1e-3
"""Least distance of a vertex off the loop, in mean edge lengths; the heat method may give zero."""


def signed_distance(
    working: WorkingMesh, elements: FiniteElements, loop: InitialLoop
) -> FloatArray:
    """Distance to the loop along the surface, negative inside, zero on the loop.

    The heat method (Crane et al. 2017) with all loop vertices as sources gives the size.
    Inside is the side with the smaller area.

    Returns
    -------
    (n,) float array
        In the unit of the working mesh.

    Raises
    ------
    UnreachableError
        If the loop does not bound a region, as a loop round a torus's tube.
    """
    heat = igl.HeatGeodesicsData()
    igl.heat_geodesics_precompute(working.vertices, working.faces, heat)
    distance = np.asarray(igl.heat_geodesics_solve(heat, loop.vertices)).ravel()
    distance = np.maximum(distance, LEAST_DISTANCE * working.mean_edge_length)
    distance[loop.vertices] = 0.0
    return _side(working, elements, loop) * distance


def _side(working: WorkingMesh, elements: FiniteElements, loop: InitialLoop) -> IntArray:
    """-1 inside, +1 outside and 0 on the loop, shape (n,), by flood fill."""
    n_vertices = len(working.vertices)
    on_loop = np.zeros(n_vertices, dtype=bool)
    on_loop[loop.vertices] = True
    start, end = working.edges[~on_loop[working.edges].any(axis=1)].T
    graph = sparse.coo_array((np.ones(len(start)), (start, end)), shape=(n_vertices, n_vertices))
    _, region = csgraph.connected_components(graph, directed=False)

    region_side = _two_colouring(region, *_regions_across(working, loop, region).T)
    if region_side is None:
        raise UnreachableError(
            "control_points: the loop through them does not bound a region of the surface (it "
            "runs round a handle or a hole), so no level set belongs to it; choose points or an "
            "order whose loop separates the surface into two parts"
        )
    side = np.where(on_loop, 0, region_side[region])
    inside = elements.vertex_areas[side < 0].sum()
    outside = elements.vertex_areas[side > 0].sum()
    return side if inside <= outside else -side


def _regions_across(working: WorkingMesh, loop: InitialLoop, region: IntArray) -> IntArray:
    """Pairs of regions that face each other across an edge of the loop, shape (p, 2)."""
    n_vertices = len(working.vertices)
    edges = np.sort(np.stack([loop.vertices, np.roll(loop.vertices, -1)], axis=1), axis=1)
    sides = working.faces[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2)
    sides = np.sort(sides, axis=1)
    opposite = working.faces[:, [2, 0, 1]].ravel()
    keys = sides @ [n_vertices, 1]
    beside = np.isin(keys, edges @ [n_vertices, 1])
    by_edge = np.argsort(keys[beside], kind="stable")
    sorted_keys = keys[beside][by_edge]
    facing = region[opposite[beside][by_edge]]
    pair = sorted_keys[:-1] == sorted_keys[1:]
    return np.stack([facing[:-1][pair], facing[1:][pair]], axis=1)


def _two_colouring(region: IntArray, first: IntArray, second: IntArray) -> IntArray | None:
    """Give regions across the loop opposite signs; None when that cannot be done."""
    across: dict[int, set[int]] = {}
    for one, other in zip(first.tolist(), second.tolist(), strict=True):
        across.setdefault(one, set()).add(other)
        across.setdefault(other, set()).add(one)
    side = np.ones(region.max() + 1, dtype=np.int64)
    seen: set[int] = set()
    for seed in across:
        if seed in seen:
            continue
        seen.add(seed)
        stack = [seed]
        while stack:
            one = stack.pop()
            for other in across[one]:
                if other not in seen:
                    seen.add(other)
                    side[other] = -side[one]
                    stack.append(other)
                elif side[other] == side[one]:
                    return None
    return side
