"""The search graph of legs: vertices and edge midpoints of a part of a split mesh."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy import sparse

from ..geometry.array_types import BoolArray, FloatArray, IntArray
from ..geometry.mesh import Mesh, adjacent_sides, joined_corners, side_corners
from ..progress import checkpoint

Node = int | tuple[int, int]
"""A vertex of the split mesh, or an edge, which stands for its midpoint."""


@dataclass(frozen=True)
class Patch:
    """Some faces of the split mesh as a graph of n vertices and then E edge midpoints.

    Attributes
    ----------
    vertices : (n,) int array
        Vertices of the split mesh, sorted.
    edges : (E, 2) int array
        Sorted.
    on_rim, nonmanifold_edges : (E,) bool array
        Edges with one face, and with more than two.
    positions : (n + E, 3) float array
        Of the nodes.
    weight : (n + E,) float array
        Factor of lengths at the nodes, see `leg_search.length_factor`.
    arcs : (a, 2) int array
    through_midpoints : (a,) bool array
    """

    vertices: IntArray
    edges: IntArray
    on_rim: BoolArray
    nonmanifold_edges: BoolArray
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
        """Weighted lengths of pairs of nodes (s, 2), shape (s,)."""
        start, end = steps.T
        apart = np.linalg.norm(self.positions[start] - self.positions[end], axis=1)
        return apart * (0.5 * (self.weight[start] + self.weight[end]))

    def graph(self, lengths: FloatArray) -> sparse.csr_array:
        """The arcs as a symmetric matrix; arcs of infinite length are blocked."""
        arc, indices, indptr = self._structure
        return sparse.csr_array((lengths[arc], indices, indptr), shape=(self.size, self.size))

    @cached_property
    def _structure(self) -> tuple[IntArray, IntArray, IntArray]:
        """The arc and the column of each matrix entry, and the start of each row."""
        arc = np.arange(len(self.arcs))
        rows, columns = np.concatenate([self.arcs, self.arcs[:, ::-1]]).T
        entries = sparse.coo_array(
            (np.concatenate([arc, arc]), (rows, columns)), shape=(self.size, self.size)
        )
        # Two faces with the same corners give arcs twice; their numbers must not be summed.
        entries.has_canonical_format = True
        checkpoint()
        matrix = entries.tocsr()
        return matrix.data, matrix.indices, matrix.indptr

    def places(self, vertices: IntArray) -> IntArray:
        """Nodes of vertices of the split mesh, omitting vertices outside this part."""
        place = np.searchsorted(self.vertices, vertices).clip(max=len(self.vertices) - 1)
        return place[self.vertices[place] == vertices]

    def node(self, place: int) -> Node:
        """The vertex, or the edge of the midpoint, of a node."""
        if place < len(self.vertices):
            return int(self.vertices[place])
        start, end = self.vertices[self.edges[place - len(self.vertices)]]
        return int(start), int(end)


def nonmanifold_vertices(mesh: Mesh) -> BoolArray:
    """Vertices whose faces form more than one fan, shape (V,).

    Faces at a vertex belong to the same fan if edges at that vertex connect them.
    """
    ends = side_corners(mesh.faces)
    one, other = adjacent_sides(mesh.faces)
    _, vertex_of_fan = joined_corners(mesh.faces, ends[one].ravel(), ends[other].ravel())
    return np.bincount(vertex_of_fan, minlength=len(mesh.vertices)) > 1
