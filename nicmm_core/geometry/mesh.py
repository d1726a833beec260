"""Triangle meshes: `Mesh`, which is checked once and immutable, and functions on face arrays."""

from __future__ import annotations

from functools import cached_property
from typing import Any, Protocol, TypeAlias

import igl
import nicmm_kernels
import numpy as np
from numpy.typing import ArrayLike
from scipy import sparse

from ..errors import ArgumentError, MeshError, NicmmError
from ..progress import checkpoint
from .array_types import BoolArray, FloatArray, IntArray
from .grouping import components, grouped
from .tolerances import TINY
from .vectors import lengths

LARGEST, SMALLEST = 1e50, 1e-50
"""Upper bound on coordinates and lower bound on the diagonal of the mesh, so that powers of lengths
stay representable."""

MOST_FACES_PER_TREE = 100_000
"""Maximum number of faces in a bounding-box tree.

Building a tree of this size takes a tenth of a second, during which a design cannot be cancelled.
"""


class Mesh:
    """A triangle mesh with checked arrays and the adjacency that the other modules use.

    Parameters
    ----------
    vertices : (V, 3) array_like of float
        Positions, in any unit.
    faces : (F, 3) array_like of int
        Corner indices of each triangle.

    Attributes
    ----------
    vertices : (V, 3) float array
        A read-only copy.
    faces : (F, 3) int array
        A read-only copy.

    Raises
    ------
    MeshError
        If an array has the wrong shape or type, a position is not finite or too large, an index is
        out of range, a face has a vertex twice, there are no faces, or all vertices of faces have
        the same position.
    """

    def __init__(self, vertices: ArrayLike, faces: ArrayLike) -> None:
        self.vertices = _checked_vertices(vertices)
        self.faces = _checked_faces(faces, len(self.vertices))
        if self.diagonal < SMALLEST:
            raise MeshError(
                f"vertices of all faces lie within {self.diagonal:g}, too close to compute with; "
                "scale the mesh"
            )
        self.vertices.setflags(write=False)
        self.faces.setflags(write=False)

    def __repr__(self) -> str:
        return f"<Mesh: {len(self.vertices)} vertices, {len(self.faces)} faces>"

    @cached_property
    def diagonal(self) -> float:
        """Diagonal of the bounding box of the vertices that faces use, in mesh units."""
        corners = self.vertices[self.referenced]
        return float(np.linalg.norm(np.ptp(corners, axis=0)))

    @cached_property
    def face_areas(self) -> FloatArray:
        """Area of each face, shape (F,), in square mesh units."""
        return triangle_areas(self.vertices, self.faces)

    @cached_property
    def face_normals(self) -> FloatArray:
        """Unit normal of each face, shape (F, 3); zero if the face has no area."""
        normals = area_vectors(self.vertices, self.faces)
        length = lengths(normals.T)
        return normals / np.where(length > 0.0, length, 1.0)[:, None]

    @cached_property
    def opposite_sides(self) -> IntArray:
        """For each side, the same edge as a side of the adjacent face, shape (3 F,).

        Side 3 f + j is opposite corner j of face f. At a boundary edge, or at an edge of more than
        two faces, the entry is the side itself.
        """
        return opposite_sides(self.faces)

    @cached_property
    def face_neighbours(self) -> IntArray:
        """The face across the side opposite each corner, shape (F, 3).

        The entry is -1 at a boundary edge, or at an edge of more than two faces.
        """
        beyond, face = self.opposite_sides.reshape(-1, 3) // 3, np.arange(len(self.faces))[:, None]
        return np.where(beyond == face, -1, beyond)

    @cached_property
    def unoriented_vertices(self) -> IntArray:
        """Vertices of edges that two faces traverse in the same direction, ascending."""
        checkpoint()
        size = len(self.vertices)
        keys = self.faces[:, [1, 2, 0]] * size + self.faces[:, [2, 0, 1]]
        directed, count = np.unique(keys, return_counts=True)
        return np.unique(np.divmod(directed[count > 1], size))

    @cached_property
    def edges(self) -> IntArray:
        """Undirected edges, shape (E, 2), in no particular order."""
        across = self.face_neighbours
        face, corner = np.nonzero(across > np.arange(len(self.faces))[:, None])
        of_two = np.stack([self.faces[face, corner - 2], self.faces[face, corner - 1]], axis=1)
        return np.concatenate([of_two, self.unpaired_edges[0]])

    @cached_property
    def unpaired_edges(self) -> tuple[IntArray, IntArray]:
        """Sorted edges without exactly two faces, (e, 2), and their numbers of faces, (e,)."""
        face, corner = np.nonzero(self.face_neighbours < 0)
        start, end = self.faces[face, corner - 2], self.faces[face, corner - 1]
        size = len(self.vertices)
        return _edges(edge_keys(start, end, size), size)

    @cached_property
    def has_nonmanifold_edges(self) -> bool:
        """Whether any edge has more than two faces."""
        return bool((self.unpaired_edges[1] > 1).any())

    @cached_property
    def is_oriented(self) -> bool:
        """Whether no two faces traverse an edge in the same direction."""
        return not len(self.unoriented_vertices)

    @cached_property
    def for_kernels(self) -> nicmm_kernels.MeshArrays:
        """The mesh as compiled kernels read it."""
        return nicmm_kernels.MeshArrays(
            np.ascontiguousarray(self.vertices),
            np.ascontiguousarray(self.faces),
            self.face_normals,
            np.ascontiguousarray(self.opposite_sides, np.int64),  # 32 bits in NumPy 1 on Windows
            self.is_oriented,
        )

    @cached_property
    def edge_graph(self) -> nicmm_kernels.EdgeGraphArrays:
        """The edges as a graph, for shortest paths."""
        return nicmm_kernels.EdgeGraphArrays(self.for_kernels)

    @cached_property
    def face_trees(self) -> list[tuple[IntArray, igl.AABB]]:
        """Bounding-box trees over parts of the faces, each with the indices of its faces."""
        trees = []
        every = np.arange(len(self.faces))
        for faces in np.split(every, every[MOST_FACES_PER_TREE::MOST_FACES_PER_TREE]):
            checkpoint()
            trees.append((faces, face_tree(self.vertices, self.faces[faces])))
        return trees

    @cached_property
    def mean_edge_length(self) -> float:
        """Mean length of the edges, in mesh units."""
        return float(edge_lengths(self.vertices, self.edges).mean())

    @cached_property
    def vertex_faces(self) -> sparse.csr_array:
        """Incidence of vertices (rows) and faces (columns), shape (V, F), as a CSR pattern."""
        return faces_around(self.faces, len(self.vertices))

    def faces_at(self, vertices: IntArray) -> IntArray:
        """Faces that have at least one of the given vertices, ascending."""
        incidence = self.vertex_faces
        # Up to a few rows, slices of a sparse matrix are faster than indexing.
        if not 0 < len(vertices) <= 8:
            return np.unique(incidence[vertices].indices).astype(np.int64)
        begin, end = incidence.indptr[vertices].tolist(), incidence.indptr[vertices + 1].tolist()
        rows = [incidence.indices[slice(*bounds)] for bounds in zip(begin, end, strict=True)]
        return np.unique(np.concatenate(rows)).astype(np.int64)

    def faces_near(self, vertices: IntArray) -> sparse.csr_array:
        """Faces at vertices, (n, k), and the faces around these, as a CSR pattern of shape (n, F).

        A row has the faces near all k vertices of this row.
        """
        n, k = vertices.shape
        entries = (np.ones(n * k, dtype=np.int32), (np.arange(n).repeat(k), vertices.ravel()))
        chosen = sparse.csr_array(entries, shape=(n, len(self.vertices)))
        incidence = self.vertex_faces.astype(np.int32)  # sums of bytes might overflow to zero
        return chosen @ incidence @ incidence.T @ incidence

    def faces_with(self, vertices: IntArray) -> IntArray:
        """Faces that have all of the given vertices, ascending."""
        around = self.faces_at(vertices[:1])
        holds = (self.faces[around][:, :, None] == vertices).any(axis=1).all(axis=1)
        return around[holds]

    @cached_property
    def face_component(self) -> IntArray:
        """Index of the connected component of each face, shape (F,).

        Faces that share a vertex are connected.
        """
        one, other = self.faces[:, :2].T.ravel(), self.faces[:, 1:].T.ravel()
        return components(len(self.vertices), one, other)[1][self.faces[:, 0]]

    @cached_property
    def referenced(self) -> BoolArray:
        """Whether each vertex belongs to at least one face, shape (V,)."""
        used = np.zeros(len(self.vertices), dtype=bool)
        used[self.faces] = True
        return used


