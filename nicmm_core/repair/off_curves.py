"""The part of the surface that keeps a distance from given curves and that they do not divide.

Like obstacles, curves to avoid are removed from the surface before anything is solved, so every
stage respects them. What is removed ends at edges of the surface that remains:

- With a clearance, faces near the curves are bisected until they resolve the line at this distance,
  and divided along it. Distances along the surface are exact (`geometry.segment_distances`).
- A barrier is removed along parts of the curves that have no clearance: faces are cut along the
  curve, and a strip, narrow relative to the edges there, is taken off.

A control point on an avoided curve is a junction. Around it the barrier has a gap, through which
the curve can pass, and the clearance does not count within `FADE` clearances along the curve.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import nicmm_kernels
import numpy as np
from scipy.spatial import cKDTree
from scipy.spatial.distance import cdist

from ..errors import ArgumentError, ControlPointError, CurveError, PointName, UnreachableError
from ..geometry import tolerances
from ..geometry.array_types import BoolArray, FloatArray, IntArray
from ..geometry.crossings import meeting_places
from ..geometry.curve import SurfaceCurve, checked_curve, curve_on_mesh, weights_in_faces
from ..geometry.mesh import Mesh, edge_keys, edge_lengths, opposite_sides, side_keys
from ..geometry.segment_distances import FaceSegments, SegmentDistances, joined_segments
from ..geometry.surface_points import SurfacePoints
from ..outputs.cut import CutMesh, cut_mesh
from ..progress import checkpoint
from .clean_surface import CleanSurface
from .face_parts import FaceParts, whole_faces
from .junctions import straight_at_junctions
from .mapped_mesh import MappedMesh
from .nonmanifold import manifold
from .removed_faces import points_at

FADE = 2.0
"""Length of an avoided curve, on either side of a junction, without clearance; in clearances."""

LEVEL = 1.02
"""Distance at which the surface is divided, in clearances.

