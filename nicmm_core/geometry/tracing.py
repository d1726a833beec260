"""Straight traces over the faces of a mesh: between two points, or from a point over a length.

A trace is a normal section: the intersection of the surface with a plane that contains its normal.
It is followed from face to face by the sides of the plane on which the corners lie, so it cannot
get lost between two faces. All traces of a call advance together. Two consecutive points of a
trace lie in one face, which is the face of the first of them.

The cost depends on the number of faces passed, not on the size of the mesh.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..progress import checkpoint
from . import tolerances
from .array_types import BoolArray, FloatArray, IntArray
from .mesh import Mesh
from .surface_points import SurfacePoints

MOST_FACES = 4096
"""Most faces of a trace; a longer one runs round the surface and is not a short connection."""

FOLDS = 4.0
"""Extra length allowed to a trace over folded faces, in mean edge lengths."""


@dataclass(frozen=True)
class Traces:
    """Traces between m pairs of points, without their ends.

    Attributes
    ----------
    reached : (m,) bool array
        Whether the trace reached its end. The others have no crossings.
    pair : (q,) int array
        The pair of each crossing with an edge, ascending.
    crossings : SurfacePoints
        Crossings with edges, in order, each in the face that the trace enters there.
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

    A trace over folded faces runs forward, backward and forward again; the backward part is
    subtracted from its length.

    Parameters
    ----------
    mesh : Mesh
    start : SurfacePoints
        m points, each strictly inside its face.
    end : SurfacePoints
        m points anywhere; a vertex counts as reached in every face round it.
    normals : (m, 3) float array
        Directions that the planes contain.
    longest : (m,) float array
        Greatest lengths.
    folded : (F,) bool array, optional
        Which faces of the mesh are folded back.
    ahead : (m, 3) float array, optional
        Directions in which the traces leave; by default towards the ends. Round the edge of a thin
        part the trace may begin in another direction.
    """
    origin, goal = start.positions(mesh), end.positions(mesh)
    forward = goal - origin
    margin = 0.0 if folded is None else FOLDS * mesh.mean_edge_length
    reached = _holds(mesh, end, start.faces)
    across = np.cross(normals, forward)
    ahead = forward if ahead is None else ahead
    fronts = _Fronts(mesh, start.faces, origin, across, ahead, np.flatnonzero(~reached))
    travelled, covered = np.zeros(len(origin)), np.zeros(len(origin))
    pairs, crossings = [], []
    for _ in range(MOST_FACES):
        if not len(fronts.index):
            break
        checkpoint()
        step = fronts.step_lengths()
        back = np.zeros(len(step), dtype=bool) if folded is None else folded[fronts.faces]
        covered[fronts.index] += np.where(back, -step, step)
        travelled[fronts.index] += step
        fronts.enter_next_faces(travelled[fronts.index] <= longest[fronts.index] + margin)
        pairs.append(fronts.index)
        crossings.append(fronts.entry())
        arrived = _holds(mesh, end[fronts.index], fronts.faces)
        here = fronts.index[arrived]
        reached[here] = covered[here] <= longest[here]
        fronts.leave_edges(~arrived)
    if not pairs:
        return Traces(reached, np.zeros(0, np.int64), start[np.zeros(0, np.int64)])
    pair = np.concatenate(pairs)
    kept = np.flatnonzero(reached[pair])
    kept = kept[np.argsort(pair[kept], kind="stable")]
    parts = zip(*crossings, strict=True)
    faces, low, high, fraction = (np.concatenate(part)[kept] for part in parts)
    points = SurfacePoints(faces, _on_edges(mesh, faces, low, high, fraction))
    once = _last_of_each_vertex(mesh, pair[kept], points)
    return Traces(reached, pair[kept][once], points[once])


def _last_of_each_vertex(mesh: Mesh, pair: IntArray, crossings: SurfacePoints) -> IntArray:
    """Crossings with only the last of consecutive ones of a trace at the same vertex."""
    here = crossings.barycentric > 0.0
    vertex = np.where(here, mesh.faces[crossings.faces], -1).max(axis=1)
    vertex[here.sum(axis=1) > 1] = -1
    last = np.ones(len(pair), dtype=bool)
    last[:-1] = (vertex[:-1] < 0) | (vertex[:-1] != vertex[1:]) | (pair[:-1] != pair[1:])
    return np.flatnonzero(last)


def trace_from(
    mesh: Mesh,
    start: SurfacePoints,
    direction: FloatArray,
    length: FloatArray,
    folded: BoolArray | None = None,
) -> tuple[SurfacePoints, BoolArray, int]:
    """Move points along the surface.

    Over folded faces a trace runs backward, so its remaining length grows there and it ends beyond
    the fold. An exception is a point that starts in a fold.

    Parameters
    ----------
    mesh : Mesh
    start : SurfacePoints
        m points, each strictly inside its face.
    direction : (m, 3) float array
        Unit vectors, nearly tangent to the faces.
    length : (m,) float array
        Not negative.
    folded : (F,) bool array, optional
        Which faces of the mesh are folded back.

    Returns
    -------
    SurfacePoints
        Strictly inside their faces.
    (m,) bool array
        Which points stopped at a boundary or a non-manifold edge.
    int
        Greatest number of faces passed by a point, which is the cost of the call.
    """
    origin = start.positions(mesh)
    normals = mesh.face_normals[start.faces]
    blocked = length > 0.0
    across = np.cross(normals, direction)
    fronts = _Fronts(mesh, start.faces, origin, across, direction, np.flatnonzero(blocked))
    blocked[fronts.index] = False
    outside = np.ones(len(length), dtype=bool) if folded is None else ~folded[start.faces]
    left = length.copy()
    faces, barycentric = start.faces.copy(), start.barycentric.copy()
    passed = 0
    while passed < MOST_FACES and len(fronts.index):
        passed += 1
        checkpoint()
        step = fronts.step_lengths()
        index = fronts.index
        beyond = fronts.beyond()
        back = np.zeros(len(index), dtype=bool)
        if folded is not None:
            back = folded[fronts.faces] & outside[index]
        stops = (~back & (left[index] <= step)) | (beyond < 0)
        here = np.flatnonzero(stops)
        ends = index[here]
        to_go = np.minimum(left[ends], step[here])
        share = (to_go / np.maximum(step[here], tolerances.TINY))[:, None]
        faces[ends] = fronts.faces[here]
        if passed > 1:
            barycentric[ends] = fronts.entry_barycentric(here)
        barycentric[ends] += share * (fronts.exit_barycentric(here) - barycentric[ends])
        blocked[ends] = left[ends] > step[here]
        left[index] -= np.where(back, -step, step)
        fronts.enter_next_faces(~stops)
        fronts.leave_edges(np.ones(len(fronts.index), dtype=bool))
    return SurfacePoints(faces, strictly_inside(barycentric)), blocked, passed


def strictly_inside(barycentric: FloatArray) -> FloatArray:
    """Coordinates moved away from the sides and corners of their faces by `tolerances.INSIDE`."""
    moved = np.maximum(barycentric, tolerances.INSIDE)
    return moved / moved.sum(axis=1, keepdims=True)


_OF_EACH_FRONT = (
    *("index", "faces", "_start", "_origin", "_across", "_position", "_side"),
    *("_high", "_low", "_high_height", "_low_height", "_high_position", "_low_position"),
    *("_fraction", "_crossing", "_entry_low", "_entry_high", "_entry_fraction"),
)
"""Arrays of `_Fronts` with one row for each trace."""


class _Fronts:
    """Traces in progress, each in its plane, about to cross an edge of its present face.

    One end of this edge lies above the plane or in it, the other below. In the next face only the
    third corner is new; the sign of its height determines the next edge.
    """

    def __init__(
        self,
        mesh: Mesh,
        faces: IntArray,
        origin: FloatArray,
        across: FloatArray,
        forward: FloatArray,
        index: IntArray,
    ) -> None:
        self.mesh = mesh
        self.index = index  # (w,) indices of the caller's traces
        self.faces = self._start = faces[index]
        self._origin = origin[index]
        self._across = across[index]
        self._position = self._crossing = self._origin
        self._fraction = self._entry_fraction = np.zeros(len(index))
        corners = mesh.faces[self.faces]  # (w, 3)
        positions = mesh.vertices[corners]
        offset = positions - self._origin[:, None]
        height = np.einsum("wcd,wd->wc", offset, self._across)
        # Side j lies opposite corner j. Two of them are crossed, one of them ahead.
        above = height >= 0.0
        first, second = [1, 2, 0], [2, 0, 1]
        crossed = above[:, first] != above[:, second]
        rise = height[:, second] - height[:, first]
        share = -height[:, first] / np.where(crossed, rise, 1.0)
        along = np.einsum("wcd,wd->wc", offset, forward[index])
        ahead = along[:, first] + share * (along[:, second] - along[:, first])
        side = np.where(crossed, ahead, -np.inf).argmax(axis=1)
        rows = np.arange(len(index))
        one, other = (side + 1) % 3, (side + 2) % 3
        up = above[rows, one]
        high, low = np.where(up, one, other), np.where(up, other, one)
        self._side = side
        self._high, self._low = corners[rows, high], corners[rows, low]
        self._entry_high, self._entry_low = self._high, self._low
        self._high_height, self._low_height = height[rows, high], height[rows, low]
        self._high_position, self._low_position = positions[rows, high], positions[rows, low]
        # Drop traces whose plane does not cross the sides of the face.
        self._keep(crossed[rows, side])
        self._find_crossing()

    def step_lengths(self) -> FloatArray:
        """Distance to the edge ahead, shape (w,)."""
        step = self._crossing - self._position
        return np.sqrt(np.einsum("wd,wd->w", step, step))

    def beyond(self) -> IntArray:
        """The face beyond this edge, -1 if no or several faces are there, shape (w,)."""
        return self.mesh.face_neighbours[self.faces, self._side]

    def exit_barycentric(self, which: IntArray) -> FloatArray:
        """Barycentric coordinates at which some traces leave their faces, (q, 3)."""
        low, high, fraction = self._low[which], self._high[which], self._fraction[which]
        return _on_edges(self.mesh, self.faces[which], low, high, fraction)

    def entry_barycentric(self, which: IntArray) -> FloatArray:
        """Barycentric coordinates at which some traces entered their faces, (q, 3)."""
        low, high = self._entry_low[which], self._entry_high[which]
        return _on_edges(self.mesh, self.faces[which], low, high, self._entry_fraction[which])

    def entry(self) -> tuple[IntArray, IntArray, IntArray, FloatArray]:
        """Entry points: face, low and high end of the edge, and fraction from high to low."""
        return self.faces, self._low, self._high, self._fraction

    def enter_next_faces(self, continues: BoolArray) -> None:
        """Move traces across their edges; drop those that must not or cannot continue.

        Traces that return to their first face are dropped too, as their section is closed.
        """
        beyond = self.beyond()
        continues = continues & (beyond >= 0) & (beyond != self._start)
        if not continues.all():
            self._keep(continues)
            beyond = beyond[continues]
        self.faces = beyond
        self._position = self._crossing
        self._entry_low, self._entry_high = self._low, self._high
        self._entry_fraction = self._fraction

    def leave_edges(self, continues: BoolArray) -> None:
        """Find the next edge of traces that have just entered a face; drop the others."""
        if not continues.all():
            self._keep(continues)
        corners = self.mesh.faces[self.faces]
        third = corners[:, 0] + corners[:, 1] + corners[:, 2] - self._low - self._high
        position = self.mesh.vertices[third]
        height = np.einsum("wd,wd->w", position - self._origin, self._across)
        up = height >= 0.0
        left = np.where(up, self._high, self._low)
        self._side = (corners == left[:, None]).argmax(axis=1)
        self._high = np.where(up, third, self._high)
        self._low = np.where(up, self._low, third)
        self._high_height = np.where(up, height, self._high_height)
        self._low_height = np.where(up, self._low_height, height)
        self._high_position = np.where(up[:, None], position, self._high_position)
        self._low_position = np.where(up[:, None], self._low_position, position)
        self._find_crossing()

    def _find_crossing(self) -> None:
        self._fraction = self._high_height / (self._high_height - self._low_height)
        step = self._low_position - self._high_position
        self._crossing = self._high_position + self._fraction[:, None] * step

    def _keep(self, mask: BoolArray) -> None:
        kept = np.flatnonzero(mask)
        for name in _OF_EACH_FRONT:
            setattr(self, name, getattr(self, name)[kept])


def _on_edges(
    mesh: Mesh, faces: IntArray, low: IntArray, high: IntArray, fraction: FloatArray
) -> FloatArray:
    """Barycentric coordinates, (p, 3), of points at a fraction of the edges from high to low."""
    corners = mesh.faces[faces]
    share = fraction[:, None]
    return (corners == high[:, None]) * (1.0 - share) + (corners == low[:, None]) * share


def _holds(mesh: Mesh, points: SurfacePoints, faces: IntArray) -> BoolArray:
    """Whether each point lies in the given face; a vertex lies in every face round it."""
    holds = points.faces == faces
    on_side = np.flatnonzero(~holds & (points.barycentric == 0.0).any(axis=1))
    if len(on_side):
        support = mesh.faces[points.faces[on_side]]
        found = (support[:, :, None] == mesh.faces[faces[on_side]][:, None, :]).any(axis=2)
        holds[on_side] = (found | (points.barycentric[on_side] == 0.0)).all(axis=1)
    return holds
