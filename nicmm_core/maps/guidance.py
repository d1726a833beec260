"""Computes φ_fea (section 3.3) from the weights of obstacles and alignment, for all methods.

The paper places a Gaussian at every feature vertex, with the weight of the vertex as standard
deviation, and adds the Gaussians with signs to a neutral baseline. Eq. 7 squares this map. Here

    φ_fea² = 1 + 15 G_obstacles − G_alignment,

so the Gaussians are part of the square, which enters the energy. Otherwise the square would have a
minimum of fourth order along a lane, too flat to hold a curve. G is the strongest Gaussian of its
kind, not the sum, so the number of vertices in a region does not matter. Widths are relative to the
size of the surface, so a finer mesh has the same map.

Obstacles repel the curve from every painted vertex. Alignment attracts it to the ridge of a painted
region, its deepest vertices; otherwise a curve would stop at the rim of a broad region.
"""

from __future__ import annotations

import numpy as np
from scipy import sparse
from scipy.sparse import csgraph

from ..geometry import tolerances
from ..geometry.array_types import FloatArray, IntArray
from ..geometry.distances import build_distance_surface, propagate
from ..geometry.mesh import Mesh, edge_lengths
from ..progress import checkpoint

BASELINE = 1.0
"""φ_fea where nothing is painted.

With it the square has the order that the paper requires, alignment < neutral < obstacle. If the map
had both signs, its square would make alignment repel the curve too.
"""

OBSTACLE = 15.0
"""Addition to φ_fea² at an obstacle of weight 1.

The curve then accepts a detour of up to 16 times the length through the obstacle.
"""

ALIGNMENT_WIDTH = 0.025
"""Standard deviation at an alignment weight of 1, relative to the √area of the component.

A lane attracts a curve within about twice this distance, some 4 % of a model's diagonal.
"""

OBSTACLE_WIDTH = 0.015
"""The same for obstacles. They are narrower, since they need not act from a distance."""

LEAST_WEIGHT = 1.0 / 3.0
"""Least factor of a length under alignment, which limits the detour of a leg to a lane.

At 0.1, distant legs are attracted to a lane, and two legs share a lane. At 0.5, legs ignore more of
the lanes that are 5 % of the diagonal away.
"""

DEPTH = 0.1
"""Depth in a painted region, in the same unit, above which all vertices belong to the ridge."""

RIDGE = 0.5
"""A vertex is on the ridge if no edge at it rises in depth with a slope above this.

Between rim and ridge the largest slope is 1, or about 0.87 if no edge points straight inwards. It
is smaller where two sides of the rim are equally near.
"""

LEVELS = 5
"""Number of levels to which weights are rounded up; each level has one width."""


def surface_unit(mesh: Mesh, component: int | None = None) -> float:
    """Square root of the area of a mesh, or of one of its components: the unit of widths."""
    faces = slice(None) if component is None else mesh.face_component == component
    return float(np.sqrt(mesh.face_areas[faces].sum()))


