"""Makes manifolds, on which curves are computed, from clean surfaces.

- At an edge of more than two faces, the faces are joined in pairs, and a face that is left over is
  detached. Parts of the surface that have only a vertex in common are separated. The vertices
  there are duplicated.
- If that separates control points, such an edge is divided into pieces, on which different pairs of
  its faces are joined, so that all of its faces are connected.
- Faces are turned over so that every orientable part is consistently oriented.
- Vertices of faces without area that remain are moved in random directions by about a thousandth of
  their shortest edge of non-zero length, so that every face has an area. Copies of a vertex are
  moved apart in the same way.
"""

from __future__ import annotations

from functools import cached_property

import numpy as np

from ..geometry import tolerances
from ..geometry.array_types import FloatArray, IntArray
from ..geometry.grouping import grouped
from ..geometry.mesh import Mesh, edge_keys, joined_corners
from ..geometry.orientation import turned_faces
from ..progress import checkpoint
from .clean_surface import CleanSurface
from .degenerate_faces import degenerate_faces, perturbed
from .edge_subdivision import SubdividedFaces, subdivided
from .face_parts import FaceParts
from .mapped_mesh import MappedMesh

SEGMENTS = 2
"""Number of segments of each piece of an edge. Each copy of the point between them belongs to only
one pair of faces, so no two edges of the result have the same ends."""

MOST_FACES = 100
"""Number of faces at a vertex up to which `is_manifold` walks around the vertices of a mesh."""


def manifold(clean: CleanSurface, usable: IntArray, connected: bool) -> MappedMesh | None:
    """Make a manifold from a clean surface.

    Parameters
    ----------
    clean : CleanSurface
    usable : (u,) int array
        Faces of the given mesh that may be used, ascending.
    connected : bool
        Whether all faces at an edge of more than two faces are connected. Otherwise the straightest
        pairs are joined there.

    Returns
    -------
    MappedMesh or None
        The manifold with its map; None if all faces are connected even without `connected`, or if
        no face remains.
    """
    mesh, parts = clean.mesh, clean.parts
    if len(usable) < len(clean.original.faces):
        parts = parts.taken(np.isin(parts.parent, usable))
    if not len(parts.faces):
        return None
    place = np.arange(len(mesh.vertices))
    if len(parts.faces) == len(mesh.faces) and is_manifold(mesh):
        return None if connected else _with_areas(clean, parts, mesh.vertices, place, 0)
    sides = _Sides(parts.faces)
    several = sides.nonmanifold_edges
    if not several:
        if connected:
            return None
        corners, vertex = sides.cut(sides.plain_pairs, len(mesh.vertices))
        parts = FaceParts(corners, parts.parent, parts.corners)
        return _with_areas(clean, parts, mesh.vertices[vertex], vertex, 0)
    joins = [sides.joins(at_edge, mesh.vertices, connected) for at_edge in several]
    pieces = sides.subdivided([SEGMENTS * len(each) for each in joins], len(mesh.vertices))
    vertices = np.empty((int(pieces.faces.max()) + 1, 3))
    vertices[: len(mesh.vertices)] = mesh.vertices
    new = pieces.faces >= len(mesh.vertices)
    at_corners = mesh.vertices[parts.faces[pieces.parent]]
    vertices[pieces.faces[new]] = np.einsum("fcd,fdk->fck", pieces.corners, at_corners)[new]
    centroid = new[:, 2]  # a new vertex is the last corner of a face only if it is a centroid
    vertices[pieces.faces[centroid, 2]] = at_corners[centroid].mean(axis=1)
    cut_sides = _Sides(pieces.faces)
    pairs = np.concatenate([cut_sides.plain_pairs, _piece_pairs(several, joins, pieces)])
    corners, vertex = cut_sides.cut(pairs, len(vertices))
    of_parents = pieces.corners
    if parts.corners is not None:
        of_parents = of_parents @ parts.corners[pieces.parent]
    parts = FaceParts(corners, parts.parent[pieces.parent], of_parents)
    return _with_areas(clean, parts, vertices[vertex], vertex, len(several))


def is_manifold(mesh: Mesh) -> bool:
    """Whether a mesh is certainly an oriented manifold, so that its faces need no pairing.

    At every edge there are at most two faces, which are consistently oriented and differ in a
    corner, and the faces at each vertex form one fan. The result is False, too, if a vertex has
    more than `MOST_FACES` faces.
    """
    if not mesh.is_oriented or mesh.has_nonmanifold_edges:
        return False
    faces, across = mesh.faces, mesh.face_neighbours
    degree = np.bincount(faces.ravel(), minlength=len(mesh.vertices))
    if degree.max() > MOST_FACES:
        return False
    # Walk around each vertex, from the last face of its fan if the fan is open, otherwise from any
    # face, and count the faces on the way.
    face = np.zeros(len(mesh.vertices), dtype=np.int64)
    for corner in range(3):
        face[faces[:, corner]] = np.arange(len(faces))
    for corner in range(3):
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
    """

    def __init__(self, faces: IntArray) -> None:
        self._faces = faces
        # Corners at the ends of each side, the one with the smaller vertex first.
        corner = 3 * np.arange(len(faces))[:, None]
        first, second = (corner + [1, 2, 0]).ravel(), (corner + [2, 0, 1]).ravel()
        vertices = faces.ravel()
        one, other = vertices[first], vertices[second]
        swapped = one > other
        self._low = np.where(swapped, second, first)
        self._high = np.where(swapped, first, second)
        size = int(vertices.max()) + 1
        self._order, self._first, self._count = grouped(edge_keys(one, other, size))

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
        # Comparing all pairs of many faces would take long.
        if len(sides) > 32:
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
    clean: CleanSurface, parts: FaceParts, vertices: FloatArray, place: IntArray, separated: int
) -> MappedMesh:
    """Build a mapped mesh that is consistently oriented, if possible with areas of all faces.

    Copies of a vertex are moved apart; otherwise a straight trace from one of them would pass
    exactly through another.

    Parameters
    ----------
    clean : CleanSurface
    parts : FaceParts
        Faces of the manifold.
    vertices : (v, 3) float array
        Positions of its vertices.
    place : (v,) int array
        Index of the place of each vertex, equal for copies of one vertex.
    separated : int
        Number of edges of more than two faces.
    """
    original, mesh = clean.original, clean.mesh
    short = tolerances.SAME_POSITION * original.diagonal
    flat = degenerate_faces(vertices, parts.faces, short)
    same = np.array_equal(parts.faces, mesh.faces)
    doubled = np.zeros(len(vertices), dtype=bool)
    if not same:
        doubled[:] = True
        order, first, _ = grouped(place)
        doubled[order[first]] = False
    origin, moved = np.zeros(3), bool(flat.any() or doubled.any())
    if moved:
        # Far from the origin, rounding would remove small moves.
        origin = vertices[parts.faces[0, 0]]
        vertices = perturbed(vertices - origin, parts.faces, short, flat, doubled)
    result = mesh if same and not moved else Mesh(vertices, parts.faces)
    which = turned_faces(result)
    if which.any():
        parts = parts.turned(which)
        result = Mesh(vertices, parts.faces)
    repairs = {
        **clean.repairs,
        "faces turned": int(which.sum()),
        "non-manifold edges separated": separated,
    }
    return MappedMesh(
        original=original,
        mesh=result,
        face=parts.parent,
        corners=parts.corners,
        place=place,
        original_place=clean.place,
        joined=clean.joined,
        removed=clean.removed,
        divisions=clean.divisions,
        origin=origin,
        moved=moved,
        repairs={name: count for name, count in repairs.items() if count},
    )
