"""Cuts a mesh along a curve: the result is the same surface, with the curve as a chain of edges.

Every face that the curve crosses or touches is triangulated. The faces at a cut edge share its new
vertices, so a conforming mesh stays conforming. New vertices have barycentric coordinates in input
faces, so that attributes can be interpolated.
"""

from __future__ import annotations

import itertools
from collections import defaultdict
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from ..arguments import number_between
from ..errors import CurveError
from ..geometry.array_types import BoolArray, FloatArray, IntArray
from ..geometry.curve import SurfaceCurve, checked_curve
from ..geometry.mesh import Mesh, adjacent_sides, sides_among
from ..geometry.surface_points import SurfacePoints, weights_at
from ..geometry.tolerances import ROUNDED
from .chain import Chain, build_chain, points_of, superfluous_points
from .triangulation import ConstraintError, FaceTriangulation

SNAP_CUT = 1e-3
"""Default barycentric coordinate up to which a point snaps to the edge or vertex."""

LARGEST_SNAP = 0.25
"""Largest snap. With a third or more, all coordinates of a point could become zero."""

FLAT = 1e-9
"""Height of a face, relative to its longest side, up to which it counts as without height."""


@dataclass(frozen=True)
class CutMesh:
    """A mesh that has a curve as a chain of its edges.

    Attributes
    ----------
    vertices : (V + n, 3) float array
        Vertices of the input mesh, followed by the new vertices.
    faces : (F', 3) int array
        Unchanged faces in the old order, followed by the parts of cut faces, all with the
        orientation of the input faces.
    source_face : (F',) int array
        The input face of which each face is a part.
    new_face : (n,) int array
        An input face that contains each new vertex.
    new_barycentric : (n, 3) float array
        Barycentric coordinates of each new vertex in that face.
    chain : (m,) int array
        Distinct vertices along the curve, each joined to the next by an edge.
    closed : bool
        Whether the last vertex of the chain is joined to the first.
    chain_point : (m,) int array
        Index of the point of the curve at each vertex of the chain.
    """

    vertices: FloatArray
    faces: IntArray
    source_face: IntArray
    new_face: IntArray
    new_barycentric: FloatArray
    chain: IntArray
    closed: bool
    chain_point: IntArray

    @cached_property
    def mesh(self) -> Mesh:
        """The cut surface as a mesh."""
        return Mesh(self.vertices, self.faces)

    @property
    def chain_edges(self) -> IntArray:
        """Edges along the curve, (m, 2), or (m - 1, 2) if the curve is open."""
        edges = np.stack([self.chain, np.roll(self.chain, -1)], axis=1)
        return edges if self.closed else edges[:-1]

    @cached_property
    def adjacent_faces(self) -> tuple[IntArray, BoolArray]:
        """Pairs of faces with a common edge, (p, 2), and whether the curve runs along it, (p,).

        An edge with k faces has k - 1 pairs.
        """
        one, other = adjacent_sides(self.faces)
        return np.stack([one, other], axis=1) // 3, sides_among(self.faces, self.chain_edges)[one]

    @cached_property
    def directed_chain_edges(self) -> frozenset[tuple[int, int]]:
        """Edges along the curve in both directions, for fast lookup."""
        edges = self.chain_edges.tolist()
        return frozenset((a, b) for a, b in edges) | frozenset((b, a) for a, b in edges)

    def corner_weights(self, mesh: Mesh) -> FloatArray:
        """Barycentric coordinates of each face's corners in its source face, (F', 3, 3).

        Parameters
        ----------
        mesh : Mesh
            The mesh that was cut.
        """
        n_input = len(mesh.vertices)
        theirs = mesh.faces[self.source_face]
        weights = (self.faces[:, :, None] == theirs[:, None, :]).astype(np.float64)
        face, corner = np.nonzero(self.faces >= n_input)
        new = self.faces[face, corner] - n_input
        corners = mesh.faces[self.new_face[new]]
        weights[face, corner] = weights_at(corners, self.new_barycentric[new], theirs[face])
        return weights

    def at_corners(self, mesh: Mesh, values: FloatArray) -> FloatArray:
        """Interpolate values at the corners of faces, such as UV coordinates with seams.

        Parameters
        ----------
        mesh : Mesh
            The mesh that was cut.
        values : (F, 3, ...) float array

        Returns
        -------
        (F', 3, ...) float array
        """
        return np.einsum("fij,fj...->fi...", self.corner_weights(mesh), values[self.source_face])

    def at_vertices(self, mesh: Mesh, values: FloatArray) -> FloatArray:
        """Interpolate values at the vertices, such as weights.

        Parameters
        ----------
        mesh : Mesh
            The mesh that was cut.
        values : (V, ...) float array

        Returns
        -------
        (V + n, ...) float array
        """
        corners = values[mesh.faces[self.new_face]]
        return np.concatenate([values, np.einsum("nj,nj...->n...", self.new_barycentric, corners)])