def feature_map(
    mesh: Mesh, obstacles: FloatArray | None, alignment: FloatArray | None, unit: float
) -> FloatArray:
    """φ_fea at the vertices, shape (V,), at least 0.

    Parameters
    ----------
    mesh : Mesh
    obstacles, alignment : (V,) float array of weights in [0, 1], or None
        Weights of the vertices. A weight scales both the height and the width of its Gaussian.
    unit : float
        Unit of the widths, in mesh units; see `surface_unit`.
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


def length_factor(phi_fea: FloatArray) -> FloatArray:
    """Factor of lengths where φ_fea has the values given, an array of any shape."""
    return np.maximum(phi_fea**2, LEAST_WEIGHT)


def _levels(weights: FloatArray) -> IntArray:
    """Levels of the weights, (V,): 0 where nothing is painted, `LEVELS` at a weight of 1."""
    return np.ceil(LEVELS * weights - tolerances.SNAP).astype(np.int64)


def _response(mesh: Mesh, level: IntArray, start: FloatArray, width: float) -> FloatArray:
    """Strongest Gaussian at every vertex, in [0, 1], with distances measured along edges.

    Parameters
    ----------
    mesh : Mesh
    level : (V,) int array
        Levels of the weights.
    start : (V,) float array
        Distance of each painted vertex from the centre of its Gaussian, in widths.
    width : float
        Standard deviation at a weight of 1, in mesh units.
    """
    response = np.zeros(len(level))
    edges = mesh.edges
    length = edge_lengths(mesh.vertices, edges)
    # From the highest level down: a vertex that lies below a stronger Gaussian needs no Gaussian.
    for step in np.unique(level[level > 0])[::-1].tolist():
        checkpoint()
        weight = step / LEVELS
        own = np.flatnonzero((level == step) & (response < weight))
        if not len(own):
            continue
        sigma = weight * width
        # The Gaussian is cut off at three standard deviations.
        away = _distances(edges, length, own, sigma * start[own], 3.0 * sigma, len(level))
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
    """Distances along edges, (size,), from sources with initial distances; inf beyond a limit."""
    # An additional vertex is joined to each source by an arc whose length is the initial distance.
    rows = np.concatenate([edges[:, 0], np.full(len(sources), size)])
    columns = np.concatenate([edges[:, 1], sources])
    # The sparse graph would drop an arc of length zero.
    lengths = np.maximum(np.concatenate([length, start]), tolerances.TINY)
    graph = sparse.csr_array((lengths, (rows, columns)), shape=(size + 1, size + 1))
    return csgraph.dijkstra(graph, directed=False, indices=size, limit=limit)[:size]


def _off_ridge(mesh: Mesh, level: IntArray, width: float, depth: float) -> FloatArray:
    """Distance of painted vertices from the ridge of their region, in widths, shape (V,).

    If a region is broader than the Gaussian, the unit is the depth of its ridge instead, so that
    the whole region attracts.

    Parameters
    ----------
    mesh : Mesh
    level : (V,) int array
    width : float
        Standard deviation at a weight of 1.
    depth : float
        Depth above which all vertices belong to the ridge.
    """
    inside = _depths(mesh, level, depth)
    upwards = _steepest(mesh, level, inside)
    # Follow the steepest ascent to its end. Each round doubles the number of steps taken.
    top = upwards
    while (top[top] != top).any():
        top = top[top]
    sigma = np.maximum(level * (width / LEVELS), inside[top])
    return np.maximum(inside[top] - inside, 0.0) / np.maximum(sigma, tolerances.TINY)


def _depths(mesh: Mesh, level: IntArray, limit: float) -> FloatArray:
    """Distance of painted vertices to the nearest vertex of a lower level or on the boundary."""
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
        surface = build_distance_surface(mesh.vertices[vertices], corners, edge_length)
        propagate(surface, distance, limit)
        own = level[vertices] == step
        result[vertices[own]] = np.minimum(distance[own], limit)
    return result


def _steepest(mesh: Mesh, level: IntArray, inside: FloatArray) -> IntArray:
    """For each vertex, the neighbour of steepest ascent in depth, or the vertex itself on a ridge.

    Only neighbours of the same level are considered.
    """
    start, end = np.concatenate([mesh.edges, mesh.edges[:, ::-1]]).T
    apart = np.linalg.norm(mesh.vertices[end] - mesh.vertices[start], axis=1)
    slope = (inside[end] - inside[start]) / np.maximum(apart, tolerances.TINY)
    rising = (level[start] > 0) & (level[end] == level[start]) & (slope > RIDGE)
    start, end, slope = start[rising], end[rising], slope[rising]
    order = np.argsort(slope, kind="stable")
    result = np.arange(len(level))
    result[start[order]] = end[order]  # the steepest edge is written last
    return result