class VerticesAndFaces(Protocol):
    """A mesh of another library, such as a `trimesh.Trimesh`."""

    @property
    def vertices(self) -> Any:
        """Positions, (V, 3)."""

    @property
    def faces(self) -> Any:
        """Corner indices of each triangle, (F, 3)."""


MeshLike: TypeAlias = Mesh | VerticesAndFaces
"""What functions accept as a mesh: a `Mesh`, or any object with `vertices` and `faces`."""


def as_mesh(mesh: MeshLike) -> Mesh:
    """The mesh itself, or a checked copy of another library's mesh.

    Parameters
    ----------
    mesh : Mesh or object with `vertices` and `faces`

    Raises
    ------
    ArgumentError
        If the object has no such attributes.
    MeshError
        If its arrays are not those of a triangle mesh.
    """
    if isinstance(mesh, Mesh):
        return mesh
    try:
        vertices, faces = mesh.vertices, mesh.faces
    except AttributeError:
        raise ArgumentError(
            f"mesh is a {type(mesh).__name__}; pass nicmm_core.Mesh(vertices, faces), an "
            "object with vertices and faces, or the result of from_open3d or from_meshio"
        ) from None
    return Mesh(vertices, faces)


def face_tree(vertices: FloatArray, faces: IntArray) -> igl.AABB:
    """A bounding-box tree of some faces."""
    tree = igl.AABB()
    tree.init(vertices, faces)
    return tree


