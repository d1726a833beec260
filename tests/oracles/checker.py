"""Checks independently whether a design is one simple curve on the surface through all points.

Only the public interface is used: a mesh is its vertices and faces, and a curve is its points,
faces, barycentric coordinates and control indices. A point is identified by its nonzero weights at
mesh vertices, so a point on an edge is the same point in both adjacent faces. Whether strands cross
or touch is decided without tolerance, by exact arithmetic wherever rounding could matter.
"""

from __future__ import annotations

from dataclasses import dataclass
from fractions import Fraction

import igl
import numpy as np
from numpy.typing import ArrayLike

import nicmm_core as nicmm
from nicmm_core.geometry.array_types import BoolArray, FloatArray, IntArray

ROUNDING = 1e-12
"""Tolerance of sums of barycentrics, and of control points in bounding-box diagonals."""

POSITION_ROUNDING = 4.0 * float(np.finfo(float).eps)
"""Tolerance of a point against its barycentrics, relative to the greatest coordinate."""

BOX_ROOM = 1e-6
"""Distance of bounding boxes in weight space beyond which chords cannot meet despite rounding."""

GAP = 1e-6
"""Width, in bounding-box diagonals, of a gap between open edges that a curve may cross."""

FEWEST_POINTS = {True: 3, False: 2}
"""Least number of points of a curve, by whether it is closed."""


@dataclass(frozen=True)
class Verdict:
    """Measured properties of a curve, and the faults that follow from them.

    Attributes
    ----------
    curves : int
        Number of curves of the design; the other attributes describe the first one.
    readable : bool
        Whether the arrays of the curve are consistent with one another and with the mesh, finite
        and long enough. If not, the other attributes keep their defaults.
    closed_as_asked : bool
        Whether the curve is closed or open as requested.
    points : int
        Number of points of the polyline.
    position_error : float
        Greatest difference between a coordinate of a point and the value that the barycentric
        coordinates give, relative to the greatest coordinate.
    weight_error : float
        Greatest amount by which a barycentric coordinate is negative or a sum differs from 1.
    chords_off_face : int
        Number of pairs of consecutive points that do not lie on a common face.
    points_twice : int
        Number of points that repeat an earlier point of the curve.
    crossings : int
        Number of pairs of strands that cross inside a face.
    touchings : int
        Number of points that lie on another strand, strictly between its ends.
    interpolation_error : float
        Greatest distance from a control point to the curve point with its control index, in
        bounding-box diagonals; 0 if no control points are given, infinite if one is missing.
    in_order : bool
        Whether the curve visits the control points in the requested order, each of them once.
    """

    curves: int
    readable: bool = False
    closed_as_asked: bool = False
    points: int = 0
    position_error: float = np.inf
    weight_error: float = np.inf
    chords_off_face: int = 0
    points_twice: int = 0
    crossings: int = 0
    touchings: int = 0
    interpolation_error: float = np.inf
    in_order: bool = False

    @property
    def self_crossings(self) -> int:
        """Number of places where the curve meets itself."""
        return self.points_twice + self.crossings + self.touchings

    @property
    def off_surface(self) -> list[str]:
        """Faults of the position of the curve on the surface, in words."""
        if not self.readable:
            return [
                "its arrays are too short, do not fit one another or the mesh, or are not finite"
            ]
        return _words(
            (
                self.position_error > POSITION_ROUNDING,
                f"points are {self.position_error:.1e} beside their barycentrics",
            ),
            (
                self.weight_error > ROUNDING,
                f"barycentrics are negative or do not sum to 1, by {self.weight_error:.1e}",
            ),
            (
                self.chords_off_face > 0,
                f"chords lie on no common face: {self.chords_off_face}",
            ),
        )

    @property
    def not_simple(self) -> list[str]:
        """Reasons why the curve is not simple, in words."""
        return _words(
            (self.points_twice > 0, f"points are passed twice: {self.points_twice}"),
            (self.crossings > 0, f"strands cross: {self.crossings}"),
            (self.touchings > 0, f"points touch another strand: {self.touchings}"),
        )

    @property
    def not_through_points(self) -> list[str]:
        """Faults at the control points, in words."""
        if not self.readable:
            return []
        return _words(
            (
                not self.interpolation_error <= ROUNDING,
                f"control points are missed by {self.interpolation_error:.1e} diagonals",
            ),
            (not self.in_order, "control points are met out of order"),
        )

    @property
    def faults(self) -> list[str]:
        """All faults, in words; empty if the curve is what was requested."""
        if self.curves == 0:
            return ["there is no curve"]
        return [
            *_words(
                (self.curves > 1, f"there are {self.curves} curves"),
                (self.readable and not self.closed_as_asked, "it is not closed or open as asked"),
            ),
            *self.off_surface,
            *self.not_simple,
            *self.not_through_points,
        ]


