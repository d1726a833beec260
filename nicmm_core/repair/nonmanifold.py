"""Makes manifolds, on which curves are computed, from meshes with defects.

The given mesh is not changed.

- Of several faces with the same three corners, only the first is used.
- At an edge of more than two faces, the faces are joined in pairs, and a face that is left over is
  detached. Parts of the surface that have only a vertex in common are separated. The vertices
  there are duplicated.
- If that separates control points, such an edge is divided into pieces, on which different pairs of
  its faces are joined, so that all of its faces are connected.
- If control points are still separated, open edges with the same end positions become one edge, as
  between the triangles of a soup or the two sides of a seam. Their vertices are welded.
- Vertices of faces with no area, or almost none, are moved in random directions by about a
  thousandth of their shortest edge of non-zero length, so that every face has an area.
"""

from __future__ import annotations

from functools import cached_property

import numpy as np

from ..geometry import tolerances
from ..geometry.array_types import FloatArray, IntArray
from ..geometry.grouping import distinct_rows, grouped
from ..geometry.mesh import Mesh, corners_differ, joined_corners
from ..progress import checkpoint
from .degenerate_faces import degenerate_faces, perturbed
from .edge_subdivision import SubdividedFaces, subdivided
from .mapped_mesh import MappedMesh

REPAIRS = 4
"""Number of repair methods, which are tried in turn."""

SEGMENTS = 2
"""Number of segments of each piece of an edge. Each copy of the point between them belongs to only
one pair of faces, so no two edges of the result have the same ends."""

MOST_FACES = 100
"""Number of faces at a vertex up to which `is_manifold` walks around the vertices of a mesh."""

MOST_COMPARED = 32
"""Number of faces at an edge up to which all pairs are compared to find the straightest one."""


def repaired(mesh: Mesh, number: int, usable: IntArray) -> MappedMesh | None:
    """Make a manifold from faces of a mesh.

    Parameters
    ----------
    mesh : Mesh
    number : int
        Index of the method, below `REPAIRS`. Later methods connect more of the surface. Method 0
        joins the straightest pairs of faces at an edge of more than two faces. Method 1 connects
        all faces at such an edge. Methods 2 and 3 do the same as 0 and 1, and also join open edges
        with the same end positions.
    usable : (u,) int array
        Faces that may be used, ascending.

    Returns
    -------
    MappedMesh or None
        The manifold with its map; None if the method joins no more than the previous ones.
    """
    connected = number % 2 == 1
    welded = np.arange(len(mesh.vertices))
    if number < 2 and len(usable) == len(mesh.faces) and is_manifold(mesh):
        return (
            None
            if connected
            else _with_areas(mesh, welded, mesh.faces, mesh.vertices, usable, None, welded)
        )
    if number >= 2:
        welded = welded_vertices(mesh)
        if (welded == np.arange(len(welded))).all():
            return None
    kept = usable
    if mesh.has_nonmanifold_edges or number >= 2 or _has_lone_twins(mesh):
        kept = usable[_without_twins(welded[mesh.faces[usable]])]
    sides = _Sides(mesh.faces[kept], welded)
    if not sides.nonmanifold_edges:
        if connected:
            return None
        corners, vertex = sides.cut(sides.plain_pairs, len(mesh.vertices))
        vertices, place = mesh.vertices[vertex], welded[vertex]
        return _with_areas(mesh, welded, corners, vertices, kept, None, place)
    joins = [sides.joins(at_edge, mesh.vertices, connected) for at_edge in sides.nonmanifold_edges]
    parts = sides.subdivided([SEGMENTS * len(pieces) for pieces in joins], len(mesh.vertices))
    vertices = np.empty((int(parts.faces.max()) + 1, 3))
    vertices[: len(mesh.vertices)] = mesh.vertices
    face = kept[parts.parent]
    new = parts.faces >= len(mesh.vertices)
    corners = mesh.vertices[mesh.faces[face]]
    vertices[parts.faces[new]] = np.einsum("fcd,fdk->fck", parts.corners, corners)[new]
    centroid = new[:, 2]  # a new vertex is the last corner of a face only if it is a centroid
    vertices[parts.faces[centroid, 2]] = corners[centroid].mean(axis=1)
    place = np.concatenate([welded, np.arange(len(welded), len(vertices))])
    pieces = _Sides(parts.faces, place)
    pairs = np.concatenate(
        [pieces.plain_pairs, _piece_pairs(sides.nonmanifold_edges, joins, parts)]
    )
    corners, vertex = pieces.cut(pairs, len(vertices))
    vertices, place = vertices[vertex], place[vertex]
    return _with_areas(mesh, welded, corners, vertices, face, parts.corners, place)


