"""Cuts a mesh along curves: the result is the same surface, with the curves as chains of edges.

Every face that the curve crosses or touches is triangulated. The faces at a cut edge share its new
vertices, so a conforming mesh stays conforming. New vertices have barycentric coordinates in input
faces, so that attributes can be interpolated.
"""

from __future__ import annotations

import itertools
from collections import defaultdict
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np

from ..arguments import number_between
from ..errors import ArgumentError, CurveError
from ..geometry.array_types import BoolArray, FloatArray, IntArray
from ..geometry.curve import (
    SurfaceCurve,
    checked_curve,
    points_of,
    weights_in_faces,
    with_points,
)
from ..geometry.mesh import Mesh, MeshLike, adjacent_sides, as_mesh, sides_among
from ..geometry.surface_points import SurfacePoints, in_faces, weights_at
from ..geometry.tolerances import ROUNDED
from ..progress import checkpoint
from ..repair.face_parts import FaceParts
from .chain import Chain, build_chain, necessary_points
from .triangulation import ConstraintError, FaceTriangulation

SNAP_CUT = 1e-3
"""Default barycentric coordinate up to which a point snaps to the edge or vertex."""

LARGEST_SNAP = 0.25
"""Largest snap. With a third or more, all coordinates of a point could become zero."""

FLAT = 1e-9
"""Height of a face, relative to its longest side, up to which it counts as without height."""