def cut_mesh(
    mesh: Mesh, curve: SurfaceCurve, snap: float = SNAP_CUT, deviation: float = 0.0
) -> CutMesh:
    """Cut a mesh along a curve on it.

    Parameters
    ----------
    mesh : Mesh
        The mesh that the curve was designed on. It may have boundaries and need not be oriented.
    curve : SurfaceCurve
        A simple curve, closed or open.
    snap : float, default 0.001
        Barycentric coordinate up to which a point snaps to the edge or vertex, to avoid needles,
        except where the curve would then touch itself.
    deviation : float, default 0
        Largest distance, in mesh units, by which the curve may move where points inside faces are
        omitted.

    Returns
    -------
    CutMesh

    Raises
    ------
    CurveError
        If the curve is not on this mesh, or crosses or touches itself.
    ArgumentError
        If ``snap`` or ``deviation`` is out of range.

    Examples
    --------
    >>> import nicmm_core as nicmm
    >>> from nicmm_core import shapes
    >>> mesh = shapes.sphere(3)
    >>> curve = nicmm.design_curve(mesh, [12, 80, 41]).curves[0]
    >>> cut = nicmm.cut_mesh(mesh, curve)
    >>> len(cut.faces) > len(mesh.faces)
    True
    """
    snap = number_between("snap", snap, 0.0, LARGEST_SNAP)
    deviation = number_between("deviation", deviation, 0.0, np.inf, "a length")
    curve, segment_faces = checked_curve(mesh, curve)
    faces, barycentric = curve.faces, curve.barycentric
    must_keep = np.zeros(len(faces), dtype=bool)
    must_keep[curve.control_index[curve.control_index >= 0]] = True
    exact = np.zeros(len(faces), dtype=bool)
    positions = SurfacePoints(faces, barycentric).positions(mesh)
    while True:
        margin = np.where(exact, ROUNDED, max(snap, ROUNDED))
        kept = np.flatnonzero(
            ~superfluous_points(
                positions, barycentric, faces, curve.closed, must_keep | exact, deviation
            )
        )
        chain = build_chain(
            mesh,
            curve.closed,
            faces[kept],
            barycentric[kept],
            segment_faces[kept],
            margin[kept],
            must_keep[kept],
        )
        try:
            cut = _cut(mesh, chain)
            return replace(cut, chain_point=kept[cut.chain_point])
        except _ContactError as contact:
            there = points_of(chain, contact.places, kept, len(faces))
        if exact[there].all():
            raise CurveError(
                f"curve crosses or touches itself near its points {sorted(set(there.tolist()))}; "
                "only a simple curve can be cut"
            )
        exact[there] = True


class _ContactError(Exception):
    """The chain touches itself at some of its places."""

    def __init__(self, places: list[int]) -> None:
        super().__init__(places)
        self.places = places