def is_manifold(mesh: Mesh) -> bool:
    """Whether a mesh is certainly an oriented manifold, so that its faces need no pairing.

    At every edge there are at most two faces, which are consistently oriented and differ in a
    corner, and the faces at each vertex form one fan. The result is False, too, if a vertex has
    more than `MOST_FACES` faces.
    """
    if not mesh.is_oriented or mesh.has_nonmanifold_edges or _has_lone_twins(mesh):
        return False
    faces, across = mesh.faces, mesh.face_neighbours
    degree = np.bincount(faces.ravel(), minlength=len(mesh.vertices))
    if degree.max() > MOST_FACES:
        return False
    # Walk around each vertex, from the last face of its fan if the fan is open, otherwise from any
    # face, and count the faces on the way.
    face = np.zeros(len(mesh.vertices), dtype=np.int64)
    for corner in range(3):
        checkpoint()
        face[faces[:, corner]] = np.arange(len(faces))
    for corner in range(3):
        checkpoint()
        last = np.flatnonzero(across[:, corner - 1] < 0)
        face[faces[last, corner]] = last
    vertex = np.flatnonzero(degree)
    face = first = face[vertex]
    visited = np.zeros(len(degree), dtype=np.int64)
    while len(vertex):
        checkpoint()
        visited[vertex] += 1
        corner = (faces[face] == vertex[:, None]).argmax(axis=1)
        face = across[face, corner - 2]
        going = (face >= 0) & (face != first)
        vertex, face, first = vertex[going], face[going], first[going]
    return bool((visited == degree).all())


def welded_vertices(mesh: Mesh) -> IntArray:
    """For each vertex of an open edge, the first such vertex at the same position, shape (V,).

    Other vertices keep their indices. Only exactly equal positions are welded. Edges with two faces
    are not open, so closed surfaces that touch each other stay separate.
    """
    edges, count = mesh.unpaired_edges
    on_rim = np.zeros(len(mesh.vertices), dtype=bool)
    on_rim[edges[count == 1]] = True
    rim = np.flatnonzero(on_rim)
    welded = np.arange(len(mesh.vertices))
    first, place = distinct_rows(mesh.vertices[rim])
    welded[rim] = rim[first[place]]
    return welded


def _has_lone_twins(mesh: Mesh) -> bool:
    """Whether two faces have the same corners, and at least two of their edges no other faces."""
    one, other, third = mesh.face_neighbours.T
    alike = ((one == other) & (one >= 0)) | ((other == third) & (other >= 0))
    return bool((alike | ((third == one) & (third >= 0))).any())


def _without_twins(faces: IntArray) -> IntArray:
    """Indices of the faces that do not have the same corners as an earlier face, ascending."""
    return np.sort(distinct_rows(np.sort(faces, axis=1))[0])


Joins = list[IntArray]
"""For each piece of an edge, the pairs of sides that are joined there, (p, 2)."""