@dataclass(frozen=True)
class CutMesh:
    """A mesh that has curves as chains of its edges.

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
        Distinct vertices along the curve, or the last of several curves, each joined to the next by
        an edge.
    closed : bool
        Whether the last vertex of the chain is joined to the first.
    chain_point : (m,) int array
        Index of the point of this curve at each vertex of the chain, or of the one before it.
    earlier_edges : (e, 2) int array
        Edges along the other curves.
    """

    vertices: FloatArray
    faces: IntArray
    source_face: IntArray
    new_face: IntArray
    new_barycentric: FloatArray
    chain: IntArray
    closed: bool
    chain_point: IntArray
    earlier_edges: IntArray = field(default_factory=lambda: np.zeros((0, 2), dtype=np.int64))

    @cached_property
    def mesh(self) -> Mesh:
        """The cut surface as a mesh."""
        return Mesh(self.vertices, self.faces)

    @property
    def chain_edges(self) -> IntArray:
        """Edges along the curves, (e, 2)."""
        edges = np.stack([self.chain, np.roll(self.chain, -1)], axis=1)
        return np.concatenate([self.earlier_edges, edges if self.closed else edges[:-1]])

    @cached_property
    def adjacent_faces(self) -> tuple[IntArray, BoolArray]:
        """Pairs of faces with a common edge, (p, 2), and whether a curve runs along it, (p,).

        An edge with k faces has k - 1 pairs.
        """
        one, other = adjacent_sides(self.faces)
        return np.stack([one, other], axis=1) // 3, sides_among(self.faces, self.chain_edges)[one]

    @cached_property
    def directed_chain_edges(self) -> frozenset[tuple[int, int]]:
        """Edges along the curves in both directions, for fast lookup."""
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

    def parts(self, mesh: Mesh) -> FaceParts:
        """The faces as parts of those of the mesh that was cut."""
        return FaceParts(self.faces, self.source_face, self.corner_weights(mesh))

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
    mesh: MeshLike,
    curve: SurfaceCurve | Sequence[SurfaceCurve],
    snap: float = SNAP_CUT,
    deviation: float = 0.0,
) -> CutMesh:
    """Cut a mesh along a curve on it, or along several.

    Parameters
    ----------
    mesh : Mesh
        The mesh that the curve was designed on. It may have boundaries and need not be oriented.
    curve : SurfaceCurve or sequence of SurfaceCurve
        A simple curve, closed or open, or several of them.
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
        If ``snap`` or ``deviation`` is out of range, or there is no curve.

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
    mesh = as_mesh(mesh)
    snap = number_between("snap", snap, 0.0, LARGEST_SNAP)
    deviation = number_between("deviation", deviation, 0.0, np.inf, "a length")
    if not isinstance(curve, Sequence):
        return _cut_along_one(mesh, curve, snap, deviation)
    if not len(curve):
        raise ArgumentError("curve is an empty list; pass at least one curve")
    found = _cut_along_one(mesh, curve[0], snap, deviation)
    for further in curve[1:]:
        checkpoint()
        found = _cut_again(mesh, found, further, snap, deviation)
    return found


def _cut_again(
    mesh: Mesh, before: CutMesh, curve: SurfaceCurve, snap: float, deviation: float
) -> CutMesh:
    """Cut a mesh along another curve."""
    curve, segment_faces = checked_curve(mesh, curve)
    weights = weights_in_faces(mesh, curve.faces, curve.barycentric, segment_faces)
    curve = replace(curve, faces=segment_faces, barycentric=weights)
    parts = before.parts(mesh)
    points, segment = parts.through(mesh, curve)
    number = np.searchsorted(segment, np.arange(len(curve.faces)))
    found = _cut_along_one(
        before.mesh, with_points(before.mesh, curve, points, number), snap, deviation
    )
    new = parts.in_parents(SurfacePoints(found.new_face, found.new_barycentric))
    return CutMesh(
        vertices=found.vertices,
        faces=found.faces,
        source_face=before.source_face[found.source_face],
        new_face=np.concatenate([before.new_face, new.faces]),
        new_barycentric=np.concatenate([before.new_barycentric, new.barycentric]),
        chain=found.chain,
        closed=found.closed,
        chain_point=segment[found.chain_point],
        earlier_edges=_with_new_points(before.mesh, found, before.chain_edges),
    )


def _cut_along_one(mesh: Mesh, curve: SurfaceCurve, snap: float, deviation: float) -> CutMesh:
    """Cut a mesh along a curve."""
    curve, segment_faces = checked_curve(mesh, curve)
    must_keep = np.zeros(len(curve.faces), dtype=bool)
    must_keep[curve.control_index[curve.control_index >= 0]] = True
    exact = np.zeros(len(curve.faces), dtype=bool)
    positions = points_of(curve).positions(mesh)
    while True:
        margin = np.where(exact, ROUNDED, max(snap, ROUNDED))
        used = necessary_points(
            positions, curve.barycentric, curve.closed, must_keep | exact, deviation
        )
        chain = build_chain(mesh, curve, segment_faces, used, margin, must_keep)
        try:
            return _cut(mesh, chain)
        except _ContactError as contact:
            near = [(np.array(contact.places) + step) % len(chain) for step in (-1, 0, 1)]
        there = np.flatnonzero(np.isin(chain.place_of, near))
        if exact[there].all():
            raise CurveError(
                f"curve crosses or touches itself near its points {there.tolist()}; only a simple "
                "curve can be cut"
            )
        exact[there] = True


class _ContactError(Exception):
    """The chain touches itself at some of its places."""

    def __init__(self, places: list[int]) -> None:
        super().__init__(places)
        self.places = places


@dataclass(frozen=True)
class _Places:
    """Places of a chain, sorted by the vertex, edge or face that contains them.

    Attributes
    ----------
    support : list of tuples of int
        For each place the vertices of the vertex, edge or face, ascending.
    by_support : dict
        Places by their support: the one at a vertex, or those on an edge, in order from its smaller
        vertex.
    in_face : dict
        Places inside each face.
    """

    support: list[tuple[int, ...]]
    by_support: dict[tuple[int, ...], list[int]]
    in_face: dict[int, list[int]]


def _cut(mesh: Mesh, chain: Chain) -> CutMesh:
    """Cut a mesh along a chain, or raise _ContactError."""
    if len(chain) < (3 if chain.closed else 2):
        raise _ContactError(list(range(len(chain))))
    corners, weights = mesh.faces[chain.places.faces], chain.places.barycentric
    places = _places(chain, corners)
    is_new = (weights > 0.0).sum(axis=1) > 1
    largest = corners[np.arange(len(chain)), weights.argmax(axis=1)]
    vertex = np.where(is_new, np.cumsum(is_new) - 1 + len(mesh.vertices), largest)
    segments = _segments_inside(chain, places)

    cut_faces = sorted(set(segments) | set(places.in_face) | set(_faces_beside(mesh, places)))
    parts = [
        _face_parts(mesh, face, chain, places, vertex, segments.get(face, [])) for face in cut_faces
    ]
    source = [face for face, triangles in zip(cut_faces, parts, strict=True) for _ in triangles]
    stays = np.setdiff1d(np.arange(len(mesh.faces)), cut_faces)
    new = chain.places[is_new]
    return CutMesh(
        vertices=np.concatenate([mesh.vertices, new.positions(mesh)]),
        faces=np.concatenate([mesh.faces[stays], *parts]),
        source_face=np.concatenate([stays, np.array(source, dtype=np.int64)]),
        new_face=new.faces,
        new_barycentric=new.barycentric,
        chain=vertex,
        closed=chain.closed,
        chain_point=chain.point,
    )


def _places(chain: Chain, corners: IntArray) -> _Places:
    """Sort places by their location; raise _ContactError if two of them coincide."""
    places = _Places([], defaultdict(list), defaultdict(list))
    share = []
    rows = zip(corners.tolist(), chain.places.barycentric.tolist(), strict=True)
    for place, (row, weights) in enumerate(rows):
        support = sorted((v, w) for v, w in zip(row, weights, strict=True) if w > 0.0)
        places.support.append(tuple(v for v, _ in support))
        # Computed from both weights, so that rounding cannot make a share on an edge 0 or 1.
        share.append(support[-1][1] / sum(w for _, w in support))
        if len(support) == 3:
            places.in_face[int(chain.places.faces[place])].append(place)
        else:
            places.by_support[places.support[place]].append(place)
    for along in places.by_support.values():
        along.sort(key=share.__getitem__)
        for one, other in itertools.pairwise(along):
            if share[one] == share[other]:
                raise _ContactError([one, other])
    return places


def _segments_inside(chain: Chain, places: _Places) -> dict[int, list[tuple[int, int]]]:
    """Segments through the interior of faces, as pairs of places, by face.

    A segment along an edge needs no cut. If it passes over another place, _ContactError is raised.
    """
    inside: dict[int, list[tuple[int, int]]] = defaultdict(list)
    n = len(chain)
    for place in range(n if chain.closed else n - 1):
        following = (place + 1) % n
        together = sorted({*places.support[place], *places.support[following]})
        if len(together) > 2:
            inside[int(chain.segment_faces[place])].append((place, following))
            continue
        edge = [(together[0],), tuple(together), (together[1],)]
        along = [there for part in edge for there in places.by_support.get(part, [])]
        first, last = sorted([along.index(place), along.index(following)])
        if last - first > 1:
            raise _ContactError(along[first : last + 1])
    return inside


def _faces_beside(mesh: Mesh, places: _Places) -> list[int]:
    """Faces that have a place on one of their edges."""
    edges = np.array([at for at in places.by_support if len(at) == 2], np.int64).reshape(-1, 2)
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
) -> IntArray:
    """Triangles that replace one face, in vertices of the cut mesh, (t, 3).

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
        along = places.by_support.get((min(start, end), max(start, end)), [])
        sides.append(along if start < end else along[::-1])
    inner = places.in_face.get(face, [])
    new = np.array([*itertools.chain(*sides), *inner], dtype=np.int64)
    local = {place: k for k, v in enumerate(corners) for place in places.by_support.get((v,), [])}
    local.update((place, 3 + k) for k, place in enumerate(new.tolist()))
    inserted = in_faces(mesh, chain.places[new], np.full(len(new), face))
    weights = np.concatenate([np.eye(3), inserted.barycentric])
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
    return np.append(corners, vertex[new])[triangulation.triangles]


