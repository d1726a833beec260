"""Random obstacles and lanes for pretraining, as users paint them beside and across curves."""

from __future__ import annotations

import numpy as np
from scipy import sparse
from scipy.sparse import csgraph

from ..geometry.array_types import FloatArray, IntArray
from ..geometry.grouping import path_between
from ..geometry.mesh import Mesh

LANE_OFFSET = 0.12
"""Maximum distance from each end of a lane to the path between two control points, in √area."""

LANE_PART = (0.2, 0.8)
"""Start and end of a lane along that path, as fractions of the path's number of vertices."""

OBSTACLE_RADII = (0.02, 0.07)
"""Range of the radii of obstacles, in √area."""


def random_maps(
    mesh: Mesh, points: IntArray, generator: np.random.Generator
) -> tuple[FloatArray, FloatArray]:
    """Generate weights of obstacles and of alignment, both (V,), from one to three random strokes.

    Every stroke is placed relative to the shortest path along edges between two control points. It
    is a lane with its ends near the path, or an obstacle around a vertex of the path.

    Parameters
    ----------
    mesh : Mesh
    points : (k,) int array
        Vertices of the control points, all on one component.
    generator : Generator
        Random number generator.

    Returns
    -------
    obstacles, alignment : (V,) float array
        Weights in [0, 1].
    """
    size = len(mesh.vertices)
    start, end = mesh.edges.T
    length = np.linalg.norm(mesh.vertices[start] - mesh.vertices[end], axis=1)
    graph = sparse.csr_array((length, (start, end)), shape=(size, size))
    component = mesh.face_component == mesh.face_component[mesh.faces_at(points[:1])[0]]
    unit = float(np.sqrt(mesh.face_areas[component].sum()))
    obstacles, alignment = np.zeros(size), np.zeros(size)
    for _ in range(generator.integers(1, 4)):
        ends = generator.choice(points, 2, replace=False)
        path = _shortest_path(graph, int(ends[0]), int(ends[1]))
        weight = generator.uniform(0.4, 1.0)
        if generator.random() < 0.5:
            middle = generator.choice(path)
            radius = generator.uniform(*OBSTACLE_RADII) * unit
            near = _around(graph, int(middle), radius)
            obstacles[near] = np.maximum(obstacles[near], weight)
        else:
            stops = [path[int(share * (len(path) - 1))] for share in LANE_PART]
            beside = [
                int(generator.choice(_around(graph, int(stop), LANE_OFFSET * unit)))
                for stop in stops
            ]
            lane = _shortest_path(graph, *beside)
            alignment[lane] = np.maximum(alignment[lane], weight)
    return obstacles, alignment


def _shortest_path(graph: sparse.csr_array, start: int, end: int) -> IntArray:
    """Vertices of the shortest path along edges between two vertices."""
    _, previous = csgraph.dijkstra(graph, directed=False, indices=end, return_predecessors=True)
    return np.array(path_between(previous, end, start)[::-1])


def _around(graph: sparse.csr_array, middle: int, radius: float) -> IntArray:
    """Vertices within a radius of a vertex, measured along edges, with the vertex itself."""
    distance = csgraph.dijkstra(graph, directed=False, indices=middle, limit=radius)
    return np.flatnonzero(np.isfinite(distance))