def _piece_pairs(
    nonmanifold_edges: list[IntArray], joins: list[Joins], parts: SubdividedFaces
) -> IntArray:
    """Pairs of sides of the subdivided faces joined at edges of more than two faces, (p, 2)."""
    pairs = []
    for at_edge, pieces in zip(nonmanifold_edges, joins, strict=True):
        checkpoint()
        child = parts.first_child[at_edge]
        for number, chosen in enumerate(pieces):
            for segment in range(SEGMENTS * number, SEGMENTS * (number + 1)):
                pairs.append(3 * (child[chosen] + segment) + 2)
    return np.concatenate(pairs)


class _Sides:
    """The sides of faces, three for each face, grouped by edge.

    Side 3 f + j is opposite corner j of face f.

    Parameters
    ----------
    faces : (f, 3) int array
        Corner indices of each triangle.
    welded : (V,) int array
        Vertex that represents each vertex when faces are joined.
    """

    def __init__(self, faces: IntArray, welded: IntArray) -> None:
        self._faces = faces
        checkpoint()
        # Corners at the ends of each side, the one with the smaller welded vertex first. If both
        # ends are welded to one vertex, the original vertices are compared.
        corner = 3 * np.arange(len(faces))[:, None]
        first, second = (corner + [1, 2, 0]).ravel(), (corner + [2, 0, 1]).ravel()
        vertices = faces.ravel()
        checkpoint()
        one = welded[vertices[first]]
        other = welded[vertices[second]]
        checkpoint()
        swapped = (one > other) | ((one == other) & (vertices[first] > vertices[second]))
        self._low = np.where(swapped, second, first)
        self._high = np.where(swapped, first, second)
        checkpoint()
        size = int(vertices.max()) + 1
        keys = np.minimum(one, other) * size + np.maximum(one, other)
        collapsed = np.flatnonzero(one == other)  # such a side joins nothing
        keys[collapsed] = size * size + collapsed
        del one, other, swapped, first, second
        self._order, self._first, self._count = grouped(keys)

    @cached_property
    def plain_pairs(self) -> IntArray:
        """The two sides of each edge with two faces, shape (p, 2)."""
        first = self._first[self._count == 2]
        return np.stack([self._order[first], self._order[first + 1]], axis=1)

    @cached_property
    def nonmanifold_edges(self) -> list[IntArray]:
        """Sides of each edge with more than two faces."""
        several = self._count > 2
        return [
            self._order[first : first + count]
            for first, count in zip(self._first[several], self._count[several], strict=True)
        ]

    def joins(self, at_edge: IntArray, vertices: FloatArray, connected: bool) -> Joins:
        """Pairs in which the sides of one edge are joined, as positions in `at_edge`.

        On the first piece of the edge, the straightest pairs are joined. If all sides are to be
        connected, further pieces join these pairs with one another, like the corners of a
        hypercube, along a different axis on each piece. So q faces need about log₂ q pieces.
        """
        checkpoint()
        straight = self._straightest(at_edge, vertices)
        pieces = [straight]
        if not connected:
            return pieces
        single = np.setdiff1d(np.arange(len(at_edge)), straight)
        groups = [*straight.tolist(), *([place] for place in single.tolist())]
        for bit in range((len(groups) - 1).bit_length()):
            pairs = []
            for here, group in enumerate(groups):
                there = here ^ (1 << bit)
                if there >= len(groups):
                    pairs += [group] if len(group) == 2 else []
                elif here < there:
                    pairs += [list(pair) for pair in zip(group, groups[there], strict=False)]
            pieces.append(np.array(pairs))
        return pieces

    def subdivided(self, segments: list[int], n_vertices: int) -> SubdividedFaces:
        """Subdivide the edges of more than two faces into the given numbers of segments."""
        edge_of_side = np.full(self._faces.size, -1)
        for number, at_edge in enumerate(self.nonmanifold_edges):
            edge_of_side[at_edge] = number
        counts = np.array(segments, dtype=np.int64)
        return subdivided(self._faces, self._low, self._high, edge_of_side, counts, n_vertices)

    def _straightest(self, sides: IntArray, vertices: FloatArray) -> IntArray:
        """Pairs of positions in ``sides``, which belong to one edge, the straightest pair first.

        At most one side is left over.
        """
        corner = self._faces.ravel()
        start, end = vertices[corner[self._low[sides]]], vertices[corner[self._high[sides]]]
        edge = end - start
        outward = vertices[corner[sides]] - start
        squared = np.maximum((edge * edge).sum(axis=1, keepdims=True), tolerances.TINY)
        outward -= (outward * edge).sum(axis=1, keepdims=True) / squared * edge
        length = np.linalg.norm(outward, axis=1, keepdims=True)
        outward /= np.maximum(length, tolerances.TINY)
        if len(sides) > MOST_COMPARED:
            return _opposite(outward)
        straight = outward @ outward.T
        np.fill_diagonal(straight, np.inf)
        pairs = []
        for _ in range(len(sides) // 2):
            one, other = np.unravel_index(straight.argmin(), straight.shape)
            pairs.append([one, other])
            straight[[one, other]] = straight[:, [one, other]] = np.inf
        return np.array(pairs)

    def cut(self, pairs: IntArray, n_vertices: int) -> tuple[IntArray, IntArray]:
        """Duplicate vertices so that faces share them only where pairs of sides join the faces.

        Returns
        -------
        (f, 3) int array
            New corner indices of each triangle.
        (v,) int array
            Original vertex of each vertex.
        """
        one, other = pairs.T
        checkpoint()
        rows = np.concatenate([self._low[one], self._high[one]])
        columns = np.concatenate([self._low[other], self._high[other]])
        group, source = joined_corners(self._faces, rows, columns)
        # One of the copies keeps the index of the vertex.
        order, begin, _ = grouped(source)
        new = np.delete(np.arange(len(source)), order[begin])
        checkpoint()
        number = source.copy()
        number[new] = n_vertices + np.arange(len(new))
        return number[group], np.concatenate([np.arange(n_vertices), source[new]])


def _opposite(outward: FloatArray) -> IntArray:
    """Pairs of about opposite directions around a line, (q, 3), by the order of their angles."""
    axes = np.linalg.svd(outward, full_matrices=False)[2][:2]
    order = np.argsort(np.arctan2(outward @ axes[1], outward @ axes[0]), kind="stable")
    half = len(order) // 2
    return np.stack([order[:half], order[half : 2 * half]], axis=1)


def _with_areas(
    mesh: Mesh,
    original_place: IntArray,
    faces: IntArray,
    vertices: FloatArray,
    face: IntArray,
    corners: FloatArray | None,
    place: IntArray,
) -> MappedMesh:
    """Build a mapped mesh, with vertices moved so that every face has an area if possible.

    Copies of a vertex of the original are moved apart.
    """
    # If both ends of a side are welded into one vertex, its face is left out.
    whole = corners_differ(faces)
    if not whole.all():
        faces, face = faces[whole], face[whole]
        corners = None if corners is None else corners[whole]
    checkpoint()
    short = tolerances.SAME_POSITION * mesh.diagonal
    flat = degenerate_faces(vertices, faces, short)
    if not flat.any() and np.array_equal(faces, mesh.faces):
        return MappedMesh(mesh, mesh, face, None, place, original_place)
    origin = np.zeros(3)
    # Copies of a vertex are moved, since a straight trace from one would pass exactly through
    # another.
    doubled = np.ones(len(vertices), dtype=bool)
    order, first, _ = grouped(place)
    doubled[order[first]] = False
    checkpoint()
    if flat.any() or doubled.any():
        # Far from the origin, rounding would remove small moves.
        origin = vertices[faces[0, 0]]
        vertices = perturbed(vertices - origin, faces, short, flat, doubled)
    return MappedMesh(mesh, Mesh(vertices, faces), face, corners, place, original_place, origin)
