"""The graph in which the legs of the path are searched for, on some faces of a split mesh.

Its nodes are the vertices and the midpoints of edges.
"""

from __future__ import annotations

from collections.abc import Collection

import numpy as np
from scipy import sparse

from ..geometry.array_types import FloatArray, IntArray
from ..geometry.mesh import edge_keys, side_keys
from ..maps.guidance import length_factor
from ..progress import checkpoint
from .virtual_splits import WorkingMesh

Node = int | tuple[int, int]
"""A vertex of the split mesh, or the two ends of an edge, which stand for its midpoint."""


class LegGraph:
    """The faces given as a graph of n vertices followed by E edge midpoints.

    The arcs are the edges, the two halves of each edge, and the three lines between edge midpoints
    in every face. Lines from a vertex to the midpoint of the opposite edge are omitted: with them,
    splitting the edges of a path one by one would not always turn the lines of the path into edges.
    Boundary edges have no arcs, because a path along the boundary would separate the surface.

    Parameters
    ----------
    working : WorkingMesh
        The faces.
    phi_fea : (V,) float array or None
        φ_fea at the input vertices, which weights lengths.

    Attributes
    ----------
    edges : (E, 2) int array
        Edges as pairs of vertices of ``working``, smaller index first, sorted.
    interior : (n + E,) bool array
        Whether each node is off the boundary of the faces.
    arcs : (a, 2) int array
        Pairs of nodes that an arc joins.
    """

    def __init__(self, working: WorkingMesh, phi_fea: FloatArray | None) -> None:
        self._working = working
        self.edges, count = working.edges_and_counts
        self.interior = np.concatenate([~working.on_boundary, count > 1])
        self._positions = self._with_midpoints(working.vertices)
        self._weight = np.ones(self.size)
        if phi_fea is not None:
            self._weight = length_factor(self._with_midpoints(working.interpolation @ phi_fea))
        n = self.n_vertices
        keys = side_keys(working.faces, n).reshape(-1, 3)[:, [2, 0, 1]]
        side = n + np.searchsorted(self.edges @ [n, 1], keys)
        inner = self.edges[count > 1]
        midpoint = n + np.flatnonzero(count > 1)
        halves = [np.stack([end, midpoint], axis=1) for end in inner.T]
        between = [side[:, pair] for pair in ([0, 1], [1, 2], [2, 0])]
        self.arcs = np.concatenate([inner, *halves, *between])

    @property
    def n_vertices(self) -> int:
        """Number of vertices; nodes from this index on are midpoints."""
        return len(self._working.vertices)

    @property
    def size(self) -> int:
        """Number of nodes."""
        return self.n_vertices + len(self.edges)

    def lengths(self, steps: IntArray) -> FloatArray:
        """Weighted lengths of the steps between pairs of nodes (s, 2), shape (s,)."""
        start, end = steps.T
        apart = np.linalg.norm(self._positions[start] - self._positions[end], axis=1)
        return apart * (0.5 * (self._weight[start] + self._weight[end]))

    def matrix(self, lengths: FloatArray) -> sparse.csr_array:
        """Symmetric matrix of the lengths given for the arcs; infinite lengths block an arc."""
        rows, columns = np.concatenate([self.arcs, self.arcs[:, ::-1]]).T
        entries = sparse.coo_array((np.tile(lengths, 2), (rows, columns)), (self.size, self.size))
        # Two faces with the same corners give the same arcs twice. The conversion would add their
        # lengths if the matrix were not declared free of duplicates.
        entries.has_canonical_format = True
        checkpoint()
        return entries.tocsr()

    def vertex_nodes(self, vertices: Collection[int]) -> IntArray:
        """Nodes of vertices of the split mesh; vertices outside the faces are omitted."""
        wanted = np.array(sorted(vertices), dtype=np.int64)
        return np.flatnonzero(np.isin(self._working.split_vertex, wanted))

    def midpoint_nodes(self, edges: Collection[tuple[int, int]]) -> IntArray:
        """Nodes of the midpoints of edges of the split mesh, without those outside the faces."""
        own = self._working.split_vertex[self.edges]
        wanted = np.array(sorted(edges), dtype=np.int64).reshape(-1, 2)
        size = int(max(own.max(), wanted.max(initial=0))) + 1
        keys, wanted_keys = (edge_keys(ends[:, 0], ends[:, 1], size) for ends in (own, wanted))
        return self.n_vertices + np.flatnonzero(np.isin(keys, wanted_keys))

    def node(self, index: int) -> Node:
        """The vertex at a node, or the edge whose midpoint the node is."""
        if index < self.n_vertices:
            return int(self._working.split_vertex[index])
        start, end = self._working.split_vertex[self.edges[index - self.n_vertices]].tolist()
        return start, end

    def _with_midpoints(self, values: FloatArray) -> FloatArray:
        """Values at the vertices, followed by their means at the midpoints."""
        return np.concatenate([values, values[self.edges].mean(axis=1)])
