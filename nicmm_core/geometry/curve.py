"""Curves on a mesh: polylines in which every segment lies in one face.

`SurfaceCurve` is the curve that a design returns. The functions build, check and resample such
curves.
"""

from __future__ import annotations

import importlib
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from ..errors import CurveError
from .array_types import BoolArray, FloatArray, IntArray
from .mesh import Mesh, MeshLike, real_array, whole_numbers
from .surface_points import SurfacePoints, nearest_points, weights_at
from .tolerances import BARYCENTRIC_SUM, GAP, ROUNDED, rounding


@dataclass(frozen=True)
class SurfaceCurve:
    """A polyline exactly on the surface.

    Attributes
    ----------
    closed : bool
        Whether the last point is joined to the first, which is not repeated.
    faces : (n,) int array
        The face of the input mesh in which each point lies.
    barycentric : (n, 3) float array
        Coordinates in that face, not negative, with sum 1.
    points : (n, 3) float array
        Positions, ``sum_j barycentric[:, j] * vertices[faces[:, j]]``. Two consecutive points
        lie on one common face.
    control_index : (k,) int array
        Index among the points of each control point, in the order visited; -1 for a control point
        that this curve does not pass, which never occurs if the design has converged.
    """

    closed: bool
    faces: IntArray
    barycentric: FloatArray
    points: FloatArray
    control_index: IntArray

    def __repr__(self) -> str:
        kind = "closed" if self.closed else "open"
        return (
            f"<SurfaceCurve: {kind}, {len(self.faces)} points, length {self.length:.6g}, "
            f"{len(self.control_index)} control points>"
        )

    @property
    def length(self) -> float:
        """Length in mesh units."""
        return float(np.linalg.norm(self.steps, axis=1).sum())

    @property
    def steps(self) -> FloatArray:
        """Vectors from each point to the next; (n, 3) when closed, else (n - 1, 3)."""
        if self.closed:
            return np.roll(self.points, -1, axis=0) - self.points
        return np.diff(self.points, axis=0)

    def measures(
        self,
        mesh: MeshLike,
        obstacles: ArrayLike | None = None,
        up: ArrayLike = (0.0, 0.0, 1.0),
        corners: ArrayLike | None = None,
    ) -> dict[str, Any]:
        """Measure the curve.

        Parameters
        ----------
        mesh : Mesh
            The mesh on which it lies.
        obstacles : (V,) float array_like, optional
            Weights at the vertices; faces whose corners all have weight 1 are obstacles.
        up : (3,) float array_like, default (0, 0, 1)
            The direction in which slopes are measured.
        corners : sequence of int, optional
            Indices of control points at which the curve turns freely, as for its design. Curvature
            is not measured there.

        Returns
        -------
        dict
            ``length``, in mesh units. ``leg_lengths``, a list of the lengths between consecutive
            control points. ``area`` of the smaller side of the curve, or None if it bounds no
            region. ``least_radius`` of geodesic curvature, infinite for a geodesic, measured over
            a few edges, and ``least_radius_at``, its position or None. ``greatest_slope``, the
            greatest angle with the plane perpendicular to `up`, in radians.
            ``distance_to_obstacle``, the least distance along the surface, or None.

        Raises
        ------
        CurveError
            If the curve does not lie on the mesh.
        ArgumentError
            If another argument cannot be used.
        """
        # The modules that measure use this one, so they are imported when they are needed.
        design = importlib.import_module("..design", __package__)
        found: dict[str, Any] = design.Designer(mesh).measures(self, obstacles, up, corners)
        return found


def curve_on_mesh(
    mesh: Mesh, closed: bool, faces: IntArray, barycentric: FloatArray, control_index: IntArray
) -> SurfaceCurve:
    """Build a curve from faces and barycentric coordinates."""
    points = SurfacePoints(faces, barycentric).positions(mesh)
    return SurfaceCurve(closed, faces, barycentric, points, control_index)


def points_of(curve: SurfaceCurve) -> SurfacePoints:
    """The points of a curve."""
    return SurfacePoints(curve.faces, curve.barycentric)


