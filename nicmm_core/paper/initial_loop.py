"""The initial path on a refined mesh, from which the level set is built."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..geometry.array_types import IntArray
from ..path.initial_path import InitialPath
from ..path.virtual_splits import SplitMesh, WorkingMesh
from .band_refinement import refine_along


@dataclass(frozen=True)
class InitialLoop:
    """A simple path of edges of a working mesh, closed or open.

    Attributes
    ----------
    vertices : (l,) int array
        Working vertices in order; the first vertex of a closed path is not repeated at the end. An
        edge of the working mesh that joins two of them is always an edge of the path.
    control_vertices : (k,) int array
        Working vertices of the control points, in order along the path.
    order : (k,) int array
        Indices of the control points in the caller's array, in the same order.
    edge_length : float
        Mean length h of the edges with at least one end on the path, in mesh units. The widths of
        the narrow band and of the Dirac delta are multiples of h.
    zigzag : float
        Step length of the path's zigzag along mesh edges, which smoothing has to remove. See
        `refine_along`.
    closed : bool
        Whether an edge joins the last vertex to the first.
    """

    vertices: IntArray
    control_vertices: IntArray
    order: IntArray
    edge_length: float
    zigzag: float
    closed: bool = True

    @property
    def edges(self) -> IntArray:
        """Pairs of consecutive vertices, shape (l, 2), or (l - 1, 2) for an open path."""
        pairs = np.stack([self.vertices, np.roll(self.vertices, -1)], axis=1)
        return pairs if self.closed else pairs[:-1]

    def neighbours(self, index: int) -> list[int]:
        """The vertices before and after the vertex at an index of the path, in either order."""
        edges = self.edges
        return edges[(edges == self.vertices[index])[:, ::-1]].tolist()


def build_initial_loop(component: int, path: InitialPath) -> tuple[WorkingMesh, InitialLoop]:
    """Refine a mesh along the initial path, and separate neighbouring strands of the path.

    Parameters
    ----------
    component : int
        The component with the path.
    path : InitialPath
        The path; its mesh is split further.

    Returns
    -------
    WorkingMesh
        The component, split so that the path runs along edges.
    InitialLoop
        The path on that mesh.
    """
    split, closed = path.split, path.closed
    loop, zigzag = refine_along(split, component, path.vertices, closed)
    _separate_strands(split, loop, closed)
    working, renumbered = split.assemble(component)
    vertices, controls = renumbered[loop], renumbered[path.control_vertices]
    beside = np.isin(working.edges, vertices).any(axis=1)
    edge_length = float(working.edge_lengths[beside].mean())
    return working, InitialLoop(vertices, controls, path.order, edge_length, zigzag, closed)


def _separate_strands(split: SplitMesh, loop: list[int], closed: bool) -> None:
    """Insert vertices between neighbouring strands of the loop.

    An edge between two loop vertices that is not an edge of the loop is split, and so is a face
    whose three edges belong to the loop. Then the remaining vertices on the two sides of the loop
    belong to different components, which flood fill can tell apart.
    """
    on_loop = set(loop)
    onward = loop[1:] + loop[:1] if closed else loop[1:]
    loop_edges = {frozenset(edge) for edge in zip(loop, onward, strict=False)}
    for vertex in loop:
        for face in sorted(split.faces_around(vertex)):
            if face not in split.faces_around(vertex):
                continue
            a, b, c = split.corners(face)
            sides = {frozenset(side) for side in ((a, b), (b, c), (c, a))}
            if sides <= loop_edges:
                split.split_face(face)
                continue
            for side in sorted(tuple(sorted(s)) for s in sides - loop_edges):
                if on_loop.issuperset(side):
                    split.split_edge(*side)
                    break
