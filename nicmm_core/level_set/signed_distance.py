"""The initial signed distance (section 3.1): heat method for the distance, flood fill for signs."""

from __future__ import annotations

import numpy as np
from scipy import sparse
from scipy.sparse import csgraph

from ..geometry.array_types import FloatArray, IntArray
from ..path.initial_loop import InitialLoop
from ..path.virtual_splits import WorkingMesh
from .finite_elements import FiniteElements
from .sparse_solver import factorise

LEAST_DISTANCE = 1e-3
"""Least distance of a vertex off the loop, in mean edge lengths; the heat method may give 0."""


POISSON_SHIFT = 1e-8
"""Factor of the mass matrix in the Poisson system, which is singular without it."""


def signed_distance(
    elements: FiniteElements, loop: InitialLoop, edge_length: float, side: IntArray
) -> FloatArray:
    """Geodesic distance to the initial path, with the sign of each side.

    Parameters
    ----------
    elements : FiniteElements
        Of the working mesh; their unit is the unit of the distance.
    loop : InitialLoop
    edge_length : float
        Mean edge length in the unit of the elements.
    side : (n,) int array
        ±1; ignored on the path.

    Returns
    -------
    (n,) float array
        Zero on the path and nowhere else.
    """
    distance = heat_distance(elements, loop.vertices, edge_length**2)
    distance = np.maximum(distance, LEAST_DISTANCE * edge_length)
    distance[loop.vertices] = 0.0
    return side * distance


def heat_distance(elements: FiniteElements, sources: IntArray, time: float) -> FloatArray:
    """Distance to source vertices by the heat method (Crane et al. 2017), shape (n,).

    Heat diffuses from the sources for a short time, its gradient is normalised, and the distance is
    the function whose gradient is closest to that in the least-squares sense.

    Parameters
    ----------
    elements : FiniteElements
    sources : (l,) int array
    time : float
        Of the diffusion; usually the square of the mean edge length.
    """
    mass = sparse.diags_array(elements.vertex_areas)
    heat = np.zeros(len(elements.vertex_areas))
    heat[sources] = 1.0
    heat = factorise(mass + time * elements.stiffness).solve(heat)
    gradient = (elements.gradient @ heat).reshape(3, -1)
    length = np.linalg.norm(gradient, axis=0)
    # Where the heat underflows to zero, there is no direction.
    direction = -gradient / np.where(length > 0.0, length, 1.0)
    flux = elements.gradient.T @ (elements.face_areas * direction).ravel()
    area = elements.vertex_areas.sum()
    poisson = factorise(elements.stiffness + (POISSON_SHIFT / area) * mass)
    distance = poisson.solve(flux)
    return distance - distance[sources].mean()


def bounding_side(
    working: WorkingMesh, elements: FiniteElements, loop: InitialLoop
) -> IntArray | None:
    """-1 inside a closed path, +1 outside and 0 on it, by flood fill, shape (n,).

    Inside is the side with the smaller area. None if the path bounds no region, such as a meridian
    of a torus.
    """
    n_vertices = len(working.vertices)
    on_loop = np.zeros(n_vertices, dtype=bool)
    on_loop[loop.vertices] = True
    start, end = working.edges[~on_loop[working.edges].any(axis=1)].T
    graph = sparse.coo_array((np.ones(len(start)), (start, end)), shape=(n_vertices, n_vertices))
    _, region = csgraph.connected_components(graph, directed=False)

    region_side = _two_colouring(region, *_regions_across(working, loop, region).T)
    if region_side is None:
        return None
    side = np.where(on_loop, 0, region_side[region])
    inside = elements.vertex_areas[side < 0].sum()
    outside = elements.vertex_areas[side > 0].sum()
    return side if inside <= outside else -side


def _regions_across(working: WorkingMesh, loop: InitialLoop, region: IntArray) -> IntArray:
    """Pairs of regions on opposite sides of an edge of the loop, shape (p, 2)."""
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
    """Opposite signs for regions across the loop; None if there is a contradiction."""
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