def with_points(
    mesh: Mesh, curve: SurfaceCurve, points: SurfacePoints, number: IntArray | None = None
) -> SurfaceCurve:
    """The curve through other points, on any mesh.

    ``number`` has the new index of each of its own points; by default the indices stay.
    """
    index = curve.control_index
    if number is not None:
        index = np.where(index >= 0, number[index], -1)
    return curve_on_mesh(mesh, curve.closed, points.faces, points.barycentric, index)


def is_one_curve(curves: list[SurfaceCurve], closed: bool = True) -> bool:
    """Whether there is exactly one curve, closed or open as given, through all control points."""
    one = len(curves) == 1 and curves[0].closed == closed
    return one and bool((curves[0].control_index >= 0).all())


def point_on_segment(mesh: Mesh, curve: SurfaceCurve, segment: int, share: float) -> SurfacePoints:
    """The point at the fraction ``share`` of a segment, in a face that contains the segment."""
    curve, segment_faces = checked_curve(mesh, curve, across_gaps=True)
    ends = np.array([segment, (segment + 1) % len(curve.faces)])
    there = segment_faces[[segment, segment]]
    both = weights_in_faces(mesh, curve.faces[ends], curve.barycentric[ends], there)
    return SurfacePoints(there[:1], (1.0 - share) * both[:1] + share * both[1:])


def leg_of_segment(curve: SurfaceCurve, segment: int) -> int:
    """Index of the control point at which the leg that contains a segment begins."""
    order = np.argsort(curve.control_index)
    # On a closed curve, a segment before the first control point belongs to the last leg.
    return int(order[np.searchsorted(curve.control_index[order], segment, side="right") - 1])


def arc_lengths(steps: FloatArray) -> FloatArray:
    """Arc length of a polyline at each of its points, (n + 1,), from its steps, (n, 3)."""
    return np.concatenate([[0.0], np.cumsum(np.linalg.norm(steps, axis=1))])


def leg_lengths(curve: SurfaceCurve) -> FloatArray:
    """Lengths between consecutive control points, (k,) if the curve is closed, else (k - 1,).

    On a closed curve, the first leg begins at the first control point. A leg of a closed curve with
    a single control point is the whole curve. Control points that the curve misses do not count.
    """
    arcs = arc_lengths(curve.steps)
    passed = curve.control_index[curve.control_index >= 0]
    at = arcs[np.sort(passed)]
    if not curve.closed:
        return np.diff(at)
    legs = np.diff(at, append=at[:1] + arcs[-1])
    return np.roll(legs, -int((passed < passed[:1]).sum()))


def points_of_leg(curve: SurfaceCurve, leg: int) -> IntArray:
    """Indices of the points of a leg, from its control point to the next one, both included."""
    index, count = curve.control_index, len(curve.faces)
    start, end = index[leg], index[(leg + 1) % len(index)]
    return np.arange(start, end + count * (curve.closed and end <= start) + 1) % count


def with_other_leg(
    mesh: Mesh, curve: SurfaceCurve, leg: int, replacement: SurfaceCurve
) -> SurfaceCurve:
    """A curve with one leg replaced by an open curve through the same two control points.

    A closed curve then begins at the control point at which the leg begins.
    """
    first, last = replacement.control_index
    new, taken = np.arange(first, last), points_of_leg(curve, leg)
    start, length = taken[0], len(taken) - 1
    before = np.arange(0 if curve.closed else start)
    rest = len(curve.faces) - length - len(before)
    after = (taken[-1] + np.arange(rest)) % len(curve.faces)
    parts = ((curve, before), (replacement, new), (curve, after))
    index = curve.control_index
    if curve.closed:
        index = (index - start) % len(curve.faces)
    moves = index >= len(before) + length
    return curve_on_mesh(
        mesh,
        curve.closed,
        np.concatenate([each.faces[points] for each, points in parts]),
        np.concatenate([each.barycentric[points] for each, points in parts]),
        index + np.where(moves, len(new) - length, 0),
    )