def real_array(values: ArrayLike) -> FloatArray:
    """Copy values to an array of floats.

    Raises
    ------
    TypeError, ValueError
        If the values cannot be converted, for example complex numbers, text or ragged lists.
    """
    given = np.array(values)
    if np.iscomplexobj(given):
        raise TypeError("they are complex")
    try:
        return given.astype(np.float64)
    except OverflowError as error:  # integers with hundreds of digits
        raise ValueError(str(error)) from error


def whole_numbers(values: ArrayLike) -> IntArray:
    """Copy values to an array of integers.

    Raises
    ------
    TypeError, ValueError, OverflowError
        If the values cannot be converted, or some are not whole numbers.
    """
    given = np.array(values)
    if given.size and not np.issubdtype(given.dtype, np.integer):
        given = real_array(given)
        # Floats represent all integers only below 2^53, and no mesh has that many vertices.
        if not ((np.abs(given) < 2.0**53) & (given == np.round(given))).all():
            raise ValueError("some are not whole numbers")
    return given.astype(np.int64)


def triangle_areas(vertices: FloatArray, faces: IntArray) -> FloatArray:
    """Area of each triangle, shape (F,)."""
    return 0.5 * lengths(area_vectors(vertices, faces).T)


def area_vectors(vertices: FloatArray, faces: IntArray) -> FloatArray:
    """Normals whose lengths are twice the areas of the faces, shape (F, 3)."""
    return nicmm_kernels.area_vectors(*_contiguous(vertices, faces), checkpoint)


def opposite_sides(faces: IntArray) -> IntArray:
    """For each side of faces, (F, 3), the same edge as a side of the adjacent face, (3 F,).

    Where an edge has not two faces, it is the side itself.
    """
    order, first, count = grouped(side_keys(faces))
    one, other = order[first[count == 2]], order[first[count == 2] + 1]
    sides = np.arange(faces.size)
    sides[one], sides[other] = other, one
    return sides