def judge(
    mesh: nicmm.Mesh,
    design: nicmm.Design,
    control_points: ArrayLike | nicmm.SurfacePoints,
    closed: bool = True,
    order: str = "given",
) -> Verdict:
    """Judge a design by the request, which is given by arguments of `nicmm_core.design_curve`."""
    if not design.curves:
        return Verdict(curves=0)
    positions = control_positions(mesh, control_points)
    return judge_curve(mesh, design.curves[0], positions, closed, order, len(design.curves))


def control_positions(
    mesh: nicmm.Mesh, control_points: ArrayLike | nicmm.SurfacePoints
) -> FloatArray:
    """Positions of control points in any accepted form, shape (k, 3)."""
    if isinstance(control_points, nicmm.SurfacePoints):
        return control_points.positions(mesh)
    given = np.asarray(control_points)
    return mesh.vertices[given] if given.ndim == 1 else given.astype(np.float64)


def judge_curve(
    mesh: nicmm.Mesh,
    curve: nicmm.SurfaceCurve,
    positions: ArrayLike | None = None,
    closed: bool = True,
    order: str = "given",
    curves: int = 1,
) -> Verdict:
    """Judge one curve.

    Parameters
    ----------
    mesh : Mesh
        Surface.
    curve : SurfaceCurve
        Curve to judge.
    positions : (k, 3) array_like of float, optional
        Positions of the control points; without them, control points are not checked.
    closed : bool
        Whether a closed curve was requested.
    order : {"given", "shortest"}
        Whether the points must be visited in the given order, or each once in any order.
    curves : int
        Number of curves of the design.

    Returns
    -------
    Verdict
        Properties and faults of the curve.
    """
    n = len(curve.points)
    if not _readable(mesh, curve) or n < FEWEST_POINTS[bool(curve.closed)]:
        return Verdict(curves, points=n)
    first = np.arange(n if curve.closed else n - 1)
    chords = np.stack([first, (first + 1) % n], axis=1)
    faces = mesh.faces
    vertices, weights = _places(faces, curve)
    simplices, on_face = _common_simplices(faces, vertices, chords)
    if not on_face.all():
        # A design treats open edges at the same place as one edge.
        faces = _with_open_edges_joined(mesh)
        vertices, weights = _places(faces, curve)
        simplices, on_face = _common_simplices(faces, vertices, chords)
    across_gaps = _on_faces_across_gaps(mesh, curve, chords[~on_face])
    crossings, touchings = _contacts(vertices, weights, chords[on_face], simplices[on_face])
    missed, in_order = 0.0, True
    if positions is not None:
        missed, in_order = _visits(mesh, curve, np.asarray(positions, dtype=float), order)
    combined = (curve.barycentric[:, :, None] * mesh.vertices[mesh.faces[curve.faces]]).sum(axis=1)
    return Verdict(
        curves=curves,
        readable=True,
        closed_as_asked=bool(curve.closed) == closed,
        points=n,
        position_error=float(
            np.abs(curve.points - combined).max()
            / np.abs(mesh.vertices[mesh.faces[curve.faces]]).max()
        ),
        weight_error=float(
            max(-curve.barycentric.min(), np.abs(curve.barycentric.sum(axis=1) - 1.0).max(), 0.0)
        ),
        chords_off_face=int((~across_gaps).sum()),
        points_twice=n - len(np.unique(np.concatenate([vertices, weights], axis=1), axis=0)),
        crossings=crossings,
        touchings=touchings,
        interpolation_error=missed,
        in_order=in_order,
    )