def along_leg(curve: SurfaceCurve, leg: int, positions: FloatArray) -> FloatArray:
    """How far along a leg the nearest point to each position, (k, 3), is, counted in segments."""
    line = curve.points[points_of_leg(curve, leg)]
    start, step = line[:-1], np.diff(line, axis=0)
    squared = np.maximum((step * step).sum(axis=1), np.finfo(np.float64).tiny)
    share = ((positions[:, None] - start) * step).sum(axis=2) / squared
    share = np.clip(share, 0.0, 1.0)
    away = np.linalg.norm(start + share[:, :, None] * step - positions[:, None], axis=2)
    nearest = away.argmin(axis=1)
    return nearest + np.take_along_axis(share, nearest[:, None], axis=1)[:, 0]


def checked_curve(
    mesh: Mesh, curve: SurfaceCurve, across_gaps: bool = False
) -> tuple[SurfaceCurve, IntArray]:
    """Check that a curve lies on a mesh, and find a face of each segment.

    Parameters
    ----------
    mesh : Mesh
    curve : SurfaceCurve
    across_gaps : bool
        Whether the faces on both sides of an edge that the curve crosses need not share vertices,
        as in a soup or at a T-junction. The ends of each segment then lie on its face up to
        `tolerances.GAP`.

    Returns
    -------
    SurfaceCurve
        The curve with arrays of the right types, without barycentric coordinates that are zero up
        to rounding.
    (n,) int array
        A face that contains each point and the next one. For an open curve, the last entry is
        meaningless.

    Raises
    ------
    CurveError
        If an array has the wrong shape or type, or the curve does not lie on this mesh.
    """
    curve = _readable(curve)
    faces, barycentric = curve.faces, curve.barycentric
    least = 3 if curve.closed else 2
    if len(faces) < least:
        raise CurveError(f"curve has {len(faces)} points, too few; it needs {least}")
    off = (faces < 0) | (faces >= len(mesh.faces))
    off |= ~(barycentric >= -ROUNDED).all(axis=1)
    off |= ~(np.abs(barycentric.sum(axis=1) - 1.0) <= BARYCENTRIC_SUM)
    if off.any():
        first = int(off.argmax())
        raise CurveError(
            f"curve is not on this mesh: its point {first} has face {faces[first]} and coordinates "
            f"{barycentric[first].tolist()}; pass the mesh that it was designed on"
        )
    barycentric = without_small_weights(barycentric)
    curve = replace(curve, barycentric=barycentric)
    return curve, _segment_faces(mesh, curve, across_gaps)


def lies_on(mesh: Mesh, curve: SurfaceCurve) -> bool:
    """Whether consecutive points of a curve have a common face."""
    try:
        checked_curve(mesh, curve)
    except CurveError:
        return False
    return True


def weights_in_faces(
    mesh: Mesh, faces: IntArray, barycentric: FloatArray, others: IntArray
) -> FloatArray:
    """Barycentric coordinates of points in other faces that hold them, (n, 3).

    Where the other face lacks a vertex of the point, as across a gap, they are those of the nearest
    point of that face.

    Parameters
    ----------
    mesh : Mesh
    faces : (n,) int array
        Face in which each point is given.
    barycentric : (n, 3) float array
        Coordinates in these faces.
    others : (n,) int array
        Faces in which coordinates are wanted.
    """
    weights = weights_at(mesh.faces[faces], barycentric, mesh.faces[others])
    support = np.where(barycentric > 0.0, mesh.faces[faces], -1)
    for point in np.flatnonzero(~_contains(mesh.faces[others], support)).tolist():
        position = barycentric[point] @ mesh.vertices[mesh.faces[faces[point]]]
        nearest, _ = nearest_points(mesh, position[None], others[[point]])
        weights[point] = nearest.barycentric[0]
    return weights


def _readable(curve: SurfaceCurve) -> SurfaceCurve:
    """The curve with arrays of the right types; raises CurveError if that is impossible."""
    if not isinstance(curve.closed, bool | np.bool_):
        raise CurveError(f"curve.closed is {curve.closed!r}; pass True or False")
    values: dict[str, Any] = {}
    for name in ("faces", "barycentric", "points", "control_index"):
        convert = whole_numbers if name in ("faces", "control_index") else real_array
        try:
            values[name] = convert(getattr(curve, name))
        except (TypeError, ValueError, OverflowError) as error:
            raise CurveError(f"curve.{name} cannot be read as numbers ({error})") from error
    n, index = values["faces"].size, values["control_index"]
    shapes = {
        "faces": (n,),
        "barycentric": (n, 3),
        "points": (n, 3),
        "control_index": (index.size,),
    }
    for name, shape in shapes.items():
        if values[name].shape != shape:
            raise CurveError(f"curve.{name} has shape {values[name].shape}; pass {shape}")
    if (index < -1).any() or (index >= n).any():
        raise CurveError(f"curve.control_index has values outside -1 … {n - 1}")
    return SurfaceCurve(bool(curve.closed), **values)