The distance that is kept differs from it by up to `SNAP` and about `ERROR`, so it is not less than
the clearance."""

COARSEST = 2.0
"""Greatest longest edge of the faces that are divided at the clearance, in clearances."""

FINEST = 1.0 / 16.0
"""Length of an edge up to which faces are accurate enough in any case, in clearances."""

ERROR = 0.012
"""Greatest error of distances that are interpolated on these faces, at their centroids and in the
middle of their sides, in clearances. Faces with greater errors are bisected further."""

SNAP = 0.006
"""Distance up to which the line at the clearance is moved to a vertex, in clearances."""

MEETING = 1e-8
"""Greatest distance between a control point and the place at which the curve may meet an avoided
curve, in bounding-box diagonals."""

REACH = 1.25
"""Distance beyond the line up to which distances are computed, in lengths of the longest edge of
the faces there, if that is at most `COARSEST`."""

RINGS = 3
"""Number of rings of faces, around those within reach, that may be bisected with them."""

STRIP = 0.004
"""Width of a barrier on either side of the curve, as a fraction of the edges there."""

DEVIATION = 1e-3
"""Greatest distance of a barrier from the curve, in mean edge lengths."""

STRIP_OF_CLEARANCE = 0.1
"""Greatest such width, in clearances."""

GAP = 0.02
"""Half the width of the gap at a junction, as a fraction of the longest edge there."""

STRAIGHT = 2.0
"""Distance from a junction up to which a curve is made straight, if necessary; in such widths."""

GAP_OF_CLEARANCE = 0.5
"""Greatest half width of a gap, in clearances."""


@dataclass(frozen=True)
class Avoided:
    """A curve to avoid, checked, with its junctions.

    Attributes
    ----------
    curve : SurfaceCurve
        A curve on the given mesh.
    segment_faces : (n,) int array
        A face that contains each point and the next one.
    junctions : (j,) float array
        Arc lengths from its first point at which control points lie.
    """

    curve: SurfaceCurve
    segment_faces: IntArray
    junctions: FloatArray

    def equals(self, other: Avoided) -> bool:
        """Whether two curves and their junctions are the same."""
        return (
            self.curve.closed == other.curve.closed
            and np.array_equal(self.curve.faces, other.curve.faces)
            and np.array_equal(self.curve.barycentric, other.curve.barycentric)
            and np.array_equal(self.junctions, other.junctions)
        )

    @cached_property
    def arcs(self) -> FloatArray:
        """Arc length at the beginning of each segment, and the total length."""
        return np.concatenate([[0.0], np.cumsum(np.linalg.norm(self.curve.steps, axis=1))])

    def pieces(self, mesh: Mesh, breaks: FloatArray) -> tuple[FaceSegments, FloatArray]:
        """The segments of the curve, divided at some arc lengths.

        Returns
        -------
        FaceSegments
        (s,) float array
            Arc length in the middle of each.
        """
        arcs, curve = self.arcs, self.curve
        total, count = arcs[-1], len(arcs) - 1
        breaks = breaks % total if curve.closed else breaks
        breaks = np.unique(breaks[(breaks > 0.0) & (breaks < total)])
        breaks = breaks[~np.isin(breaks, arcs)]
        at = np.sort(np.concatenate([arcs, breaks]))
        segment = (np.searchsorted(arcs, at[:-1], side="right") - 1).clip(0, count - 1)
        length = np.maximum(arcs[segment + 1] - arcs[segment], tolerances.TINY)
        faces = self.segment_faces[segment]
        following = (segment + 1) % len(curve.faces)
        low, high = (
            weights_in_faces(mesh, curve.faces[ends], curve.barycentric[ends], faces)
            for ends in (segment, following)
        )
        begin, stop = (
            ((each - arcs[segment]) / length).clip(0.0, 1.0)[:, None] for each in (at[:-1], at[1:])
        )
        found = FaceSegments(
            faces, (1.0 - begin) * low + begin * high, (1.0 - stop) * low + stop * high
        )
        return found, 0.5 * (at[:-1] + at[1:])

    def positions(self, arc: FloatArray) -> FloatArray:
        """Positions at arc lengths, (s, 3)."""
        curve, arcs = self.curve, self.arcs
        line = np.concatenate([curve.points, curve.points[:1]]) if curve.closed else curve.points
        return np.stack([np.interp(arc, arcs, line[:, axis]) for axis in range(3)], axis=1)

    def from_junctions(self, arc: FloatArray) -> FloatArray:
        """Distance along the curve from arc lengths, (s,), to the nearest junction."""
        if not len(self.junctions):
            return np.full(len(arc), np.inf)
        away = np.abs(arc[:, None] - self.junctions)
        if self.curve.closed:
            away = np.minimum(away, self.arcs[-1] - away)
        return away.min(axis=1)

    def ends(self, reach: FloatArray | float) -> FloatArray:
        """Arc lengths at a distance from each junction, on either side."""
        return np.concatenate([self.junctions - reach, self.junctions + reach])


def avoided_curves(
    mesh: Mesh, curves: Sequence[SurfaceCurve], points: SurfacePoints
) -> list[Avoided]:
    """Curves to avoid, with the control points on them as junctions."""
    return [_avoided_curve(mesh, curve, points) for curve in curves]


def _avoided_curve(mesh: Mesh, curve: SurfaceCurve, points: SurfacePoints) -> Avoided:
    curve, segment_faces = checked_curve(mesh, curve, across_gaps=True)
    found = Avoided(curve, segment_faces, np.zeros(0))
    start = curve.points if curve.closed else curve.points[:-1]
    squared = np.maximum((curve.steps**2).sum(axis=1), tolerances.TINY)
    within = tolerances.COINCIDENT * mesh.diagonal
    junctions = []
    for position in points.positions(mesh):
        share = (((position - start) * curve.steps).sum(axis=1) / squared).clip(0.0, 1.0)
        away = np.linalg.norm(start + share[:, None] * curve.steps - position, axis=1)
        nearest = int(away.argmin())
        if away[nearest] <= within:
            arcs = found.arcs[nearest : nearest + 2]
            junctions.append((1.0 - share[nearest]) * arcs[0] + share[nearest] * arcs[1])
    return replace(found, junctions=np.array(junctions))


class DividedSurface(CleanSurface):
    """A surface with divided faces, some of which are left out."""

    @cached_property
    def removed(self) -> BoolArray:
        """Given faces that were removed although they are part of the surface: none, (F,)."""
        return np.zeros(len(self.original.faces), dtype=bool)


def surface_off_curves(
    mapped: MappedMesh, avoided: list[Avoided], clearance: float
) -> MappedMesh | None:
    """The part of a manifold that keeps a distance from curves and that they do not divide.

    Parameters
    ----------
    mapped : MappedMesh
        Map from the given mesh to the manifold.
    avoided : list of Avoided
        Curves on the given mesh.
    clearance : float

    Returns
    -------
    MappedMesh or None
        Map from the mesh of `mapped` to a mesh of parts of its faces; None if no face remains.
    """
    mesh = mapped.mesh
    parts, vertices = whole_faces(mesh.faces), mesh.vertices
    barriers = [piece for each in avoided for piece in _barriers(mapped, each, clearance)]
    if barriers:
        parts, vertices = _without_strips(mesh, barriers, clearance)
    if clearance > 0.0:
        near = [_with_clearance(mapped, each, clearance) for each in avoided]
        segments = joined_segments(near)
        if len(segments):
            distances = _distances(mesh, segments, clearance)
            parts, vertices = _beyond(distances, parts, vertices, clearance)
    if not len(parts.faces):
        return None
    place = np.arange(len(mesh.vertices))
    divided = DividedSurface(
        original=mesh,
        vertices=vertices,
        parts=parts,
        joined=place,
        place=place,
        divisions=np.zeros((0, 3), dtype=np.int64),
        repairs={},
    )
    return manifold(divided, np.arange(len(mesh.faces)), False)


def check_off_curves(
    off: MappedMesh | None, named: dict[str, SurfacePoints], clearance: float
) -> None:
    """Raise an error if points are too close to curves, or are separated by them.

    Parameters
    ----------
    off : MappedMesh or None
        Result of `surface_off_curves`.
    named : dict of str to SurfacePoints
        Points on the mesh from which it is made, by the name of their argument.
    clearance : float

    Raises
    ------
    ControlPointError
        If a point is closer to a curve than the clearance, but not on it.
    UnreachableError
        If points are separated by the curves, or nothing is left of the surface.
    """
    if off is None:
        raise UnreachableError(
            "avoid leaves no part of the surface; use a smaller clearance, or fewer curves"
        )
    component: dict[PointName, set[int]] = {}
    for argument, points in named.items():
        for index, point in enumerate(off.representations(points)):
            name = PointName(argument, index)
            if not len(point):
                raise ControlPointError(
                    f"{name} is closer to a curve of avoid than the clearance ({clearance:g}), or "
                    "right beside one, but does not lie on it; move it onto the curve or away from "
                    "it, or use a smaller clearance",
                    name,
                )
            component[name] = set(off.mesh.face_component[point.faces].tolist())
    first, common = next(iter(component.items()))
    for name, own in component.items():
        if not own & common:
            raise UnreachableError(
                f"the curves of avoid, with their clearance, separate {name} from {first}; leave "
                "out a curve, use a smaller clearance, or add a control point on a curve that may "
                "be crossed",
                name,
                first,
            )


def meeting_only_at_junctions(
    mesh: Mesh, curve: SurfaceCurve, avoided: list[Avoided], clearance: float
) -> SurfaceCurve:
    """A curve that meets avoided curves only at its junctions.

    If a curve crosses an avoided one beside a junction, it is made straight there.

    Raises
    ------
    UnreachableError
        If it also crosses one elsewhere.
    """
    if _crossed(mesh, curve, avoided) is None:
        return curve
    controls = curve.control_index[curve.control_index >= 0]
    at, reach = [], []
    for each in avoided:
        for arc, position in zip(each.junctions, each.positions(each.junctions), strict=True):
            away = np.linalg.norm(curve.points[controls] - position, axis=1)
            at.append(int(controls[away.argmin()]))
            reach.append(STRAIGHT * _gap(mesh, each, arc, clearance))
    straight = straight_at_junctions(mesh, curve, np.array(at, dtype=np.int64), np.array(reach))
    crossed = _crossed(mesh, straight, avoided)
    if crossed is not None:
        raise UnreachableError(
            f"the curve would cross avoid[{crossed}]; move control points away from it, or use "
            "a larger clearance"
        )
    return straight


def _crossed(mesh: Mesh, curve: SurfaceCurve, avoided: list[Avoided]) -> int | None:
    """Index of an avoided curve that a curve meets elsewhere than at junctions, or None."""
    return next((number for number, each in enumerate(avoided) if meets(mesh, curve, each)), None)


def meets(mesh: Mesh, curve: SurfaceCurve, avoided: Avoided) -> bool:
    """Whether a curve meets an avoided curve elsewhere than at junctions."""
    points = curve.points[curve.control_index[curve.control_index >= 0]]
    meeting = meeting_places(mesh, curve, avoided.curve)
    away = cdist(meeting, points).min(axis=1, initial=np.inf)
    return bool((away > MEETING * mesh.diagonal).any())


def is_too_close(
    mapped: MappedMesh, curve: SurfaceCurve, avoided: Avoided, clearance: float
) -> bool:
    """Whether a curve comes closer to an avoided curve than the clearance.

    Parameters
    ----------
    mapped : MappedMesh
        Map from the given mesh to a manifold.
    curve : SurfaceCurve
        A curve on the manifold. Its points and the middles of its segments count.
    avoided : Avoided
        A curve on the given mesh.
    clearance : float
        It does not count near junctions.
    """
    segments = _with_clearance(mapped, avoided, clearance)
    if not len(segments):
        return False
    curve, faces = checked_curve(mapped.mesh, curve, across_gaps=True)
    faces = faces if curve.closed else faces[:-1]
    index = np.arange(len(faces))
    start, end = (
        weights_in_faces(mapped.mesh, curve.faces[ends], curve.barycentric[ends], faces)
        for ends in (index, (index + 1) % len(curve.faces))
    )
    distances = _distances(mapped.mesh, segments, clearance)
    return any(
        bool((distances.at(SurfacePoints(faces, weights)) < clearance).any())
        for weights in (start, 0.5 * (start + end), end)
    )


def _with_clearance(mapped: MappedMesh, avoided: Avoided, clearance: float) -> FaceSegments:
    """The segments of a curve on the mesh from which the clearance is kept."""
    fade = FADE * clearance
    segments, arc = avoided.pieces(mapped.original, avoided.ends(fade))
    counts = avoided.from_junctions(arc) >= fade
    return _on_mesh(mapped, segments.taken(counts))


def _on_mesh(mapped: MappedMesh, segments: FaceSegments) -> FaceSegments:
    """Segments in faces of the given mesh as segments in all faces of the mesh that hold them."""
    if not mapped.differs:
        return segments
    given = mapped.original
    which, faces = [np.arange(len(segments))], [segments.faces]
    corners = given.faces[segments.faces]
    used = (segments.start > 0.0) | (segments.end > 0.0)
    for segment in np.flatnonzero(used.sum(axis=1) < 3).tolist():
        others = given.faces_with(corners[segment][used[segment]])
        which.append(np.full(len(others), segment))
        faces.append(others)
    segment, face = np.concatenate(which), np.concatenate(faces)
    start, end = (
        weights_in_faces(given, segments.faces[segment], weights[segment], face)
        for weights in (segments.start, segments.end)
    )
    index, part, first, last = mapped.in_given.clipped(face, start, end)
    begins, ends = (mapped.in_mesh.in_parents(SurfacePoints(part, w)) for w in (first, last))
    found = [(begins.faces, begins.barycentric, ends.barycentric)]
    # In a face that was removed, a segment is found by the positions of its ends.
    lost = np.setdiff1d(segment[mapped.clean.removed[face]], segment[index])
    farthest = tolerances.ON_SURFACE * given.diagonal
    for number in lost.tolist():
        one, other = (
            points_at(
                mapped.mesh,
                SurfacePoints(segments.faces[[number]], weights[[number]]).positions(given)
                - mapped.origin,
                farthest,
            )
            for weights in (segments.start, segments.end)
        )
        _, here, there = np.intersect1d(one.faces, other.faces, return_indices=True)
        found.append((one.faces[here], one.barycentric[here], other.barycentric[there]))
        found += [(each.faces, each.barycentric, each.barycentric) for each in (one, other)]
    return FaceSegments(*(np.concatenate(arrays) for arrays in zip(*found, strict=True)))


def _distances(mesh: Mesh, segments: FaceSegments, clearance: float) -> SegmentDistances:
    """Distances from the segments as far as they are needed."""
    # A straight distance is not greater than a distance along the surface.
    longest = _side_lengths(mesh.vertices, mesh.faces).max(axis=1)
    away, _ = cKDTree(np.concatenate(segments.positions(mesh))).query(
        mesh.vertices, distance_upper_bound=LEVEL * clearance + longest.max()
    )
    near = away[mesh.faces].min(axis=1) <= LEVEL * clearance + longest
    longest = min(longest[near].max(initial=0.0), COARSEST * clearance)
    try:
        return SegmentDistances(mesh, segments, LEVEL * clearance + REACH * longest)
    except nicmm_kernels.TooManyWindowsError as error:
        raise ArgumentError(
            f"clearance is {clearance:g}, which reaches over too many faces of this mesh; use a "
            "smaller one"
        ) from error


def _beyond(
    distances: SegmentDistances, parts: FaceParts, vertices: FloatArray, clearance: float
) -> tuple[FaceParts, FloatArray]:
    """The parts beyond the clearance, divided along the line at the clearance, and all vertices."""
    reached = distances.faces_reached
    touched = np.zeros(len(vertices), dtype=bool)
    near = reached[parts.parent]
    for _ in range(RINGS):
        touched[parts.faces[near]] = True
        near |= touched[parts.faces].any(axis=1)
    others, parts = parts.taken(~near), parts.taken(near)
    fixed = np.zeros(len(vertices), dtype=bool)
    fixed[others.faces] = True

    level = LEVEL * clearance
    refined = nicmm_kernels.refine_at_level(
        distances.paths,
        nicmm_kernels.PartArrays(
            np.ascontiguousarray(parts.faces),
            opposite_sides(parts.faces).astype(np.int64),
            np.ascontiguousarray(parts.parent),
            np.ascontiguousarray(parts.corners),
            np.ascontiguousarray(vertices),
            _distances_of_vertices(distances, parts, len(vertices)),
            fixed,
        ),
        reached,
        nicmm_kernels.LevelLimits(
            level, clearance, COARSEST * clearance, FINEST * clearance, ERROR * clearance
        ),
        checkpoint,
    )
    parts = FaceParts(refined.faces, refined.parents, refined.corners)
    values = refined.distances - level
    parts, vertices = _kept(parts, refined.vertices, values, SNAP * clearance)
    return others.joined(parts), vertices


def _distances_of_vertices(distances: SegmentDistances, parts: FaceParts, count: int) -> FloatArray:
    """Distances of the vertices of parts, (count,); infinite for other vertices."""
    vertex, first = np.unique(parts.faces, return_index=True)
    row, corner = np.divmod(first, 3)
    found = np.full(count, np.inf)
    found[vertex] = distances.at(SurfacePoints(parts.parent[row], parts.corners[row, corner]))
    return found


def _side_lengths(vertices: FloatArray, faces: IntArray) -> FloatArray:
    """Length of the side opposite each corner, (f, 3)."""
    sides = faces[:, [[1, 2], [2, 0], [0, 1]]].reshape(-1, 2)
    return edge_lengths(vertices, sides).reshape(-1, 3)


def _divided(
    parts: FaceParts, vertices: FloatArray, ends: IntArray, middle: IntArray, share: FloatArray
) -> tuple[FaceParts, FloatArray]:
    """Divide edges, (e, 2), at new vertices, in all parts; longer sides of a part first."""
    places = (1.0 - share)[:, None] * vertices[ends[:, 0]] + share[:, None] * vertices[ends[:, 1]]
    vertices = np.concatenate([vertices, places])
    size = len(vertices)
    keys = edge_keys(ends[:, 0], ends[:, 1], size)
    order = np.argsort(keys)
    keys, ends, middle, share = keys[order], ends[order], middle[order], share[order]
    lengths = edge_lengths(vertices, ends)
    while len(keys):
        sides = parts.faces[:, [[1, 2], [2, 0], [0, 1]]]
        of_sides = edge_keys(sides[..., 0], sides[..., 1], size)
        at = np.searchsorted(keys, of_sides).clip(max=len(keys) - 1)
        found = keys[at] == of_sides
        which = np.flatnonzero(found.any(axis=1))
        if not len(which):
            break
        long = np.where(found[which], lengths[at[which]], -1.0)
        edge = at[which, long.argmax(axis=1)]
        parts = parts.divided(which, ends[edge, 0], ends[edge, 1], middle[edge], share[edge])
    return parts, vertices


def _kept(
    parts: FaceParts, vertices: FloatArray, values: FloatArray, snap: float
) -> tuple[FaceParts, FloatArray]:
    """The parts with positive values, divided where the values change sign; and all vertices.

    Values up to `snap` become zero.
    """
    sign = np.where(values > snap, 1, np.where(values < -snap, -1, 0))
    ends = _edges(parts.faces[(sign[parts.faces] > 0).any(axis=1)], len(vertices))
    ends = ends[sign[ends].prod(axis=1) < 0]
    low, high = values[ends].T
    middle = len(vertices) + np.arange(len(ends))
    parts, vertices = _divided(parts, vertices, ends, middle, low / (low - high))
    at_corners = np.append(sign, np.zeros(len(ends), dtype=np.int64))[parts.faces]
    outside = (at_corners >= 0).all(axis=1) & (at_corners > 0).any(axis=1)
    # On a part whose corners all lie on the line, the values before snapping decide.
    on_line = (at_corners == 0).all(axis=1)
    mean = np.append(values, np.zeros(len(ends)))[parts.faces].sum(axis=1)
    return parts.taken(outside | (on_line & (mean > 0.0))), vertices


def _edges(faces: IntArray, size: int) -> IntArray:
    """The edges of faces whose corner indices are below ``size``, (e, 2), smaller index first."""
    return np.stack(np.divmod(np.unique(side_keys(faces, size)), size), axis=1)


def _barriers(mapped: MappedMesh, avoided: Avoided, clearance: float) -> list[SurfaceCurve]:
    """The parts of a curve on the mesh along which a strip is removed, without their gaps.

    With a clearance, these are the parts near junctions from which it is not kept.
    """
    given, junctions = mapped.original, avoided.junctions
    if clearance > 0.0 and not len(junctions):
        return []
    gap = np.array([_gap(given, avoided, arc, clearance) for arc in junctions])
    breaks = avoided.ends(gap)
    if clearance > 0.0:
        breaks = np.append(breaks, avoided.ends(FADE * clearance))
    segments, arc = avoided.pieces(given, breaks)
    used = np.ones(len(arc), dtype=bool)
    for junction, width in zip(junctions, gap, strict=True):
        used &= replace(avoided, junctions=np.array([junction])).from_junctions(arc) >= width
    if clearance > 0.0:
        used &= avoided.from_junctions(arc) <= FADE * clearance
    found = []
    for run, closed in _runs(used, avoided.curve.closed):
        faces, weights = segments.faces[run], segments.start[run]
        if not closed:
            faces = np.append(faces, faces[-1])
            weights = np.concatenate([weights, segments.end[run[-1:]]])
        piece = curve_on_mesh(given, closed, faces, weights, np.zeros(0, np.int64))
        there = mapped.curve_to(piece) if mapped.differs else piece
        if there is None:
            raise CurveError(
                "a curve of avoid enters an obstacle of weight 1 or cannot be mapped at a "
                "non-manifold edge; leave it out, or lower the weights there"
            )
        found.append(there)
    return found


def _runs(used: BoolArray, closed: bool) -> list[tuple[IntArray, bool]]:
    """Runs of consecutive segments that are used, and whether each of them is a closed curve."""
    segment = np.arange(len(used))
    if used.all():
        return [(segment, closed)]
    if closed:
        segment = np.roll(segment, -int((~used).argmax()))
    runs = np.split(segment, np.flatnonzero(~used[segment]))
    runs = [run[used[run]] for run in runs]
    return [(run, False) for run in runs if len(run)]


def _gap(mesh: Mesh, avoided: Avoided, arc: float, clearance: float) -> float:
    """Half the width of the gap at a junction."""
    segment = int(
        (np.searchsorted(avoided.arcs, arc, side="right") - 1).clip(0, len(avoided.arcs) - 2)
    )
    corners = mesh.faces[avoided.segment_faces[segment]]
    width = GAP * float(_side_lengths(mesh.vertices, mesh.faces[mesh.faces_at(corners)]).max())
    return min(width, GAP_OF_CLEARANCE * clearance) if clearance > 0.0 else width


def _without_strips(
    mesh: Mesh, barriers: list[SurfaceCurve], clearance: float
) -> tuple[FaceParts, FloatArray]:
    """The faces without a narrow strip along each of some curves, and the vertices of the parts."""
    parts, cut, chain = whole_faces(mesh.faces), mesh, np.zeros((0, 2), dtype=np.int64)
    for barrier in barriers:
        checkpoint()
        points, _ = parts.through(mesh, barrier)
        mapped = curve_on_mesh(
            cut, barrier.closed, points.faces, points.barycentric, barrier.control_index
        )
        result = cut_mesh(cut, mapped, deviation=DEVIATION * mesh.mean_edge_length)
        chain = np.concatenate([_with_new_points(cut, result, chain), result.chain_edges])
        corners = result.corner_weights(cut) @ parts.corners[result.source_face]
        parts = FaceParts(result.faces, parts.parent[result.source_face], corners)
        cut = result.mesh
    vertices = cut.vertices
    size = len(vertices)
    on_chain = np.zeros(size, dtype=bool)
    on_chain[chain] = True
    near = on_chain[parts.faces].sum(axis=1) >= 2
    sides = _edges(parts.faces[near], size)
    both = sides[on_chain[sides].all(axis=1)]
    both = both[
        ~np.isin(edge_keys(both[:, 0], both[:, 1], size), edge_keys(chain[:, 0], chain[:, 1], size))
    ]
    middle = size + np.arange(len(both))
    parts, vertices = _divided(parts, vertices, both, middle, np.full(len(both), 0.5))
    on_chain = np.append(on_chain, np.zeros(len(both), dtype=bool))

    touched = on_chain[parts.faces].any(axis=1)
    sides = _edges(parts.faces[touched], len(vertices))
    ends = sides[on_chain[sides].sum(axis=1) == 1]
    ends = np.where(on_chain[ends[:, :1]], ends, ends[:, ::-1])
    share = np.full(len(ends), STRIP)
    if clearance > 0.0:
        share = np.minimum(share, STRIP_OF_CLEARANCE * clearance / edge_lengths(vertices, ends))
    middle = len(vertices) + np.arange(len(ends))
    parts, vertices = _divided(parts, vertices, ends, middle, share)
    on_chain = np.append(on_chain, np.zeros(len(ends), dtype=bool))
    return parts.taken(~on_chain[parts.faces].any(axis=1)), vertices


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