def _words(*cases: tuple[bool, str]) -> list[str]:
    return [word for wrong, word in cases if wrong]


def _readable(mesh: nicmm.Mesh, curve: nicmm.SurfaceCurve) -> bool:
    """Whether the arrays are valid enough for all other checks."""
    n = len(curve.points)
    return bool(
        curve.points.shape == curve.barycentric.shape == (n, 3)
        and curve.faces.shape == (n,)
        and np.issubdtype(curve.faces.dtype, np.integer)
        and ((curve.faces >= 0) & (curve.faces < len(mesh.faces))).all()
        and np.isfinite(curve.points).all()
        and np.isfinite(curve.barycentric).all()
        and (curve.barycentric > 0.0).any(axis=1).all()
        and ((curve.control_index >= -1) & (curve.control_index < n)).all()
    )


def _with_open_edges_joined(mesh: nicmm.Mesh) -> IntArray:
    """Faces (F, 3) in which vertices of open edges with the same coordinates are identified."""
    sides = np.sort(mesh.faces[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2), axis=1)
    edges, count = np.unique(sides, axis=0, return_counts=True)
    first: dict[tuple[float, ...], int] = {}
    number = np.arange(len(mesh.vertices))
    for vertex in np.unique(edges[count == 1]).tolist():
        number[vertex] = first.setdefault(tuple(mesh.vertices[vertex].tolist()), vertex)
    return number[mesh.faces]


def _on_faces_across_gaps(
    mesh: nicmm.Mesh, curve: nicmm.SurfaceCurve, chords: IntArray
) -> BoolArray:
    """Whether each chord lies on the face of one of its ends by its position, up to `GAP`.

    Open edges that face each other across a gap, or meet at a T-junction, share no vertices.
    """
    found = np.zeros(len(chords), dtype=bool)
    diagonal = np.linalg.norm(np.ptp(mesh.vertices[mesh.faces].reshape(-1, 3), axis=0))
    for end in (0, 1):
        corners = mesh.vertices[mesh.faces[curve.faces[chords[:, end]]]]
        place = curve.points[chords[:, 1 - end]]
        away = [_distance_to_triangle(*each) for each in zip(place, corners, strict=True)]
        found |= np.array(away, dtype=float) <= GAP * diagonal
    return found


def _distance_to_triangle(point: FloatArray, corners: FloatArray) -> float:
    """Distance of a point, (3,), from a triangle, (3, 3)."""
    squared, _, _ = igl.point_mesh_squared_distance(
        point[None], np.ascontiguousarray(corners), np.array([[0, 1, 2]])
    )
    return float(np.sqrt(np.atleast_1d(squared)[0]))


def _places(faces: IntArray, curve: nicmm.SurfaceCurve) -> tuple[IntArray, FloatArray]:
    """Representation of each point that does not depend on the face in which it is given.

    Returns
    -------
    (n, 3) int array
        Vertices at which the weight is not zero, in ascending order, preceded by -1 for each
        other corner.
    (n, 3) float array
        Weights at these vertices, 0 at the other corners.
    """
    positive = curve.barycentric > 0.0
    vertices = np.where(positive, faces[curve.faces], -1)
    order = np.argsort(vertices, axis=1, kind="stable")
    weights = np.where(positive, curve.barycentric, 0.0)
    return np.take_along_axis(vertices, order, 1), np.take_along_axis(weights, order, 1)


