"""Straight traces over the faces of a mesh: between two points, or of a given length from a point.

A trace is a normal section: the intersection of the surface with a plane that contains the surface
normal. The signs of the corners' heights above this plane decide which side of a face is crossed
next, so a trace cannot get lost between two faces. Two consecutive points of a trace lie in one
face, which is the face stored with the first of them.

All traces of a call advance together, a few faces at a time: first the sides that they cross are
found, then the lengths between these sides, then where each trace ends. The cost depends on the
number of faces passed, not on the size of the mesh.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..progress import checkpoint
from . import tolerances
from .array_types import BoolArray, FloatArray, IntArray
from .mesh import Mesh
from .surface_points import SurfacePoints, corners_of, interpolated
from .vectors import cross, dot, lengths

MOST_FACES = 4096
"""Maximum number of faces of a trace. A longer trace runs around the surface and is not a short
connection."""

SIDES_AT_ONCE, FEWEST_AT_ONCE, MOST_AT_ONCE = 800, 3, 16
"""Number of sides that all traces together cross between two tests for traces that have ended, and
the least and the greatest number for a single trace."""

FOLDS = 4.0
"""Extra length allowed to a trace before backward parts over folded faces are subtracted, in mean
edge lengths."""


@dataclass(frozen=True)
class Traces:
    """Traces between m pairs of points; the points themselves are not included.

    Attributes
    ----------
    reached : (m,) bool array
        Whether each trace reached its end. Traces that failed have no crossings.
    pair : (q,) int array
        Index of the pair to which each crossing belongs, ascending.
    crossings : SurfacePoints
        Crossings with edges, in order along each trace. Each is given in the face that the trace
        enters there.
    """

    reached: BoolArray
    pair: IntArray
    crossings: SurfacePoints


def trace_between(
    mesh: Mesh,
    start: SurfacePoints,
    end: SurfacePoints,
    normals: FloatArray,
    longest: FloatArray,
    folded: BoolArray | None = None,
    ahead: FloatArray | None = None,
) -> Traces:
    """Trace from points inside faces to other points nearby.

    A trace over folded faces runs forward, backward and forward again. The length of the backward
    part is subtracted.

    Parameters
    ----------
    mesh : Mesh
    start : SurfacePoints
        m points, each strictly inside its face.
    end : SurfacePoints
        m points anywhere. A point on an edge or at a vertex is reached in every face that contains
        it.
    normals : (m, 3) float array
        Vectors that the planes contain, besides those from the starts to the ends.
    longest : (m,) float array
        Greatest length of each trace up to the face of its end, in mesh units.
    folded : (F,) bool array, optional
        Whether each face of the mesh is folded back over its neighbours.
    ahead : (m, 3) float array, optional
        Directions in which the traces leave their starts; by default towards the ends. Round the
        edge of a thin part, a trace may have to begin in another direction.
    """
    origin, goal = start.positions(mesh).T, end.positions(mesh).T
    margin = 0.0 if folded is None else FOLDS * mesh.mean_edge_length
    reached = _contains(mesh, end, start.faces[None])[0]
    index = np.flatnonzero(~reached)
    origin, forward = origin.take(index, axis=1), (goal - origin).take(index, axis=1)
    ahead = forward if ahead is None else ahead.T.take(index, axis=1)
    across = cross(normals.T.take(index, axis=1), forward)
    first = start.faces.take(index)
    offset = corners_of(mesh, first) - origin
    fronts = _fronts(index, first, origin, across, offset, ahead)
    travelled = covered = np.zeros(len(fronts.index))
    parts, passed = [], 0
    while passed < MOST_FACES and len(fronts.index):
        checkpoint()
        strip, onward = _advanced(mesh, fronts)
        step, index = strip.lengths, fronts.index
        signed = step if folded is None else np.where(folded[strip.sides // 3], -step, step)
        travelled, covered = travelled + step.cumsum(0), covered + signed.cumsum(0)
        lost = strip.blocked | strip.closed | (travelled > longest[index] + margin)
        last, going = _first(lost | _contains(mesh, end[index], strip.entered))
        arrived = np.flatnonzero(~going & ~lost[last, np.arange(len(index))])
        reached[index[arrived]] = covered[last[arrived], arrived] <= longest[index[arrived]]
        row, column = np.nonzero(np.arange(len(step))[:, None] <= last)
        parts.append(
            (index[column], *(of[row, column] for of in (strip.entered, strip.sides, strip.shares)))
        )
        passed += len(step)
        left = np.flatnonzero(going)
        fronts = onward.taken(left)
        travelled, covered = travelled[-1, left], covered[-1, left]
    if not parts:
        return Traces(reached, np.zeros(0, np.int64), start[np.zeros(0, np.int64)])
    pair, faces, sides, shares = (np.concatenate(part) for part in zip(*parts, strict=True))
    kept = np.flatnonzero(reached[pair])
    kept = kept[np.argsort(pair[kept], kind="stable")]
    pair, faces = pair[kept], faces[kept]
    points = SurfacePoints(faces, _on_sides(mesh, faces, sides[kept], shares[kept]))
    once = _last_of_each_vertex(mesh, pair, points)
    return Traces(reached, pair[once], points[once])


def _last_of_each_vertex(mesh: Mesh, pair: IntArray, crossings: SurfacePoints) -> IntArray:
    """Crossings to keep: of consecutive crossings of a trace at one vertex, only the last."""
    inside = crossings.barycentric.T > 0.0
    place = np.flatnonzero(inside.sum(axis=0) == 1)
    vertex = mesh.faces[crossings.faces[place], inside[:, place].argmax(axis=0)]
    again = (place[1:] - place[:-1] == 1) & (vertex[1:] == vertex[:-1])
    again &= pair[place[1:]] == pair[place[:-1]]
    last = np.ones(len(pair), dtype=bool)
    last[place[:-1][again]] = False
    return np.flatnonzero(last)


def trace_from(
    mesh: Mesh,
    start: SurfacePoints,
    direction: FloatArray,
    length: FloatArray,
    folded: BoolArray | None = None,
) -> tuple[SurfacePoints, BoolArray, int]:
    """Move points straight along the surface.

    Over folded faces a trace runs backward, so the length that remains grows there, and the trace
    ends beyond the fold. This does not apply to a point that starts in a folded face.

    A point stays where it is if its trace returns to its first face, or passes more than
    `MOST_FACES` faces.

    Parameters
    ----------
    mesh : Mesh
    start : SurfacePoints
        m points, each strictly inside its face.
    direction : (m, 3) float array
        Unit vectors, nearly tangent to the faces.
    length : (m,) float array
        Distances to move, in mesh units; not negative.
    folded : (F,) bool array, optional
        Whether each face of the mesh is folded back over its neighbours.

    Returns
    -------
    SurfacePoints
        The moved points, strictly inside their faces.
    (m,) bool array
        Whether each point stopped at a boundary or a non-manifold edge.
    int
        Greatest number of faces that any point passed; it determines the cost of the call.
    """
    corners, weights = corners_of(mesh, start.faces), start.barycentric.T
    origin = interpolated(corners, weights)
    across = cross(mesh.face_normals.take(start.faces, axis=0).T, direction.T)
    offset = corners - origin
    height = dot(offset.swapaxes(0, 1), across[:, None])
    # Most points stay in their faces. There, barycentric coordinates change linearly, in proportion
    # to the differences of the corners' heights above the plane.
    change = height.take(FIRST_END, axis=0) - height.take(SECOND_END, axis=0)
    speed = lengths(interpolated(offset, change))
    inside = weights + length / np.where(speed > 0.0, speed, 1.0) * change
    index = np.flatnonzero(~(inside >= tolerances.INSIDE).all(axis=0) & (length > 0.0))
    faces, barycentric = start.faces.copy(), inside.T.copy()
    barycentric[index] = start.barycentric[index]
    blocked = np.zeros(len(length), dtype=bool)
    blocked[index] = True
    fronts = _fronts(
        index, faces.take(index), origin.take(index, axis=1), across.take(index, axis=1),
        offset.take(index, axis=2), direction.T.take(index, axis=1),
    )  # fmt: skip
    blocked[fronts.index] = False
    left, passed, most_passed = length[fronts.index], 0, 0
    ends = []
    while passed < MOST_FACES and len(fronts.index):
        checkpoint()
        strip, onward = _advanced(mesh, fronts)
        step = signed = strip.lengths
        back = np.zeros(1, dtype=bool)
        if folded is not None:
            back = folded[strip.sides // 3] & ~folded[fronts.start]
            signed = np.where(back, -step, step)
        covered = signed.cumsum(0)
        stops = (~back & (covered >= left)) | strip.blocked
        last, going = _first(stops | strip.closed)
        most_passed = passed + int(last.max()) + 1
        column = np.flatnonzero(stops[last, np.arange(len(last))])
        row = last[column]
        here = row, column
        to_go = left[column] - covered[here] + signed[here]
        # The side through which the trace has entered its last face; unused in its first face.
        crossed = np.where(row > 0, strip.sides[row - 1, column], fronts.crossed[column])
        share = np.where(row > 0, strip.shares[row - 1, column], fronts.share[column])
        ends.append(
            (fronts.index[column], row + passed, crossed, share, strip.sides[here],
             strip.shares[here], to_go, step[here])
        )  # fmt: skip
        passed += len(step)
        further = np.flatnonzero(going)
        left, fronts = left[further] - covered[-1, further], onward.taken(further)
    if ends:
        index, row, crossed, entry, side, share, to_go, step = (
            np.concatenate(part) for part in zip(*ends, strict=True)
        )
        faces[index] = side // 3
        blocked[index] = to_go > step
        begin = np.where(
            row == 0, start.barycentric[index].T, _on_sides(mesh, faces[index], crossed, entry).T
        )
        end = _on_sides(mesh, faces[index], side, share).T
        share = np.minimum(to_go, step) / np.maximum(step, tolerances.TINY)
        barycentric[index] = (begin + share * (end - begin)).T
    return SurfacePoints(faces, strictly_inside(barycentric)), blocked, most_passed


def strictly_inside(barycentric: FloatArray) -> FloatArray:
    """Barycentric coordinates, (n, 3), moved off the sides and corners of their faces.

    Coordinates below `tolerances.INSIDE` are raised to it, up to the scaling to sum 1.
    """
    moved = np.maximum(barycentric, tolerances.INSIDE).T
    return (moved / (moved[0] + moved[1] + moved[2])).T


@dataclass(frozen=True)
class _Fronts:
    """Traces in progress, each about to cross a side of its current face.

    Side 3 f + j of the mesh is opposite corner j of face f and runs from corner j + 1 to corner
    j + 2. Of the side that is crossed next, one end lies above the plane of the trace or in it, and
    the other end lies below.
    """

    index: IntArray  # (w,) indices of the traces in the call
    start: IntArray  # (w,) first faces of the traces
    origin: FloatArray  # (3, w) start points of the traces
    across: FloatArray  # (3, w) normals of the planes
    side: IntArray  # (w,) sides that are crossed next
    first: FloatArray  # (w,) heights of their first ends above the planes
    second: FloatArray  # (w,) heights of their second ends
    crossed: IntArray  # (w,) sides crossed last; before the first crossing, meaningless
    share: FloatArray  # (w,) crossings with them, as fractions from the first end to the second
    position: FloatArray  # (3, w) positions of these crossings; before the first, start points

    def taken(self, which: IntArray) -> _Fronts:
        """A subset of the traces, by indices."""
        if len(which) == len(self.index):
            return self
        return _Fronts(
            self.index.take(which), self.start.take(which), self.origin.take(which, axis=1),
            self.across.take(which, axis=1), self.side.take(which), self.first.take(which),
            self.second.take(which), self.crossed.take(which), self.share.take(which),
            self.position.take(which, axis=1),
        )  # fmt: skip


@dataclass(frozen=True)
class _Strip:
    """The next s sides that w traces cross; all arrays have shape (s, w)."""

    sides: IntArray  # sides of the faces that the traces leave
    entered: IntArray  # faces beyond the sides; the faces that are left where `blocked`
    shares: FloatArray  # crossings, as fractions from the first end of the side to the second
    lengths: FloatArray  # lengths of the traces in the faces that they leave
    blocked: BoolArray  # whether no face, or more than one, lies beyond the side
    closed: BoolArray  # whether the face beyond is the first face of the trace


def _fronts(
    index: IntArray,
    start: IntArray,
    origin: FloatArray,
    across: FloatArray,
    offset: FloatArray,
    forward: FloatArray,
) -> _Fronts:
    """Traces at their starts, without those whose plane does not cross their first face.

    Parameters
    ----------
    index, start : (w,) int array
        Indices of the traces in the call, and their first faces.
    origin, across, forward : (3, w) float array
        Start points, normals of the planes, and directions in which the traces leave.
    offset : (3, 3, w) float array
        Vectors from the start points to the corners of the faces: corner, component, trace.
    """
    corners = offset.swapaxes(0, 1)
    height, along = dot(corners, across[:, None]), dot(corners, forward[:, None])
    first, second = height.take(FIRST_END, axis=0), height.take(SECOND_END, axis=0)
    # The plane crosses two sides. The trace leaves through the side farther along `forward`.
    crossed = (first >= 0.0) != (second >= 0.0)
    shares = first / np.where(crossed, first - second, 1.0)
    along, ends = along.take(FIRST_END, axis=0), along.take(SECOND_END, axis=0)
    along = along + shares * (ends - along)
    corner = np.where(crossed, along, -np.inf).argmax(axis=0)
    ahead = corner, np.arange(len(index))
    side = 3 * start + corner
    fronts = _Fronts(
        index, start, origin, across, side, first[ahead], second[ahead], side, shares[ahead],
        origin,
    )  # fmt: skip
    return fronts.taken(np.flatnonzero(crossed[ahead]))


def _advanced(mesh: Mesh, fronts: _Fronts) -> tuple[_Strip, _Fronts]:
    """Follow traces over the next faces; returns the sides crossed, and the fronts after these.

    After a blocked side a trace continues in the face that it should have left. These entries are
    meaningless, and the caller ignores them.
    """
    at_once = SIDES_AT_ONCE // max(1, len(fronts.index))
    count = min(max(at_once, FEWEST_AT_ONCE), MOST_AT_ONCE)
    vertex = mesh.faces.ravel()
    size = count, len(fronts.index)
    sides, entered, shares = np.empty(size, np.int64), np.empty(size, np.int64), np.empty(size)
    side, first, second = fronts.side, fronts.first, fronts.second
    for row in range(count):
        beyond = mesh.opposite_sides.take(side)
        sides[row], entered[row], shares[row] = side, beyond, first / (first - second)
        # Consistently oriented faces traverse their common side in opposite directions.
        before, after = second, first
        if not mesh.is_oriented:
            same = vertex.take(_ends(side)[0]) == vertex.take(_ends(beyond)[0])
            before, after = np.where(same, first, second), np.where(same, second, first)
        # The next side joins the third corner and the end on the other side of the plane from it.
        position = mesh.vertices.take(vertex.take(beyond), axis=0).T
        height = dot(position - fronts.origin, fronts.across)
        like_before = (height >= 0.0) == (before >= 0.0)
        side = beyond + TURNS.take(2 * (beyond % 3) + like_before)
        first, second = np.where(like_before, after, height), np.where(like_before, height, before)
    begin, end = _ends(sides)
    low = mesh.vertices.take(vertex.take(begin), axis=0).transpose(2, 0, 1)
    high = mesh.vertices.take(vertex.take(end), axis=0).transpose(2, 0, 1)
    points = np.empty((3, count + 1, size[1]))
    points[:, 0], points[:, 1:] = fronts.position, low + shares * (high - low)
    face = entered // 3
    strip = _Strip(
        sides, face, shares, lengths(points[:, 1:] - points[:, :-1]), entered == sides,
        face == fronts.start,
    )  # fmt: skip
    onward = _Fronts(
        fronts.index, fronts.start, fronts.origin, fronts.across, side, first, second,
        sides[-1], shares[-1], points[:, -1],
    )  # fmt: skip
    return strip, onward


FIRST_END, SECOND_END = np.array([1, 2, 0]), np.array([2, 0, 1])
"""Corners at the first and the second end of the side opposite each corner."""

TURNS = np.stack([SECOND_END, FIRST_END], axis=1) - np.arange(3)[:, None]
"""Differences in index from each side to the sides opposite its second and its first end."""


def _ends(side: IntArray) -> tuple[IntArray, IntArray]:
    """Indices 3 f + j of the corners at the first and the second end of sides.

    They are also the indices of the sides opposite these corners.
    """
    corner = side % 3
    face = side - corner
    return face + FIRST_END.take(corner), face + SECOND_END.take(corner)


def _first(events: BoolArray) -> tuple[IntArray, BoolArray]:
    """Row of the first event in each column, or the last row; and whether a column has no event."""
    row = events.argmax(axis=0)
    none = ~events[row, np.arange(events.shape[1])]
    row[none] = len(events) - 1
    return row, none


def _on_sides(mesh: Mesh, faces: IntArray, sides: IntArray, shares: FloatArray) -> FloatArray:
    """Barycentric coordinates in faces, (p, 3), of points on sides of these or adjacent faces.

    ``shares`` are fractions from the first end of each side to the second.
    """
    vertex, corners = mesh.faces.ravel(), mesh.faces.take(faces, axis=0).T
    first, second = (vertex.take(end) for end in _ends(sides))
    return ((corners == first) * (1.0 - shares) + (corners == second) * shares).T


def _contains(mesh: Mesh, points: SurfacePoints, faces: IntArray) -> BoolArray:
    """Whether each point lies in the faces of its column, (s, m).

    A point on an edge or at a vertex lies in all faces that contain it.
    """
    holds = faces == points.faces
    on_side = np.flatnonzero((points.barycentric.T == 0.0).any(axis=0))
    if len(on_side):
        support = mesh.faces[points.faces[on_side]]
        corners = mesh.faces[faces[:, on_side]]
        found = (support[:, :, None] == corners[:, :, None, :]).any(axis=3)
        holds[:, on_side] = (found | (points.barycentric[on_side] == 0.0)).all(axis=2)
    return holds