def edge_lengths(vertices: FloatArray, edges: IntArray) -> FloatArray:
    """Length of each edge, shape (E,)."""
    return nicmm_kernels.edge_lengths(*_contiguous(vertices, edges), checkpoint)


def _contiguous(vertices: FloatArray, simplices: IntArray) -> tuple[FloatArray, IntArray]:
    """Arrays as compiled kernels read them."""
    return np.ascontiguousarray(vertices), np.ascontiguousarray(simplices, np.int64)


def feet_on_edges(
    vertices: FloatArray, edges: IntArray, points: IntArray
) -> tuple[FloatArray, FloatArray]:
    """Foot of the perpendicular from a vertex, (E,), to the line of each edge, (E, 2).

    Returns its position as a fraction from the first end to the second, (E,), and the distance of
    the vertex from it, (E,).
    """
    start, end, point = (np.take(vertices, of, axis=0) for of in (*edges.T, points))
    way, offset = end - start, point - start
    squared = np.maximum(np.einsum("ed,ed->e", way, way), TINY)
    share = np.einsum("ed,ed->e", offset, way) / squared
    return share, lengths((offset - share[:, None] * way).T)


def faces_around(faces: IntArray, n_vertices: int) -> sparse.csr_array:
    """Incidence of vertices (rows) and faces (columns), shape (V, F), as a CSR pattern."""
    column = np.repeat(np.arange(len(faces)), 3)
    entries = (np.ones(faces.size, dtype=np.int8), (faces.ravel(), column))
    return sparse.csr_array(entries, shape=(n_vertices, len(faces)))


def unique_edges(faces: IntArray) -> tuple[IntArray, IntArray]:
    """Undirected edges of the faces, and the number of faces at each edge.

    Returns
    -------
    (E, 2) int array
        Vertices of each edge, the smaller index first. The edges are sorted.
    (E,) int array
        Number of faces: 1 on the boundary, 2 inside, more at non-manifold edges.
    """
    return _edges(side_keys(faces), int(faces.max(initial=0)) + 1)


def corners_differ(faces: IntArray) -> BoolArray:
    """Whether each face has three different corners, shape (F,)."""
    one, other, third = faces.T
    return (one != other) & (other != third) & (third != one)


def side_keys(faces: IntArray, size: int | None = None) -> IntArray:
    """A key for the side opposite each corner, shape (3 F,), equal for the sides of one edge.

    ``size`` has to exceed all vertex indices; by default it is computed from the faces.
    """
    size = int(faces.max(initial=0)) + 1 if size is None else size
    return edge_keys(faces[:, [1, 2, 0]], faces[:, [2, 0, 1]], size).ravel()


def adjacent_sides(faces: IntArray) -> tuple[IntArray, IntArray]:
    """Pairs of sides at the same edge, as two (p,) arrays; k - 1 pairs at an edge with k faces.

    Side 3 f + j is opposite corner j of face f.
    """
    keys = side_keys(faces)
    order = np.argsort(keys, kind="stable")
    same = np.flatnonzero(keys[order[1:]] == keys[order[:-1]])
    return order[same], order[same + 1]


def sides_among(faces: IntArray, edges: IntArray) -> BoolArray:
    """Whether the side opposite each corner is one of the given edges, (e, 2); shape (3 F,)."""
    size = int(max(faces.max(initial=0), edges.max(initial=0))) + 1
    return np.isin(side_keys(faces, size), edge_keys(edges[:, 0], edges[:, 1], size))


def side_corners(faces: IntArray) -> IntArray:
    """Indices 3 f + j of the corners at the ends of each side, smaller vertex first, (3 F, 2)."""
    corner = np.arange(faces.size).reshape(-1, 3)
    ends = np.stack([corner[:, [1, 2, 0]], corner[:, [2, 0, 1]]], axis=2).reshape(-1, 2)
    turned = faces.ravel()[ends[:, 0]] > faces.ravel()[ends[:, 1]]
    ends[turned] = ends[turned, ::-1]
    return ends