def _common_simplices(
    faces: IntArray, vertices: IntArray, chords: IntArray
) -> tuple[IntArray, BoolArray]:
    """Smallest simplex (face, edge or vertex) that contains both ends of each chord.

    Returns
    -------
    (n, 3) int array
        Vertices of the simplex, in the form of `_places`.
    (n,) bool array
        Whether the simplex exists in the mesh.
    """
    both = np.sort(vertices[chords].reshape(len(chords), 6), axis=1)
    both[:, 1:][both[:, 1:] == both[:, :-1]] = -1
    simplices = np.sort(both, axis=1)[:, 3:]
    small = (both >= 0).sum(axis=1) <= 3

    # For speed, only faces near the curve are sorted. Only the vertices of the curve are numbered,
    # so that the keys fit into 64 bits.
    used = np.zeros(int(faces.max()) + 2, dtype=bool)
    used[vertices[vertices >= 0]] = True
    number = np.cumsum(used)
    number[~used] = 0
    near = faces[used[faces].sum(axis=1) >= 2]
    near = np.sort(number[near], axis=1)
    edges = np.concatenate([near[:, [0, 1]], near[:, [1, 2]], near[:, [0, 2]]])
    corners = np.arange(1, number.max() + 1)
    known = np.concatenate(
        [near, np.pad(edges, ((0, 0), (1, 0))), np.pad(corners[:, None], ((0, 0), (2, 0)))]
    )
    here = np.where(simplices >= 0, number[simplices], 0)
    return simplices, small & np.isin(_keys(here), _keys(known))


def _keys(triples: IntArray) -> IntArray:
    """One key per row of three numbers below 2²⁰, more vertices than any tested curve passes."""
    return (triples[:, 0] << 40) + (triples[:, 1] << 20) + triples[:, 2]


def _contacts(
    vertices: IntArray, weights: FloatArray, chords: IntArray, simplices: IntArray
) -> tuple[int, int]:
    """Numbers of pairs of chords that cross, and of points inside a chord of another strand.

    Two chords can meet between their ends only inside a face that contains both, or along an edge;
    a chord that enters from another face has a point on the edge.
    """
    dimension = (simplices >= 0).sum(axis=1) - 1
    inside, along = dimension == 2, dimension == 1
    crossings, touchings = _contacts_in_faces(vertices, weights, chords[inside], simplices[inside])
    touchings += _contacts_on_edges(vertices, weights, chords[along], simplices[along])
    return crossings, touchings


def _contacts_in_faces(
    vertices: IntArray, weights: FloatArray, chords: IntArray, faces: IntArray
) -> tuple[int, int]:
    """Crossings and touchings of chords through the interior of a face."""
    face = np.unique(faces, axis=0, return_inverse=True)[1].ravel()
    own = np.stack([_weights_in(vertices, weights, chords[:, e], faces) for e in (0, 1)])
    pairs = _near(_pairs_within(face), own.min(axis=0), own.max(axis=0))
    names = pairs.T
    ends = [[_weights_in(vertices, weights, chords[n, e], faces[n]) for e in (0, 1)] for n in names]
    cross = np.ones(len(pairs), dtype=bool)
    touching: set[tuple[int, int]] = set()
    for this, other in ((0, 1), (1, 0)):
        chord, start, end = names[this], *ends[this]
        sides = []
        for which in (0, 1):
            point, place = chords[names[other], which], ends[other][which]
            # Consecutive chords share a point, which is not a contact.
            shared = (point[:, None] == chords[chord]).any(axis=1)
            apart = np.flatnonzero(~shared)
            side = np.zeros(len(pairs), dtype=np.int64)
            side[apart] = _side(start[apart], end[apart], place[apart])
            for pair in apart[side[apart] == 0]:
                if _between(place[pair], start[pair], end[pair]):
                    touching.add((int(point[pair]), int(chord[pair])))
            sides.append(side)
        cross &= sides[0] * sides[1] < 0
    return int(cross.sum()), len(touching)


def _contacts_on_edges(
    vertices: IntArray, weights: FloatArray, chords: IntArray, edges: IntArray
) -> int:
    """Number of points inside chords that run along an edge."""
    if not len(edges):
        return 0
    n = len(vertices)
    group = np.unique(np.concatenate([vertices, edges]), axis=0, return_inverse=True)[1].ravel()
    rows_of: dict[int, list[int]] = {}
    for row, edge in enumerate(group[n:].tolist()):
        rows_of.setdefault(edge, []).append(row)
    touching = 0
    for point in np.flatnonzero(np.isin(group[:n], group[n:])).tolist():
        for row in rows_of[int(group[point])]:
            if point not in chords[row]:
                three = np.array([point, *chords[row]])
                edge = np.tile(edges[row], (3, 1))
                touching += _between(*_weights_in(vertices, weights, three, edge))
    return touching


