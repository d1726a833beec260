"""The copy that curves are computed on where a mesh has defects; the mesh itself stays as it is.

A sound copy has the faces of the mesh, with their corners in the same order. So a face with
barycentrics is the same point of both, and a curve on the copy is one on the mesh, as simple as it
is there. Three things may differ:

- Of faces with the same three corners only the first is there.
- Where more than two faces share an edge they are joined two by two, and what is left over is cut
  off. Where parts of the surface have no more than a vertex in common they are apart. Vertices
  there are doubled.
- Where that leaves points apart, open edges whose ends are at the same places are one edge: the
  triangles of a soup, or the two sides of a seam. Their vertices are one.
- Vertices of faces with no area, or hardly any, are moved by a thousandth of their shortest edge
  that has a length, each its own way, so that every face has an area.
"""

from __future__ import annotations

from functools import cached_property

import numpy as np
from scipy import sparse
from scipy.sparse import csgraph

from . import tolerances
from .array_types import FloatArray, IntArray
from .by_parts import components, distinct_rows, grouped
from .flat_faces import flat_faces, with_areas
from .mesh import Mesh
from .mesh_copy import MeshCopy
from .progress import checkpoint

ROUNDS = 8
"""Of cutting one edge further where a cut does not come apart."""

SOUND_COPIES = 4
"""Ways in which faces are joined, one after the other."""

STARTS = 8
"""Faces of the first point from which ways to the others are looked for."""


def sound_copy(mesh: Mesh, number: int) -> MeshCopy | None:
    """A copy of a mesh, for points that the copies before separate.

    Parameters
    ----------
    mesh : Mesh
    number : int
        Below `SOUND_COPIES`. 0: where more than two faces share an edge the surface goes straight
        on. 1: as many parts of it are joined there as can be. 2 and 3: the same, and open edges at
        the same place are one edge.

    Returns
    -------
    MeshCopy or None
        None where it joins no more than those before.
    """
    linked = number % 2 == 1
    if number < 2:
        return _joined_copy(mesh, np.arange(len(mesh.vertices)), linked)
    welded = welded_vertices(mesh)
    if (welded == np.arange(len(welded))).all():
        return None
    return _joined_copy(mesh, welded, linked)


def led_copy(mesh: Mesh, points: list[IntArray]) -> MeshCopy | None:
    """The copy in which faces are joined on a way from point to point, for some points only.

    Parameters
    ----------
    mesh : Mesh
    points : list of (c,) int array
        The faces that each point lies in.

    Returns
    -------
    MeshCopy or None
        None where no way was found that passes every side of a face at most once.
    """
    welded = welded_vertices(mesh)
    kept = _without_twins(welded[mesh.faces])
    sides = _Sides(mesh.faces[kept], welded)
    if not sides.branches:
        return None
    place = np.full(len(mesh.faces), -1)
    place[kept] = np.arange(len(kept))
    among = [place[faces][place[faces] >= 0] for faces in points]
    if not all(map(len, among)):
        return None
    pairs = sides.led(mesh.vertices, among)
    return None if pairs is None else _cut_copy(mesh, sides, pairs, kept, welded)


def welded_vertices(mesh: Mesh) -> IntArray:
    """For vertices of open edges the first one at the same place, others as they are, shape (V,).

    Only places whose coordinates are the same to the last digit are one. Edges that two faces have
    are closed already, so closed surfaces that touch each other stay apart.
    """
    edges, count = mesh.unpaired_edges
    checkpoint()
    on_rim = np.zeros(len(mesh.vertices), dtype=bool)
    on_rim[edges[count == 1]] = True
    rim = np.flatnonzero(on_rim)
    welded = np.arange(len(mesh.vertices))
    checkpoint()
    first, place = distinct_rows(mesh.vertices[rim])
    welded[rim] = rim[first[place]]
    return welded


def _joined_copy(mesh: Mesh, welded: IntArray, linked: bool) -> MeshCopy | None:
    """The copy in which sides of faces whose ends are the same welded vertices may be joined."""
    is_welded = bool((welded != np.arange(len(welded))).any())
    checkpoint()
    kept = np.arange(len(mesh.faces))
    if mesh.branches or is_welded:
        kept = _without_twins(welded[mesh.faces])
    sides = _Sides(mesh.faces[kept], welded)
    if linked and not sides.branches:
        return None
    joined = sides.linked if linked else sides.straight_on
    return _cut_copy(mesh, sides, joined(mesh.vertices), kept, welded)