def _flattened(corners: FloatArray, weights: FloatArray) -> FloatArray:
    """Points of a face in its plane, (n, 2); a face without height counts as equilateral."""
    _, sides = np.linalg.qr((corners[1:] - corners[0]).T)  # from the first corner, in columns
    longest = np.linalg.norm([*sides.T, sides[:, 1] - sides[:, 0]], axis=1).max()
    if np.abs(np.linalg.det(sides)) <= FLAT * longest**2:
        sides = np.array([[1.0, 0.5], [0.0, 0.75**0.5]])
    return weights[:, 1:] @ sides.T


def _with_new_points(mesh: Mesh, cut: CutMesh, chain: IntArray) -> IntArray:
    """Edges of earlier cuts, (e, 2), divided at the vertices that a cut has inserted on them."""
    corners, weights = mesh.faces[cut.new_face], cut.new_barycentric
    on_edge = np.flatnonzero((weights > 0.0).sum(axis=1) == 2)
    along: dict[tuple[int, int], list[tuple[float, int]]] = defaultdict(list)
    for number in on_edge.tolist():
        (a, s), (b, t) = sorted(
            (int(v), float(w))
            for v, w in zip(corners[number], weights[number], strict=True)
            if w > 0.0
        )
        along[a, b].append((t / (s + t), len(mesh.vertices) + number))
    edges: list[tuple[int, int]] = []
    for a, b in np.sort(chain, axis=1).tolist():
        stops = [a, *(vertex for _, vertex in sorted(along.get((a, b), []))), b]
        edges += zip(stops[:-1], stops[1:], strict=True)
    return np.array(edges, dtype=np.int64).reshape(-1, 2)