def _weights_in(
    vertices: IntArray, weights: FloatArray, points: IntArray, simplices: IntArray
) -> FloatArray:
    """Weights of each point at the vertices of the simplex that contains it, shape (m, 3)."""
    same = vertices[points][:, None, :] == simplices[:, :, None]
    return (same * weights[points][:, None, :]).sum(axis=2)


def _pairs_within(group: IntArray) -> IntArray:
    """All pairs of elements that belong to the same group, shape (m, 2)."""
    order = np.argsort(group, kind="stable")
    size = np.bincount(group)
    rank = np.arange(len(group)) - (np.cumsum(size) - size)[group[order]]
    later = np.repeat(np.arange(len(group)), rank)
    nth = np.arange(len(later)) - np.repeat(np.cumsum(rank) - rank, rank)
    earlier = later - rank[later] + nth
    return np.stack([order[earlier], order[later]], axis=1)


def _near(pairs: IntArray, low: FloatArray, high: FloatArray) -> IntArray:
    """Pairs of chords whose bounding boxes in weight space meet, with a margin for rounding."""
    one, other = pairs.T
    meet = (low[one] <= high[other] + BOX_ROOM) & (low[other] <= high[one] + BOX_ROOM)
    return pairs[meet.all(axis=1)]


def _side(start: FloatArray, end: FloatArray, point: FloatArray) -> IntArray:
    """Exact side, 1, 0 or -1, of a line on which a point of the same face lies.

    Weights, of shape (m, 3), are homogeneous coordinates, so the side is the sign of a determinant.
    """
    products = np.stack(
        [
            sign * start[:, i] * end[:, j] * point[:, k]
            for sign, i, j, k in (
                (1, 0, 1, 2), (1, 1, 2, 0), (1, 2, 0, 1),
                (-1, 2, 1, 0), (-1, 1, 0, 2), (-1, 0, 2, 1),
            )
        ]
    )  # fmt: skip
    value = products.sum(axis=0)
    side = np.sign(value).astype(np.int64)
    uncertain = np.abs(value) <= 16.0 * np.finfo(float).eps * np.abs(products).sum(axis=0)
    for row in np.flatnonzero(uncertain):
        p, q, r = ([Fraction(float(w)) for w in corner[row]] for corner in (start, end, point))
        exact = (
            p[0] * (q[1] * r[2] - q[2] * r[1])
            + p[1] * (q[2] * r[0] - q[0] * r[2])
            + p[2] * (q[0] * r[1] - q[1] * r[0])
        )
        side[row] = (exact > 0) - (exact < 0)
    return side


def _between(point: FloatArray, start: FloatArray, end: FloatArray) -> bool:
    """Whether a point on a line lies strictly between two others, exactly; weights (3,)."""
    places = []
    for weights in (point, start, end):
        exact = [Fraction(float(weight)) for weight in weights]
        places.append([weight / sum(exact) for weight in exact])
    return any(p < max(a, b) and p > min(a, b) for p, a, b in zip(*places, strict=True))


def _visits(
    mesh: nicmm.Mesh, curve: nicmm.SurfaceCurve, positions: FloatArray, order: str
) -> tuple[float, bool]:
    """Greatest distance from a control point, in diagonals, and whether the order is right."""
    index = curve.control_index
    if index.shape != (len(positions),) or (index < 0).any():
        return np.inf, False
    referenced = np.zeros(len(mesh.vertices), dtype=bool)
    referenced[mesh.faces] = True
    diagonal = np.linalg.norm(np.ptp(mesh.vertices[referenced], axis=0))
    distance = np.linalg.norm(curve.points[index][:, None] - positions[None], axis=2)
    asked = np.arange(len(index)) if order == "given" else distance.argmin(axis=1)
    missed = float(distance[np.arange(len(index)), asked].max() / diagonal)
    each_once = len(np.unique(asked)) == len(np.unique(index)) == len(index)
    if curve.closed:
        # In one round, the index decreases only where the round passes the start of the polyline.
        onward = int((np.roll(index, -1) <= index).sum()) == 1
    else:
        onward = bool((np.diff(index) > 0).all())
        onward &= index[0] == 0 and index[-1] == len(curve.points) - 1
    return missed, bool(each_once and onward)