@dataclass(frozen=True)
class _Places:
    """Indices of the places of a chain, by the vertex, edge or face that contains them."""

    at_vertex: dict[int, int]  # the place at each vertex
    on_edge: dict[tuple[int, int], list[int]]  # in order from the smaller vertex
    in_face: dict[int, list[int]]


def _cut(mesh: Mesh, chain: Chain) -> CutMesh:
    """Cut a mesh along a chain, or raise _ContactError."""
    if len(chain) < (3 if chain.closed else 2):
        raise _ContactError(list(range(len(chain))))
    corners = mesh.faces[chain.faces]
    count = (chain.barycentric > 0.0).sum(axis=1)
    places = _places(chain, corners, count)
    is_new = count > 1
    number = np.cumsum(is_new) - 1 + len(mesh.vertices)
    vertex = np.where(is_new, number, -1)
    for at, place in places.at_vertex.items():
        vertex[place] = at
    segments = _segments_inside(chain, corners, places)

    affected = set(segments) | set(places.in_face) | set(_faces_beside(mesh, places))
    parts: list[tuple[int, int, int]] = []
    source: list[int] = []
    for face in sorted(affected):
        triangles = _face_parts(mesh, face, chain, places, vertex, segments.get(face, []))
        parts += triangles
        source += [face] * len(triangles)

    stays = np.ones(len(mesh.faces), dtype=bool)
    stays[sorted(affected)] = False
    new_face, new_barycentric = chain.faces[is_new], chain.barycentric[is_new]
    corner_positions = mesh.vertices[mesh.faces[new_face]]
    positions = (new_barycentric[:, :, None] * corner_positions).sum(axis=1)
    return CutMesh(
        vertices=np.concatenate([mesh.vertices, positions]),
        faces=np.concatenate([mesh.faces[stays], np.array(parts, np.int64).reshape(-1, 3)]),
        source_face=np.concatenate([np.flatnonzero(stays), np.array(source, dtype=np.int64)]),
        new_face=new_face,
        new_barycentric=new_barycentric,
        chain=vertex,
        closed=chain.closed,
        chain_point=chain.point,
    )


def _places(chain: Chain, corners: IntArray, count: IntArray) -> _Places:
    """Sort places by their location; raise _ContactError if two of them coincide."""
    at_vertex: dict[int, int] = {}
    on_edge: dict[tuple[int, int], list[int]] = defaultdict(list)
    in_face: dict[int, list[int]] = defaultdict(list)
    share = np.zeros(len(chain))
    for place, (row, weights) in enumerate(zip(corners, chain.barycentric, strict=True)):
        if count[place] == 3:
            in_face[int(chain.faces[place])].append(place)
            continue
        (here,) = np.nonzero(weights > 0.0)
        if count[place] == 1:
            vertex = int(row[here[0]])
            if vertex in at_vertex:
                raise _ContactError([at_vertex[vertex], place])
            at_vertex[vertex] = place
            continue
        first, second = sorted(here, key=lambda corner: row[corner])
        # Computed from both weights, so that rounding cannot make the share 0 or 1.
        share[place] = weights[second] / (weights[first] + weights[second])
        on_edge[int(row[first]), int(row[second])].append(place)
    for along in on_edge.values():
        along.sort(key=lambda place: share[place])
        for one, other in zip(along[:-1], along[1:], strict=True):
            if share[one] == share[other]:
                raise _ContactError([one, other])
    return _Places(at_vertex, dict(on_edge), dict(in_face))


