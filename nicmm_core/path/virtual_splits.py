"""Virtual splits (section 3.1, Fig. 1): the mesh M' that has every control point as a vertex.

The input mesh is never changed. `SplitMesh` stores the additional vertices and faces, and
`SplitMesh.assemble` returns one connected component as arrays, with the location of every vertex
and face in the input mesh.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import chain

import numpy as np
from scipy import sparse

from ..geometry import tolerances
from ..geometry.array_types import BoolArray, FloatArray, IntArray
from ..geometry.mesh import Mesh, edge_lengths, triangle_areas, unique_edges
from ..geometry.surface_points import SurfacePoints
from ..progress import checkpoint

Corners = tuple[int, ...]
"""The three vertices of a face."""

Weights = dict[int, float]
"""A point of the surface as weights of input vertices; vertices not listed have weight 0."""


@dataclass(frozen=True)
class WorkingMesh:
    """Some faces of the split mesh as arrays: n vertices and m faces.

    Attributes
    ----------
    vertices : (n, 3) float array
    faces : (m, 3) int array
    parent_face : (m,) int array
        The input face that contains each face.
    interpolation : (n, V) sparse array
        Row i holds the weights of the input vertices at vertex i, so that
        ``vertices == interpolation @ mesh.vertices``.
    split_vertex : (n,) int array
        Index of each vertex in the split mesh, ascending.
    """

    vertices: FloatArray
    faces: IntArray
    parent_face: IntArray
    interpolation: sparse.csr_array
    split_vertex: IntArray

    @property
    def input_vertex(self) -> IntArray:
        """The input vertex of each vertex, or -1 if it was inserted, shape (n,)."""
        return np.where(self.split_vertex < self.interpolation.shape[1], self.split_vertex, -1)

    @cached_property
    def edges_and_counts(self) -> tuple[IntArray, IntArray]:
        """Edges, (E, 2), and the number of faces at each, (E,)."""
        return unique_edges(self.faces)

    @property
    def edges(self) -> IntArray:
        """Undirected edges, shape (E, 2), smaller index first, sorted."""
        return self.edges_and_counts[0]

    @cached_property
    def edge_lengths(self) -> FloatArray:
        """Length of each edge, shape (E,)."""
        return edge_lengths(self.vertices, self.edges)

    @cached_property
    def face_areas(self) -> FloatArray:
        """Area of each face, shape (m,)."""
        return triangle_areas(self.vertices, self.faces)

    @cached_property
    def on_boundary(self) -> BoolArray:
        """Whether each vertex belongs to an edge with only one face, shape (n,)."""
        edges, count = self.edges_and_counts
        result = np.zeros(len(self.vertices), dtype=bool)
        result[edges[count == 1]] = True
        return result

    def edge_graph(self) -> sparse.csr_array:
        """Lengths of the edges as an upper triangular matrix, shape (n, n)."""
        n_vertices = len(self.vertices)
        entries = (self.edge_lengths, (self.edges[:, 0], self.edges[:, 1]))
        return sparse.csr_array(sparse.coo_array(entries, shape=(n_vertices, n_vertices)))


class SplitMesh:
    """The input mesh with virtual splits of faces and edges.

    Vertices and faces of the input mesh keep their indices; new ones are appended. A face is living
    until a split or a flip replaces it. The cost of a split does not depend on the size of the
    mesh.
    """

    def __init__(self, mesh: Mesh) -> None:
        self.n_faces = len(mesh.faces)  # living or not
        self._mesh = mesh
        self._is_living = np.ones(len(mesh.faces), dtype=bool)  # of the input faces
        self._new_weights: list[Weights] = []
        self._new_faces: dict[int, Corners] = {}  # only living ones
        self._parents: dict[int, int] = {}
        self._faces_around: dict[int, set[int]] = {}

    @property
    def n_vertices(self) -> int:
        """Number of vertices, those of the input mesh included."""
        return len(self._mesh.vertices) + len(self._new_weights)

    def corners(self, face: int) -> Corners:
        """Vertices of a living face."""
        if face in self._new_faces:
            return self._new_faces[face]
        return tuple(self._mesh.faces[face].tolist())

    def weights(self, vertex: int) -> Weights:
        """Position of a vertex as weights of input vertices."""
        n_input = len(self._mesh.vertices)
        return self._new_weights[vertex - n_input] if vertex >= n_input else {vertex: 1.0}

    def position(self, vertex: int) -> FloatArray:
        """Position of a vertex, shape (3,)."""
        weights = self.weights(vertex)
        values = np.fromiter(weights.values(), dtype=np.float64)
        return values @ self._mesh.vertices[list(weights)]

    def faces_around(self, vertex: int) -> set[int]:
        """Living faces at a vertex."""
        if vertex not in self._faces_around:
            self._faces_around[vertex] = set(self._mesh.faces_at(np.array([vertex])).tolist())
        return self._faces_around[vertex]

    def faces_at_edge(self, start: int, end: int) -> set[int]:
        """Living faces that have both vertices; a boundary edge has only one."""
        return self.faces_around(start) & self.faces_around(end)

    def input_face_with(self, start: int, end: int) -> int:
        """An input face that contains the edge between two vertices."""
        return min(map(self._parent, self.faces_at_edge(start, end)))

    def neighbours(self, vertex: int) -> set[int]:
        """Vertices joined to a vertex by an edge."""
        corners = {corner for face in self.faces_around(vertex) for corner in self.corners(face)}
        return corners - {vertex}

    def is_on_boundary(self, vertex: int) -> bool:
        """Whether a vertex belongs to an edge with only one face."""
        return any(len(self.faces_at_edge(vertex, v)) == 1 for v in self.neighbours(vertex))

    def insert_points(self, points: SurfacePoints) -> IntArray:
        """Make every point a vertex by splitting the face or edge it lies on (Fig. 1).

        Returns
        -------
        (k,) int array
            The vertex of each point.
        """
        return np.array(
            [
                self._insert_point(int(face), barycentric)
                for face, barycentric in zip(points.faces, points.barycentric, strict=True)
            ],
            dtype=np.int64,
        )

    def split_edge(self, start: int, end: int) -> int:
        """Insert the midpoint of an edge, bisect the faces at the edge, return the new vertex."""
        middle = _centroid([self.weights(start), self.weights(end)])
        return self._split_edge_at(start, end, middle)

    def join(self, first: int, second: int) -> bool:
        """Join two vertices by an edge, if possible.

        If they are opposite a common edge inside an input face, that edge is flipped.

        Returns
        -------
        bool
            Whether an edge joins the vertices afterwards.
        """
        if self.faces_at_edge(first, second):
            return True
        for face in sorted(self.faces_around(first)):
            corners = self.corners(face)
            place = corners.index(first)
            start, end = corners[place - 2], corners[place - 1]
            beyond = self.faces_at_edge(start, end) & self.faces_around(second)
            if beyond and self._parent(face) == self._parent(other := min(beyond)):
                self._replace_face(face, [(first, start, second)])
                self._replace_face(other, [(first, second, end)])
                return True
        return False

    def split_face(self, face: int) -> int:
        """Insert the centroid of a face, split the face into three, return the new vertex."""
        return self._split_face_at(face, _centroid([self.weights(v) for v in self.corners(face)]))

    def assemble(self, component: int) -> tuple[WorkingMesh, IntArray]:
        """Return one connected component of the input mesh, with all splits, as arrays.

        Returns
        -------
        WorkingMesh
        (n_vertices,) int array
            Index in the working mesh of each vertex of this mesh, or -1 on other components.
        """
        working = self.assemble_faces(self._mesh.face_component == component)
        renumbered = np.full(self.n_vertices, -1, dtype=np.int64)
        renumbered[working.split_vertex] = np.arange(len(working.split_vertex))
        return working, renumbered

    def assemble_faces(self, inside: BoolArray) -> WorkingMesh:
        """Return the living faces inside selected input faces, (F,), as arrays."""
        mesh, n_input = self._mesh, len(self._mesh.vertices)
        kept = np.flatnonzero(self._is_living & inside)
        new = [face for face in self._new_faces if inside[self._parents[face]]]
        corners = np.array([self._new_faces[face] for face in new], dtype=np.int64)
        parents = np.array([self._parents[face] for face in new], dtype=np.int64)
        used, faces = np.unique(
            np.concatenate([mesh.faces[kept], corners.reshape(-1, 3)]), return_inverse=True
        )
        n_kept = int(np.searchsorted(used, n_input))
        weights = [self._new_weights[vertex - n_input] for vertex in used[n_kept:].tolist()]
        ends = n_kept + np.cumsum([0, *map(len, weights)])
        columns = np.fromiter(chain.from_iterable(weights), dtype=np.int64)
        values = np.fromiter(chain.from_iterable(w.values() for w in weights), dtype=np.float64)
        interpolation = sparse.csr_array(
            (
                np.concatenate([np.ones(n_kept), values]),
                np.concatenate([used[:n_kept], columns]),
                np.concatenate([np.arange(n_kept), ends]),
            ),
            shape=(len(used), n_input),
        )
        return WorkingMesh(
            vertices=interpolation @ mesh.vertices,
            faces=faces.reshape(-1, 3),
            parent_face=np.concatenate([kept, parents]),
            interpolation=interpolation,
            split_vertex=used,
        )

    def _insert_point(self, input_face: int, barycentric: FloatArray) -> int:
        """Make a point of an input face a vertex, and return the vertex."""
        corners = self.corners(input_face)
        weights = {
            corner: float(weight)
            for corner, weight in zip(corners, barycentric, strict=True)
            if weight > 0.0
        }
        if len(weights) == 1:
            return next(iter(weights))
        face, local = self._locate(input_face, corners, barycentric)
        inside = self.corners(face)
        support = [c for c, w in zip(inside, local, strict=True) if w > tolerances.SNAP]
        if len(support) == 1:
            return support[0]
        if len(support) == 2:
            return self._split_edge_at(support[0], support[1], weights)
        return self._split_face_at(face, weights)

    def _locate(
        self, input_face: int, input_corners: Corners, barycentric: FloatArray
    ) -> tuple[int, FloatArray]:
        """The living face that contains a point of an input face, and its barycentrics there."""
        if self._is_living[input_face]:
            return input_face, barycentric
        inside = [face for face in self._new_faces if self._parents[face] == input_face]
        # One matrix per child face; its columns are the corners of the child in barycentric
        # coordinates of the input face.
        matrices = [
            [[self.weights(corner).get(vertex, 0.0) for corner in self.corners(face)]
             for vertex in input_corners]
            for face in inside
        ]  # fmt: skip
        right = np.tile(barycentric[:, None], (len(inside), 1, 1))
        local = np.linalg.solve(np.array(matrices), right)[..., 0]
        best = int(local.min(axis=1).argmax())
        return inside[best], local[best]

    def _split_edge_at(self, start: int, end: int, weights: Weights) -> int:
        """Insert a vertex on an edge and bisect the faces at the edge."""
        middle = self._add_vertex(weights)
        for face in sorted(self.faces_at_edge(start, end)):
            corners = self.corners(face)
            halves = [
                tuple(middle if corner == replaced else corner for corner in corners)
                for replaced in (start, end)
            ]
            self._replace_face(face, halves)
        return middle

    def _split_face_at(self, face: int, weights: Weights) -> int:
        """Insert a vertex in a face and split the face into three."""
        middle = self._add_vertex(weights)
        a, b, c = self.corners(face)
        self._replace_face(face, [(a, b, middle), (b, c, middle), (c, a, middle)])
        return middle

    def _add_vertex(self, weights: Weights) -> int:
        """Append a vertex without faces, and return its index."""
        checkpoint()
        vertex = self.n_vertices
        self._new_weights.append(weights)
        self._faces_around[vertex] = set()
        return vertex

    def _parent(self, face: int) -> int:
        """The input face that contains a face."""
        return self._parents.get(face, face)

    def _replace_face(self, face: int, children: Sequence[Corners]) -> None:
        """Replace a living face by new faces, given by their corners, in the same input face."""
        for corner in self.corners(face):
            self.faces_around(corner).discard(face)
        if self._new_faces.pop(face, None) is None:
            self._is_living[face] = False
        for corners in children:
            for corner in corners:
                self.faces_around(corner).add(self.n_faces)
            self._new_faces[self.n_faces] = corners
            self._parents[self.n_faces] = self._parent(face)
            self.n_faces += 1


def _centroid(points: Sequence[Weights]) -> Weights:
    """The centroid of points."""
    share = 1.0 / len(points)
    centroid: Weights = {}
    for point in points:
        for vertex, weight in point.items():
            centroid[vertex] = centroid.get(vertex, 0.0) + share * weight
    return centroid
