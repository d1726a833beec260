"""Virtual splits (section 3.1, Fig. 1): the mesh M' that has every control point as a vertex.

The input mesh is never changed. `SplitMesh` stores the additional vertices and faces, and
`SplitMesh.assemble` returns one connected component as arrays, with the location of every vertex
and face in the input mesh.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy import sparse

from ..geometry import tolerances
from ..geometry.array_types import BoolArray, FloatArray, IntArray
from ..geometry.mesh import Mesh, edge_lengths, triangle_areas, unique_edges
from ..geometry.surface_points import SurfacePoints
from ..progress import checkpoint

Weights = dict[int, float]
"""A point of the surface as weights of input vertices; vertices not listed have weight 0."""


@dataclass(frozen=True)
class WorkingMesh:
    """The split mesh as arrays: n vertices and m faces of one component.

    Attributes
    ----------
    vertices : (n, 3) float array
    faces : (m, 3) int array
    parent_face : (m,) int array
        The input face that contains each face.
    interpolation : (n, V) sparse array
        Row i holds the weights of the input vertices at vertex i, so that
        ``vertices == interpolation @ mesh.vertices``.
    input_vertex : (n,) int array
        The input vertex of each vertex, or -1 if it was inserted.
    """

    vertices: FloatArray
    faces: IntArray
    parent_face: IntArray
    interpolation: sparse.csr_array
    input_vertex: IntArray

    @cached_property
    def _unique_edges(self) -> tuple[IntArray, IntArray]:
        """Edges, and the number of faces at each."""
        return unique_edges(self.faces)

    @property
    def edges(self) -> IntArray:
        """Undirected edges, shape (E, 2), smaller index first, sorted."""
        return self._unique_edges[0]

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
        edges, count = self._unique_edges
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
        self._mesh = mesh
        self._new_weights: list[Weights] = []
        self._new_faces: list[tuple[int, int, int]] = []
        self._new_parents: list[int] = []
        self._new_positions: list[FloatArray] = []
        self._alive = np.ones(len(mesh.faces), dtype=bool)
        self._new_alive = bytearray()
        self._faces_around: dict[int, set[int]] = {}

    def corners(self, face: int) -> tuple[int, int, int]:
        """Vertices of a face."""
        n_input = len(self._mesh.faces)
        if face >= n_input:
            return self._new_faces[face - n_input]
        a, b, c = self._mesh.faces[face]
        return int(a), int(b), int(c)

    def weights(self, vertex: int) -> Weights:
        """Position of a vertex as weights of input vertices."""
        n_input = len(self._mesh.vertices)
        return self._new_weights[vertex - n_input] if vertex >= n_input else {vertex: 1.0}

    def faces_around(self, vertex: int) -> set[int]:
        """Living faces at a vertex."""
        if vertex not in self._faces_around:
            self._faces_around[vertex] = set(self._mesh.faces_at(np.array([vertex])).tolist())
        return self._faces_around[vertex]

    def input_face_with(self, start: int, end: int) -> int:
        """An input face that contains the edge between two vertices."""
        return min(map(self._parent, self.faces_around(start) & self.faces_around(end)))

    def position(self, vertex: int) -> FloatArray:
        """Position of a vertex, shape (3,)."""
        n_input = len(self._mesh.vertices)
        return (
            self._new_positions[vertex - n_input]
            if vertex >= n_input
            else self._mesh.vertices[vertex]
        )

    def positions(self, vertices: IntArray) -> FloatArray:
        """Positions of several vertices, shape (q, 3)."""
        n_input = len(self._mesh.vertices)
        result = self._mesh.vertices[np.minimum(vertices, n_input - 1)]
        for index in np.flatnonzero(vertices >= n_input).tolist():
            result[index] = self._new_positions[vertices[index] - n_input]
        return result

    @property
    def n_vertices(self) -> int:
        """Number of vertices, those of the input mesh included."""
        return len(self._mesh.vertices) + len(self._new_weights)

    @property
    def n_faces(self) -> int:
        """Number of faces, living or not, those of the input mesh included."""
        return len(self._mesh.faces) + len(self._new_faces)

    def living_faces(self, inside: BoolArray) -> IntArray:
        """Corners of the living faces inside selected input faces, shape (m, 3).

        Parameters
        ----------
        inside : (F,) bool array
            Selection of input faces.
        """
        new, parents = self._living_new_faces()
        return np.concatenate([self._mesh.faces[inside & self._alive], new[inside[parents]]])

    def neighbours(self, vertex: int) -> set[int]:
        """Vertices joined to a vertex by an edge."""
        corners = {corner for face in self.faces_around(vertex) for corner in self.corners(face)}
        return corners - {vertex}

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
        if second in self.neighbours(first):
            return True
        for face in sorted(self.faces_around(first)):
            start, end = (corner for corner in self.corners(face) if corner != first)
            across = self.faces_around(start) & self.faces_around(end) & self.faces_around(second)
            if across and self._parent(face) == self._parent(other := min(across)):
                a, b, c = self.corners(face)
                if (start, end) not in ((a, b), (b, c), (c, a)):
                    start, end = end, start
                self._replace_face(face, [(first, start, second)])
                self._replace_face(other, [(first, second, end)])
                return True
        return False

    def split_face(self, face: int) -> int:
        """Insert the centroid of a face, split the face into three, return the new vertex."""
        return self._split_face_at(face, _centroid([self.weights(v) for v in self.corners(face)]))

    def assemble(self, component: int) -> tuple[WorkingMesh, IntArray]:
        """Return one connected component of the input mesh, with all splits, as arrays.

        All splits have to lie on that component.

        Returns
        -------
        WorkingMesh
        (n_vertices,) int array
            Index in the working mesh of each vertex of this mesh, or -1 on other components.
        """
        mesh = self._mesh
        kept = np.flatnonzero(self._alive & (mesh.face_component == component))
        new_faces, new_parents = self._living_new_faces()

        faces = np.concatenate([mesh.faces[kept], new_faces])
        used = np.unique(faces)
        n_input = len(mesh.vertices)
        renumbered = np.full(n_input + len(self._new_weights), -1, dtype=np.int64)
        renumbered[used] = np.arange(len(used))
        interpolation = self._interpolation(used)
        working = WorkingMesh(
            vertices=interpolation @ mesh.vertices,
            faces=renumbered[faces],
            parent_face=np.concatenate([kept, new_parents]),
            interpolation=interpolation,
            input_vertex=np.where(used < n_input, used, -1),
        )
        return working, renumbered

    def _interpolation(self, used: IntArray) -> sparse.csr_array:
        """Matrix of the weights of input vertices, with one row for each vertex in ``used``."""
        n_input = len(self._mesh.vertices)
        kept = used[used < n_input]
        new = [self._new_weights[vertex - n_input] for vertex in used[len(kept) :]]
        columns = np.concatenate([kept, *(list(weights) for weights in new)])
        values = np.concatenate([np.ones(len(kept)), *(list(w.values()) for w in new)])
        ends = len(kept) + np.cumsum([0, *map(len, new)])
        indptr = np.concatenate([np.arange(len(kept)), ends])
        matrix = sparse.csr_array((values, columns, indptr), shape=(len(used), n_input))
        matrix.sort_indices()
        return matrix

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
        self, input_face: int, input_corners: tuple[int, int, int], barycentric: FloatArray
    ) -> tuple[int, FloatArray]:
        """The living face that contains a point of an input face, and its barycentrics there."""
        if self._alive[input_face]:
            return input_face, barycentric
        n_input = len(self._mesh.faces)
        inside = [
            n_input + child
            for child, parent in enumerate(self._new_parents)
            if parent == input_face and self._new_alive[child]
        ]
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
        for face in sorted(self.faces_around(start) & self.faces_around(end)):
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

    def _living_new_faces(self) -> tuple[IntArray, IntArray]:
        """Corners of the living faces created by splits, and the input faces that contain them."""
        new = np.flatnonzero(np.frombuffer(bytes(self._new_alive), dtype=bool))
        faces = np.array(self._new_faces, dtype=np.int64).reshape(-1, 3)
        parents = np.array(self._new_parents, dtype=np.int64)
        return faces[new], parents[new]

    def _add_vertex(self, weights: Weights) -> int:
        """Append a vertex without faces, and return its index."""
        checkpoint()
        vertex = self.n_vertices
        self._new_weights.append(weights)
        corners = self._mesh.vertices[list(weights)]
        self._new_positions.append(np.fromiter(weights.values(), dtype=np.float64) @ corners)
        self._faces_around[vertex] = set()
        return vertex

    def _parent(self, face: int) -> int:
        """The input face that contains a face."""
        n_input = len(self._mesh.faces)
        return face if face < n_input else self._new_parents[face - n_input]

    def _replace_face(self, face: int, children: list[tuple[int, ...]]) -> None:
        """Replace a living face by new faces, given by their corners, in the same input face."""
        n_input = len(self._mesh.faces)
        parent = self._parent(face)
        if face < n_input:
            self._alive[face] = False
        else:
            self._new_alive[face - n_input] = False
        for corner in self.corners(face):
            self.faces_around(corner).discard(face)
        for a, b, c in children:
            for corner in (a, b, c):
                self.faces_around(corner).add(self.n_faces)
            self._new_faces.append((a, b, c))
            self._new_parents.append(parent)
            self._new_alive.append(True)


def _centroid(points: Sequence[Weights]) -> Weights:
    """The centroid of points."""
    share = 1.0 / len(points)
    centroid: Weights = {}
    for point in points:
        for vertex, weight in point.items():
            centroid[vertex] = centroid.get(vertex, 0.0) + share * weight
    return centroid