def joined_corners(faces: IntArray, one: IntArray, other: IntArray) -> tuple[IntArray, IntArray]:
    """Group the corners of faces, given pairs of corners that are connected.

    Parameters
    ----------
    faces : (F, 3) int array
        Corner indices of each triangle.
    one, other : (p,) int array
        Pairs of corners, as indices 3 f + j of corner j of face f.

    Returns
    -------
    (F, 3) int array
        Index of the group of each corner.
    (number of groups,) int array
        Vertex of each group; if its corners have different vertices, that of the last corner.
    """
    n_groups, group = components(faces.size, one, other)
    vertex = np.zeros(n_groups, dtype=np.int64)
    vertex[group] = faces.ravel()
    return group.reshape(-1, 3), vertex


def edge_keys(start: IntArray, end: IntArray, size: int) -> IntArray:
    """One integer key for each edge; keys sort several times faster than rows of two columns."""
    return np.minimum(start, end) * size + np.maximum(start, end)


def _edges(keys: IntArray, size: int) -> tuple[IntArray, IntArray]:
    """Distinct edges among the given keys, (E, 2), and how often each occurs, (E,)."""
    distinct, count = np.unique(keys, return_counts=True)
    return np.stack(np.divmod(distinct, size), axis=1), count


def _checked_vertices(vertices: ArrayLike) -> FloatArray:
    try:
        checked = real_array(vertices)
    except (TypeError, ValueError) as error:
        raise MeshError(
            f"vertices cannot be read as numbers ({error}); pass an array of shape (V, 3)"
        ) from error
    if checked.ndim != 2 or checked.shape[1] != 3:
        raise MeshError(f"vertices has shape {checked.shape}; pass positions of shape (V, 3)")
    bad = ~np.isfinite(checked).all(axis=1)
    if bad.any():
        raise MeshError(
            f"vertices has {bad.sum()} positions that are NaN or infinite, the first at index "
            f"{bad.argmax()}; remove or repair them"
        )
    if checked.size and np.abs(checked).max() > LARGEST:
        raise MeshError(
            f"vertices has coordinates up to {np.abs(checked).max():g}, too large to compute with; "
            f"remove them, or scale the mesh to less than {LARGEST:g}"
        )
    return checked


def _checked_faces(faces: ArrayLike, n_vertices: int) -> IntArray:
    try:
        checked = whole_numbers(faces)
    except (TypeError, ValueError, OverflowError) as error:
        raise MeshError(
            f"faces cannot be read as vertex indices ({error}); pass an integer array of shape "
            "(F, 3), with quads and larger faces triangulated"
        ) from error
    if checked.size == 0:
        raise MeshError("faces is empty; a curve needs a surface of at least one triangle")
    if checked.ndim != 2 or checked.shape[1] != 3:
        raise MeshError(
            f"faces has shape {checked.shape}; pass triangles of shape (F, 3), with quads and "
            "larger faces triangulated"
        )
    check_indices("faces", checked, n_vertices, MeshError)
    repeated = ~corners_differ(checked)
    if repeated.any():
        first = int(repeated.argmax())
        raise MeshError(
            f"faces[{first}] = {checked[first].tolist()} has a vertex twice "
            f"({repeated.sum()} such faces); remove degenerate faces"
        )
    return checked


def check_indices(
    name: str, rows: IntArray, n_vertices: int, error: type[NicmmError] = ArgumentError
) -> None:
    """Raise an error if a row of indices, (n, m), refers to a vertex that does not exist."""
    outside = ((rows < 0) | (rows >= n_vertices)).any(axis=1)
    if outside.any():
        first = int(outside.argmax())
        raise error(
            f"{name}[{first}] = {rows[first].tolist()} refers to vertices that do not exist; "
            f"indices must lie in 0 … {n_vertices - 1}"
        )


def same_mesh(one: Mesh, other: Mesh) -> bool:
    """Whether two meshes have the same vertices and faces."""
    return one is other or (
        np.array_equal(one.vertices, other.vertices) and np.array_equal(one.faces, other.faces)
    )
