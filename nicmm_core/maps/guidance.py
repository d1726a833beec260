"""φ_fea (section 3.3): what weights of obstacles and alignment mean to every method.

The paper spreads a Gaussian about every feature vertex, with its weight as the standard deviation,
and adds them with signs to a neutral baseline. Eq. 7 then squares that map. Here

    φ_fea² = 1 + 15 G_obstacles − G_alignment:

the Gaussians are those of the square, which is what counts. Were they those of the map, its square
would have a bottom of fourth order along a lane, in which a curve finds no hold. The strongest
Gaussian of each kind counts and not their sum, so that a region is no stronger for having more
vertices. Widths are relative to the surface and not to its edges, so a finer mesh has the same map.

Obstacles repel from every painted vertex. Alignment attracts to the ridge of what is painted, the
vertices that are deepest inside; otherwise a curve would stop at the rim of a broad region.
"""

from __future__ import annotations

import numpy as np
from scipy import sparse
from scipy.sparse import csgraph

from ..geometry import tolerances
from ..geometry.array_types import BoolArray, FloatArray, IntArray
from ..geometry.mesh import Mesh, edge_lengths
from ..level_set.redistancing import DistanceSurface, spread
from ..progress import checkpoint

BASELINE = 1.0
"""φ_fea where nothing is painted.

With it the square keeps the order that the text asks for, alignment < neutral < obstacle; a map of
both signs would repel from alignment too.
"""

OBSTACLE = 15.0
"""What an obstacle of weight 1 adds to the square: a detour of up to 16 times is taken."""

ALIGNMENT_WIDTH = 0.025
"""Standard deviation for an alignment weight of 1, in square roots of the component's area.

A curve feels a lane up to about twice that far, which is some 4 % of a model's diagonal.
"""

OBSTACLE_WIDTH = 0.015
"""The same for obstacles, which have to be left behind and not to be found."""

CUT = 3.0
"""Standard deviations at which a Gaussian ends."""

DEPTH = 0.1
"""Depth inside a painted region, in the same unit, beyond which it is as good as its ridge."""

RIDGE = 0.5
"""Slope of the depth towards any neighbour below which a vertex is on the ridge.

It is 1 between rim and ridge, about 0.87 where no edge points straight inwards, and less where two
sides of the rim are equally near.
"""

LEVELS = 5
"""Steps into which weights are rounded up; each has its own width."""


def component_unit(mesh: Mesh, face: int) -> float:
    """Square root of the area of the component that a face belongs to, the unit of widths."""
    component = mesh.face_component == mesh.face_component[face]
    return float(np.sqrt(mesh.face_areas[component].sum()))


def feature_map(
    mesh: Mesh, obstacles: FloatArray | None, alignment: FloatArray | None, unit: float
) -> FloatArray:
    """φ_fea at the vertices, shape (V,), at least 0.

    Parameters
    ----------
    mesh : Mesh
    obstacles, alignment : (V,) float array of weights in [0, 1], or None
        A weight is the height of its Gaussian, and scales its width.
    unit : float
        Length that the widths are relative to, in mesh units: see `component_unit`.
    """
    squared = np.full(len(mesh.vertices), BASELINE**2)
    if obstacles is not None:
        level = _levels(obstacles)
        nothing = np.zeros(len(level))
        squared += OBSTACLE * _response(mesh, level, nothing, OBSTACLE_WIDTH * unit)
    if alignment is not None:
        level = _levels(alignment)
        width = ALIGNMENT_WIDTH * unit
        off_ridge = _off_ridge(mesh, level, width, DEPTH * unit)
        squared -= BASELINE**2 * _response(mesh, level, off_ridge, width)
    return np.sqrt(np.maximum(squared, 0.0))


def _levels(weights: FloatArray) -> IntArray:
    """Weights in steps, 0 where nothing is painted and `LEVELS` for a weight of 1, (V,)."""
    return np.ceil(LEVELS * weights - tolerances.SNAP).astype(np.int64)