def without_small_weights(
    barycentric: FloatArray, margin: FloatArray | float = ROUNDED
) -> FloatArray:
    """Set barycentric coordinates up to a margin, or (n,), to zero, and scale the rest to sum 1."""
    kept = np.where(barycentric <= np.asarray(margin)[..., None], 0.0, barycentric)
    return kept / kept.sum(axis=1, keepdims=True)


def resample(points: FloatArray, count: int, closed: bool = True) -> tuple[FloatArray, IntArray]:
    """Sample points at equal distances along a polyline.

    The samples begin at the first point of the polyline. If the polyline is open, they end at its
    last point.

    Returns
    -------
    (count, 3) float array
        Positions of the samples.
    (count,) int array
        Index of the segment that contains each sample.
    """
    line = np.concatenate([points, points[:1]]) if closed else points
    arc = arc_lengths(np.diff(line, axis=0))
    wanted = np.linspace(0.0, arc[-1], count, endpoint=not closed)
    even = np.stack([np.interp(wanted, arc, line[:, axis]) for axis in range(3)], axis=1)
    segment = np.clip(np.searchsorted(arc, wanted, side="right") - 1, 0, len(line) - 2)
    return even, segment.astype(np.int64)


def shared_faces(mesh: Mesh, points: SurfacePoints) -> IntArray:
    """A face that contains each point and the next one, the first after the last; -1 if none does.

    Parameters
    ----------
    mesh : Mesh
    points : SurfacePoints
        The n points.

    Returns
    -------
    (n,) int array
    """
    faces, following = points.faces, np.roll(np.arange(len(points)), -1)
    support = np.where(points.barycentric > 0.0, mesh.faces[faces], -1)
    found = faces.copy()
    unknown = ~_contains(mesh.faces[found], support[following])
    found[unknown] = faces[following][unknown]
    unknown &= ~_contains(mesh.faces[found], support)
    for point in np.flatnonzero(unknown).tolist():
        both = np.concatenate([support[point], support[following[point]]])
        common = mesh.faces_with(both[both >= 0])
        found[point] = common[0] if len(common) else -1
    return found


def _segment_faces(mesh: Mesh, curve: SurfaceCurve, across_gaps: bool) -> IntArray:
    """A face that contains each point and the next one, shape (n,)."""
    n = len(curve.faces)
    found = shared_faces(mesh, points_of(curve))
    for point in np.flatnonzero(found < 0).tolist():
        beyond = (point + 1) % n
        if beyond == 0 and not curve.closed:
            found[point] = curve.faces[point]
            continue
        common = _faces_near(mesh, curve, point, beyond) if across_gaps else found[:0]
        if not len(common):
            raise CurveError(
                f"curve is not on this mesh: no face contains its points {point} and {beyond}; "
                "pass the mesh that it was designed on, or, if faces there share no vertices, "
                "merge vertices by distance and design it again"
            )
        found[point] = common[0]
    return found


def _faces_near(mesh: Mesh, curve: SurfaceCurve, one: int, other: int) -> IntArray:
    """Those of the faces of two points that also hold the other point, up to a gap."""
    positions = points_of(curve)[np.array([one, other])].positions(mesh)
    within = max(GAP * mesh.diagonal, rounding(positions))
    sides = ((curve.faces[other], positions[:1]), (curve.faces[one], positions[1:]))
    return np.array(
        [face for face, place in sides if nearest_points(mesh, place, face[None])[1][0] <= within],
        dtype=np.int64,
    )


def _contains(corners: IntArray, support: IntArray) -> BoolArray:
    """Whether each face has all vertices of its row of ``support``, which is padded with -1."""
    found = (support[:, :, None] == corners[:, None, :]).any(axis=2)
    return (found | (support < 0)).all(axis=1)
