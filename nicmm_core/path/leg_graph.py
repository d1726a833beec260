"""The graph in which the legs of the path are searched for, on a part of a split mesh.

Its nodes are the vertices and the midpoints of edges.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy import sparse

from ..geometry.array_types import BoolArray, FloatArray, IntArray
from ..progress import checkpoint

Node = int | tuple[int, int]
"""A vertex of the split mesh, or the two ends of an edge, which stand for its midpoint."""


@dataclass(frozen=True)
class Patch:
    """A set of faces of the split mesh as a graph of n vertices followed by E edge midpoints.

    Attributes
    ----------
    vertices : (n,) int array
        Vertices of the split mesh, sorted.
    edges : (E, 2) int array
        Edges as pairs of indices into ``vertices``, smaller index first, sorted.
    on_rim : (E,) bool array
        Whether an edge has only one face in the patch.
    positions : (n + E, 3) float array
        Positions of the nodes.
    weight : (n + E,) float array
        Factor of lengths at each node, see `guidance.length_factor`.
    arcs : (a, 2) int array
        Pairs of nodes that an arc joins.
    through_midpoints : (a,) bool array
        Whether one or both ends of an arc are midpoints.
    """

    vertices: IntArray
    edges: IntArray
    on_rim: BoolArray
    positions: FloatArray
    weight: FloatArray
    arcs: IntArray
    through_midpoints: BoolArray

    @property
    def size(self) -> int:
        """Number of nodes."""
        return len(self.vertices) + len(self.edges)

    @cached_property
    def lengths(self) -> FloatArray:
        """Weighted lengths of the arcs, shape (a,)."""
        return self.step_lengths(self.arcs)

    def step_lengths(self, steps: IntArray) -> FloatArray:
        """Weighted lengths of the steps between pairs of nodes (s, 2), shape (s,)."""
        start, end = steps.T
        apart = np.linalg.norm(self.positions[start] - self.positions[end], axis=1)
        return apart * (0.5 * (self.weight[start] + self.weight[end]))

    def graph(self, lengths: FloatArray) -> sparse.csr_array:
        """Symmetric matrix of the lengths given for the arcs; infinite lengths block an arc."""
        arc, indices, indptr = self._structure
        return sparse.csr_array((lengths[arc], indices, indptr), shape=(self.size, self.size))

    @cached_property
    def _structure(self) -> tuple[IntArray, IntArray, IntArray]:
        """Arc index and column of each matrix entry, and the first entry of each row."""
        arc = np.arange(len(self.arcs))
        rows, columns = np.concatenate([self.arcs, self.arcs[:, ::-1]]).T
        entries = sparse.coo_array(
            (np.concatenate([arc, arc]), (rows, columns)), shape=(self.size, self.size)
        )
        # Two faces with the same corners give the same arcs twice. The conversion would sum their
        # arc indices if the matrix were not declared free of duplicates.
        entries.has_canonical_format = True
        checkpoint()
        matrix = entries.tocsr()
        return matrix.data, matrix.indices, matrix.indptr

    def node_indices(self, vertices: IntArray) -> IntArray:
        """Nodes of vertices of the split mesh; vertices outside this patch are omitted."""
        index = np.searchsorted(self.vertices, vertices).clip(max=len(self.vertices) - 1)
        return index[self.vertices[index] == vertices]

    def node(self, index: int) -> Node:
        """The vertex at a node, or the edge whose midpoint the node is."""
        if index < len(self.vertices):
            return int(self.vertices[index])
        start, end = self.vertices[self.edges[index - len(self.vertices)]]
        return int(start), int(end)