def _response(mesh: Mesh, level: IntArray, start: FloatArray, width: float) -> FloatArray:
    """Strongest Gaussian at every vertex, in [0, 1], by distances along the surface.

    Parameters
    ----------
    mesh : Mesh
    level : (V,) int array
        Of the weights.
    start : (V,) float array
        Distance from the middle of its Gaussian that a painted vertex has, in widths.
    width : float
        Standard deviation at a weight of 1, in mesh units.
    """
    response = np.zeros(len(level))
    edges = mesh.edges
    length = edge_lengths(mesh.vertices, edges)
    # From the strongest down: what lies under a stronger Gaussian need not spread its own.
    for step in np.unique(level[level > 0])[::-1].tolist():
        checkpoint()
        weight = step / LEVELS
        own = np.flatnonzero((level == step) & (response < weight))
        if not len(own):
            continue
        sigma = weight * width
        away = _distances(edges, length, own, sigma * start[own], CUT * sigma, len(level))
        response = np.maximum(response, weight * np.exp(-0.5 * (away / sigma) ** 2))
    return response


def _distances(
    edges: IntArray,
    length: FloatArray,
    sources: IntArray,
    start: FloatArray,
    limit: float,
    size: int,
) -> FloatArray:
    """Distances along edges, (size,), from sources that begin with their own; inf from a limit."""
    # A vertex more, from which every source is as far away as it has to begin with.
    rows = np.concatenate([edges[:, 0], np.full(len(sources), size)])
    columns = np.concatenate([edges[:, 1], sources])
    # A zero would not be an arc.
    lengths = np.maximum(np.concatenate([length, start]), tolerances.TINY)
    graph = sparse.csr_array((lengths, (rows, columns)), shape=(size + 1, size + 1))
    return csgraph.dijkstra(graph, directed=False, indices=size, limit=limit)[:size]


def _off_ridge(mesh: Mesh, level: IntArray, width: float, depth: float) -> FloatArray:
    """How far painted vertices are from the ridge of their region, in widths, shape (V,).

    Where a region is broader than the Gaussian it is measured in depths of the ridge instead, so
    that all of a region attracts.

    Parameters
    ----------
    mesh : Mesh
    level : (V,) int array
    width : float
        Standard deviation at a weight of 1.
    depth : float
        From which on vertices count as on the ridge.
    """
    inside = _depths(mesh, level, depth)
    upwards = _steepest(mesh, level, inside)
    # Along the steepest way to where it ends; every round doubles the steps.
    top = upwards
    while (top[top] != top).any():
        top = top[top]
    sigma = np.maximum(level * (width / LEVELS), inside[top])
    return np.maximum(inside[top] - inside, 0.0) / np.maximum(sigma, tolerances.TINY)


def _depths(mesh: Mesh, level: IntArray, limit: float) -> FloatArray:
    """Distance of painted vertices to the nearest one of a lower level, or to the boundary."""
    result = np.zeros(len(level))
    rim = np.zeros(len(level), dtype=bool)
    rim[mesh.unpaired_edges[0]] = True
    edge_length = mesh.mean_edge_length
    for step in np.unique(level[level > 0]).tolist():
        checkpoint()
        there = level[mesh.faces] == step
        faces = mesh.faces[there.any(axis=1)]
        vertices, corners = np.unique(faces, return_inverse=True)
        corners = corners.reshape(-1, 3)
        distance = np.where((level[vertices] < step) | rim[vertices], 0.0, np.inf)
        if not np.isfinite(distance).any():
            continue
        entries = (np.ones(corners.size), (corners.ravel(), np.repeat(np.arange(len(faces)), 3)))
        around = sparse.csr_array(sparse.coo_array(entries, shape=(len(vertices), len(corners))))
        surface = DistanceSurface(mesh.vertices[vertices], corners, around, edge_length)
        spread(surface, distance, limit)
        own = level[vertices] == step
        result[vertices[own]] = np.minimum(distance[own], limit)
    return result


def _steepest(mesh: Mesh, level: IntArray, inside: FloatArray) -> IntArray:
    """The neighbour that lies deepest inside, by slope; a vertex itself where it is on a ridge.

    Only neighbours of the same level count: where a higher one begins, it takes over.
    """
    start, end = np.concatenate([mesh.edges, mesh.edges[:, ::-1]]).T
    alike: BoolArray = (level[start] > 0) & (level[end] == level[start])
    start, end = start[alike], end[alike]
    apart = np.linalg.norm(mesh.vertices[end] - mesh.vertices[start], axis=1)
    slope = (inside[end] - inside[start]) / np.maximum(apart, tolerances.TINY)
    rising = slope > RIDGE
    start, end, slope = start[rising], end[rising], slope[rising]
    order = np.argsort(slope, kind="stable")
    result = np.arange(len(level))
    result[start[order]] = end[order]  # the steepest is written last
    return result