def _cut_copy(
    mesh: Mesh, sides: _Sides, pairs: IntArray, kept: IntArray, welded: IntArray
) -> MeshCopy:
    """The copy of some faces, joined where pairs of their sides are one."""
    corners, vertex = sides.cut(pairs, len(mesh.vertices))
    # A side whose ends have been welded to one has no length, and its face no area.
    whole = (corners != np.roll(corners, 1, axis=1)).all(axis=1)
    if not whole.all():
        corners, kept = corners[whole], kept[whole]
    return _with_areas(mesh, corners, vertex, kept, welded[vertex])


def _without_twins(faces: IntArray) -> IntArray:
    """Indices of the faces without those whose corners an earlier one has, ascending."""
    return np.sort(distinct_rows(np.sort(faces, axis=1))[0])


class _Sides:
    """The sides of faces, three each, and which of them are one edge.

    Side 3 f + j lies opposite corner j of face f.

    Parameters
    ----------
    faces : (f, 3) int array
    welded : (V,) int array
        Which vertex each counts as where faces are joined.
    """

    def __init__(self, faces: IntArray, welded: IntArray) -> None:
        self._faces = faces
        checkpoint()
        # Corners at the ends of each side, that with the smaller vertex first. Where both ends are
        # welded to one, the vertices themselves decide.
        corner = 3 * np.arange(len(faces))[:, None]
        first, second = (corner + [1, 2, 0]).ravel(), (corner + [2, 0, 1]).ravel()
        checkpoint()
        vertices = faces.ravel()
        one = welded[vertices[first]]
        checkpoint()
        other = welded[vertices[second]]
        checkpoint()
        swapped = (one > other) | ((one == other) & (vertices[first] > vertices[second]))
        checkpoint()
        self._low = np.where(swapped, second, first)
        self._high = np.where(swapped, first, second)
        checkpoint()
        size = int(vertices.max()) + 1
        keys = np.minimum(one, other) * size + np.maximum(one, other)
        checkpoint()
        nowhere = np.flatnonzero(one == other)  # such a side joins nothing
        keys[nowhere] = size * size + nowhere
        del one, other, swapped, first, second
        self._order, self._first, self._count = grouped(keys)

    @property
    def branches(self) -> bool:
        """Whether some edge has more than two."""
        return bool((self._count > 2).any())

    @cached_property
    def plain_pairs(self) -> IntArray:
        """Sides of edges that two faces have, shape (p, 2)."""
        first = self._first[self._count == 2]
        checkpoint()
        return np.stack([self._order[first], self._order[first + 1]], axis=1)

    @cached_property
    def _branching(self) -> list[IntArray]:
        """Sides of each edge that more faces have."""
        several = self._count > 2
        return [
            self._order[first : first + count]
            for first, count in zip(self._first[several], self._count[several], strict=True)
        ]

    def straight_on(self, vertices: FloatArray) -> IntArray:
        """Pairs of sides that are joined, shape (p, 2): those that go on most straightly."""
        pairs = [self.plain_pairs]
        for sides in self._branching:
            checkpoint()
            pairs.append(self._straightest(sides, vertices))
        return np.concatenate(pairs)

    def linked(self, vertices: FloatArray) -> IntArray:
        """Pairs of sides that join all parts of the surface that meet at an edge.

        Edges where the same parts meet share the work: on each run of them two parts are joined.
        """
        n_faces = len(self._faces)
        part = components(n_faces, *(self.plain_pairs // 3).T)[1]
        groups: dict[tuple[int, ...], list[IntArray]] = {}
        for sides in self._branching:
            parts = tuple(np.unique(part[sides // 3]).tolist())
            groups.setdefault(parts, []).append(sides)
        pairs = [self.plain_pairs]
        for parts, edges in groups.items():
            checkpoint()
            if len(parts) == 1:
                pairs += [self._straightest(sides, vertices) for sides in edges]
                continue
            ends = vertices[self._faces.ravel()[[self._low[s[0]] for s in edges]]]
            along = np.linalg.svd(ends - ends.mean(axis=0), full_matrices=False)[2][0]
            in_order = np.argsort(ends @ along, kind="stable")
            for run, some in enumerate(np.array_split(in_order, len(parts) - 1)):
                for place in some.tolist():
                    sides = edges[place]
                    here = [sides[part[sides // 3] == parts[run + step]][0] for step in (0, 1)]
                    pairs.append(np.array([here]))
        return np.concatenate(pairs)

    def led(self, vertices: FloatArray, points: list[IntArray]) -> IntArray | None:
        """Pairs of sides that join faces on a way to each of some points, shape (p, 2).

        Parameters
        ----------
        vertices : (V, 3) float array
        points : list of (c,) int array
            The faces that each point lies in.

        Returns
        -------
        (p, 2) int array or None
            Each side at most once; None where no such way was found.
        """
        pairs = [self.plain_pairs]
        for sides in self._branching:
            pairs.append(np.stack(np.triu_indices(len(sides), 1), axis=1))
            pairs[-1] = sides[pairs[-1]]
        every = np.concatenate(pairs)
        centre = vertices[self._faces].mean(axis=1)
        faces = every // 3
        length = np.linalg.norm(centre[faces[:, 0]] - centre[faces[:, 1]], axis=1)
        length = np.maximum(length, np.finfo(float).tiny)  # a zero would not be an arc
        for start in points[0][:STARTS].tolist():
            taken = self._taken_on_ways(every, length, start, points[1:])
            if taken is not None:
                break
        else:
            return None
        used = np.zeros(self._faces.size, dtype=bool)
        used[every[taken]] = True
        chosen = [self.plain_pairs, every[taken[taken >= len(self.plain_pairs)]]]
        for sides in self._branching:
            left = sides[~used[sides]]
            if len(left) > 1:
                chosen.append(self._straightest(left, vertices))
        return np.concatenate(chosen)

    def _taken_on_ways(
        self, every: IntArray, length: FloatArray, start: int, points: list[IntArray]
    ) -> IntArray | None:
        """Which of all pairs of sides, (q, 2), a way from a face to each of some points takes."""
        n_faces = len(self._faces)
        partner = np.full(self._faces.size, -1)
        reached = np.zeros(n_faces, dtype=bool)
        reached[start] = True
        taken: list[int] = []
        for among in points:
            checkpoint()
            one, other = every.T
            free = (partner[one] == other) | ((partner[one] < 0) & (partner[other] < 0))
            arcs = np.flatnonzero(free)
            # Of several sides that two faces have in common the shortest way is as good as any.
            ends = np.sort(every[arcs] // 3, axis=1)
            _, first = np.unique(ends @ [n_faces, 1], return_index=True)
            arcs, ends = arcs[first], ends[first]
            entries = (
                np.concatenate([length[arcs], length[arcs]]),
                np.concatenate([ends, ends[:, ::-1]]).T,
            )
            graph = sparse.csr_array(entries, shape=(n_faces, n_faces))
            distance, previous, _ = csgraph.dijkstra(
                graph, indices=np.flatnonzero(reached), min_only=True, return_predecessors=True
            )
            face = int(among[distance[among].argmin()])
            if not np.isfinite(distance[face]):
                return None
            number = dict(zip(map(tuple, ends.tolist()), arcs.tolist(), strict=True))
            while not reached[face]:
                reached[face] = True
                before = int(previous[face])
                pair = number[min(face, before), max(face, before)]
                taken.append(pair)
                partner[every[pair]] = every[pair][::-1]
                face = before
        return np.array(taken, dtype=np.int64)

    def _straightest(self, sides: IntArray, vertices: FloatArray) -> IntArray:
        """Pairs of the sides of one edge, the straightest first, until fewer than two are left."""
        corner = self._faces.ravel()
        start, end = vertices[corner[self._low[sides]]], vertices[corner[self._high[sides]]]
        edge = end - start
        outward = vertices[corner[sides]] - start
        squared = np.maximum((edge * edge).sum(axis=1, keepdims=True), np.finfo(float).tiny)
        outward -= (outward * edge).sum(axis=1, keepdims=True) / squared * edge
        length = np.linalg.norm(outward, axis=1, keepdims=True)
        outward /= np.maximum(length, np.finfo(float).tiny)
        straight = outward @ outward.T
        np.fill_diagonal(straight, np.inf)
        pairs = []
        for _ in range(len(sides) // 2):
            one, other = np.unravel_index(straight.argmin(), straight.shape)
            pairs.append([sides[one], sides[other]])
            straight[[one, other]] = straight[:, [one, other]] = np.inf
        return np.array(pairs)

    def cut(self, pairs: IntArray, n_vertices: int) -> tuple[IntArray, IntArray]:
        """Faces whose corners are one vertex only where pairs of sides join them.

        Returns
        -------
        (f, 3) int array
            Corners.
        (v,) int array
            The vertex that each vertex was.
        """
        corner = self._faces.ravel()
        one, other = pairs.T
        checkpoint()
        rows = np.concatenate([self._low[one], self._high[one]])
        checkpoint()
        columns = np.concatenate([self._low[other], self._high[other]])
        n_labels, label = components(len(corner), rows, columns)
        source = np.zeros(n_labels, dtype=np.int64)
        source[label] = corner
        # One of the copies keeps the number of the vertex.
        order, begin, _ = grouped(source)
        first = order[begin]
        number = np.full(n_labels, -1)
        number[first] = source[first]
        new = np.flatnonzero(number < 0)
        checkpoint()
        number[new] = n_vertices + np.arange(len(new))
        checkpoint()
        corners = number[label]
        vertex = np.concatenate([np.arange(n_vertices), source[new]])
        for _ in range(ROUNDS):
            checkpoint()
            corners, vertex, changed = self._slit(pairs, corners, vertex)
            if not changed:
                break
        return corners.reshape(-1, 3), vertex

    def _slit(
        self, pairs: IntArray, corners: IntArray, vertex: IntArray
    ) -> tuple[IntArray, IntArray, bool]:
        """Give corners a vertex of their own where a cut ends at both ends of an edge.

        Then the faces on both sides of the cut still have both vertices in common. A further edge
        is cut for it. Gives the corners, the vertices, and whether anything had to be done.
        """
        checkpoint()
        partner = np.arange(len(corners))
        partner[pairs[:, 0]], partner[pairs[:, 1]] = pairs[:, 1], pairs[:, 0]
        own = []
        for sides in self._branching:
            checkpoint()
            ends = np.sort(corners[np.stack([self._low[sides], self._high[sides]])], axis=0)
            for edge in np.unique(ends, axis=1).T:
                here = sides[(ends == edge[:, None]).all(axis=0)]
                groups = {tuple(sorted({int(side), int(partner[side])})) for side in here}
                # What is joined stays where it is before what is cut off.
                own += sorted(groups, key=lambda group: (-len(group), group))[1:]
        corners = corners.copy()
        added = []
        for group in own:
            added.append(vertex[corners[self._low[group[0]]]])
            corners[self._low[list(group)]] = len(vertex) + len(added) - 1
        if not added:
            return corners, vertex, False
        return corners, np.concatenate([vertex, added]), True


def _with_areas(
    mesh: Mesh, faces: IntArray, vertex: IntArray, face: IntArray, place: IntArray
) -> MeshCopy:
    """A copy with these faces, in which every face has an area where that is possible.

    Vertices that stand for one vertex of the mesh are moved apart.
    """
    checkpoint()
    vertices = mesh.vertices[vertex]
    checkpoint()
    short = tolerances.AT_ONE_PLACE * mesh.diagonal
    flat = flat_faces(vertices, faces, short)
    checkpoint()
    if not flat.any() and np.array_equal(faces, mesh.faces):
        return MeshCopy(mesh, mesh, face, vertex)
    origin = np.zeros(3)
    # Straight ways from one copy of a vertex would pass exactly through the others.
    doubled = np.ones(len(vertices), dtype=bool)
    order, first, _ = grouped(place)
    doubled[order[first]] = False
    checkpoint()
    if flat.any() or doubled.any():
        # Far from the origin a small move would be lost to rounding.
        origin = vertices[faces[0, 0]]
        vertices = with_areas(vertices - origin, faces, short, flat, doubled)
    checkpoint()
    return MeshCopy(mesh, Mesh(vertices, faces), face, place, origin)