def _segments_inside(
    chain: Chain, corners: IntArray, places: _Places
) -> dict[int, list[tuple[int, int]]]:
    """Segments through the interior of faces, as pairs of places, by face.

    A segment along an edge needs no cut. If it passes over another place, _ContactError is raised.
    """
    inside: dict[int, list[tuple[int, int]]] = defaultdict(list)
    support = [
        frozenset(row[weights > 0.0].tolist())
        for row, weights in zip(corners, chain.barycentric, strict=True)
    ]
    n = len(chain)
    for place in range(n if chain.closed else n - 1):
        following = (place + 1) % n
        together = support[place] | support[following]
        if len(together) > 2:
            inside[int(chain.segment_faces[place])].append((place, following))
            continue
        low, high = sorted(together)
        order: list[int] = places.on_edge.get((low, high), [])
        where = [
            order.index(p) if len(support[p]) == 2 else (-1 if support[p] == {low} else len(order))
            for p in (place, following)
        ]
        if abs(where[0] - where[1]) != 1:
            between = order[max(min(where) + 1, 0) : max(where)]
            raise _ContactError([place, following, *between])
    return dict(inside)


def _faces_beside(mesh: Mesh, places: _Places) -> list[int]:
    """Faces that have a place on one of their edges."""
    edges = np.array(list(places.on_edge), dtype=np.int64).reshape(-1, 2)
    candidates = mesh.faces_at(np.unique(edges))
    cut = sides_among(mesh.faces[candidates], edges).reshape(-1, 3)
    return candidates[cut.any(axis=1)].tolist()


def _face_parts(
    mesh: Mesh,
    face: int,
    chain: Chain,
    places: _Places,
    vertex: IntArray,
    segments: list[tuple[int, int]],
) -> list[tuple[int, int, int]]:
    """Triangles that replace one face, as triples of vertices of the cut mesh.

    Parameters
    ----------
    mesh : Mesh
    face : int
    chain : Chain
    places : _Places
    vertex : (m,) int array
        The vertex of the cut mesh at each place.
    segments : list of (int, int)
        Segments through the interior of the face, as pairs of places.
    """
    corners = mesh.faces[face].tolist()
    sides = []
    for start, end in zip(corners, corners[1:] + corners[:1], strict=True):
        along = places.on_edge.get((min(start, end), max(start, end)), [])
        sides.append(along if start < end else along[::-1])
    inner = places.in_face.get(face, [])
    new = np.array([*itertools.chain(*sides), *inner], dtype=np.int64)
    local = {places.at_vertex[v]: k for k, v in enumerate(corners) if v in places.at_vertex}
    local.update((place, 3 + k) for k, place in enumerate(new.tolist()))
    theirs = mesh.faces[np.full(len(new), face)]
    inserted = weights_at(mesh.faces[chain.faces[new]], chain.barycentric[new], theirs)
    weights = np.concatenate([np.eye(3), inserted])
    triangulation = FaceTriangulation(weights, _flattened(mesh.vertices[corners], weights))
    try:
        for corner, along in enumerate(sides):
            triangulation.add_on_side(corner, [local[place] for place in along])
        for place in inner:
            triangulation.add_inside(local[place])
        for start_place, end_place in segments:
            triangulation.add_segment(local[start_place], local[end_place])
    except ConstraintError as error:
        meeting = [place for place, at in local.items() if at in error.points]
        raise _ContactError(meeting) from error
    triangulation.improve()
    ids = [*corners, *vertex[new].tolist()]
    return [(ids[a], ids[b], ids[c]) for a, b, c in triangulation.triangles]


def _flattened(corners: FloatArray, weights: FloatArray) -> FloatArray:
    """Points of a face in its plane, (n, 2); a face without height counts as equilateral."""
    one, other = corners[1] - corners[0], corners[2] - corners[0]
    length = np.linalg.norm(one)
    x, y = one @ other, float(np.linalg.norm(np.cross(one, other)))
    longest = max(length, np.linalg.norm(other), np.linalg.norm(other - one))
    if y > FLAT * longest**2:
        flat = np.array([[0.0, 0.0], [length, 0.0], [x / length, y / length]])
    else:
        flat = np.array([[0.0, 0.0], [1.0, 0.0], [0.5, 0.75**0.5]])
    return weights @ flat
