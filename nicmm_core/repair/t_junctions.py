"""Divides open edges at the vertices of other open edges that lie on them.

Patches of CAD models often meet like this: the vertices along the common border of two patches
differ. After the division the edges on both sides have the same ends.
"""

from __future__ import annotations

import numpy as np
from scipy.spatial import cKDTree

from ..geometry import tolerances
from ..geometry.array_types import BoolArray, FloatArray, IntArray
from ..geometry.grouping import grouped, occurrences
from ..geometry.mesh import Mesh
from ..progress import checkpoint
from .coincident_vertices import open_edges
from .face_parts import FaceParts

ROUNDS = 64
"""Greatest number of rounds. In each, every open edge is divided once, near its middle."""


MOST_OPEN_EDGES = 300_000
"""Number of open edges above which T-junctions are not sought. Such a mesh is a heap of separate
faces rather than a few patches, and the search would take seconds."""


def without_t_junctions(
    mesh: Mesh, vertices: FloatArray, parts: FaceParts
) -> tuple[FaceParts, IntArray]:
    """Divide faces so that open edges that lie on each other have the same ends.

    Parameters
    ----------
    mesh : Mesh
        The given mesh.
    vertices : (V, 3) float array
        Positions of its vertices.
    parts : FaceParts
        Its faces, or parts of them, with different corners each.

    Returns
    -------
    FaceParts
        The faces, some of them divided.
    (d, 3) int array
        Vertices at which edges were divided, and the two ends of the edge of each.
    """
    divisions = [np.zeros((0, 3), dtype=np.int64)]
    for _ in range(ROUNDS):
        checkpoint()
        edges = open_edges(mesh, parts)
        edge, middle, share = _vertices_on_edges(vertices, edges, tolerances.GAP * mesh.diagonal)
        if not len(edge):
            break
        _, face = parts.at_edges(*edges[edge].T)  # one for each edge, as it is open
        # One division for each face; its other sides are divided in the next rounds.
        first = grouped(face)
        chosen = first[0][first[1]]
        start, end = edges[edge[chosen]].T
        parts = parts.divided(face[chosen], start, end, middle[chosen], share[chosen])
        divisions.append(np.stack([middle[chosen], start, end], axis=1))
    return parts, np.concatenate(divisions)


def _vertices_on_edges(
    vertices: FloatArray, edges: IntArray, tolerance: float
) -> tuple[IntArray, IntArray, FloatArray]:
    """Ends of open edges that lie on other open edges, of which a part coincides with their own.

    Returns
    -------
    (k,) int array
        Indices of the edges to divide, each once.
    (k,) int array
        A vertex on each of these edges, the nearest one to its middle.
    (k,) float array
        Its position, as a fraction from the first end to the second.
    """
    none = np.zeros(0, dtype=np.int64), np.zeros(0, dtype=np.int64), np.zeros(0)
    if not 3 <= len(edges) <= MOST_OPEN_EDGES:
        return none
    rim = np.unique(edges)
    start, end = vertices[edges[:, 0]], vertices[edges[:, 1]]
    middle, radius = 0.5 * (start + end), 0.5 * np.linalg.norm(end - start, axis=1)
    tree = cKDTree(vertices[rim], balanced_tree=False, compact_nodes=False)
    # The ends of an edge are as far from its middle as the radius, so any vertex on it is nearer.
    crossed = np.flatnonzero(tree.query(middle)[0] < radius - tolerance)
    if not len(crossed):
        return none
    checkpoint()
    inside = tree.query_ball_point(middle[crossed], radius[crossed] - tolerance)
    edge = np.repeat(crossed, [len(each) for each in inside])
    vertex = rim[np.concatenate([np.array(each, dtype=np.int64) for each in inside])]
    share, height = _along(vertices, edges[edge], vertex)
    length = 2.0 * radius[edge]
    margin = np.minimum(share, 1.0 - share) * length
    on_edge = (height <= tolerance) & (height <= tolerances.GAP_SHARE * margin)
    edge, vertex, share = edge[on_edge], vertex[on_edge], share[on_edge]
    lies_along = _has_edge_along(vertices, edges, edge, vertex, tolerance)
    edge, vertex, share = edge[lies_along], vertex[lies_along], share[lies_along]
    order = np.lexsort((np.abs(share - 0.5), edge))
    first = np.flatnonzero(np.diff(edge[order], prepend=-1))
    chosen = order[first]
    return edge[chosen], vertex[chosen], share[chosen]


def _along(
    vertices: FloatArray, edges: IntArray, points: IntArray
) -> tuple[FloatArray, FloatArray]:
    """Fraction along each edge of the foot of a vertex, and its distance from the line, (k,)."""
    start = vertices[edges[:, 0]]
    way, offset = vertices[edges[:, 1]] - start, vertices[points] - start
    squared = np.maximum(np.einsum("kd,kd->k", way, way), tolerances.TINY)
    share = np.einsum("kd,kd->k", offset, way) / squared
    return share, np.linalg.norm(offset - share[:, None] * way, axis=1)


def _has_edge_along(
    vertices: FloatArray, edges: IntArray, edge: IntArray, vertex: IntArray, tolerance: float
) -> BoolArray:
    """Whether an open edge begins at each vertex, (k,), that overlaps the edge it lies on, (k,)."""
    rank, place = occurrences(edges.ravel(), vertex)
    other_end = edges[place // 2, 1 - place % 2]
    own = place // 2 == edge[rank]
    # Either end of one edge lies on the other edge.
    share, height = _along(vertices, edges[edge[rank]], other_end)
    found = ~own & (height <= tolerance) & (share >= 0.0) & (share <= 1.0)
    for end in range(2):
        of_edge = edges[edge[rank], end]
        pair = np.stack([vertex[rank], other_end], axis=1)
        share, height = _along(vertices, pair, of_edge)
        found |= ~own & (height <= tolerance) & (share > 0.0) & (share < 1.0)
    result = np.zeros(len(vertex), dtype=bool)
    result[rank[found]] = True
    return result
