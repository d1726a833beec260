"""Traces the lines on which a function is zero, across parts of faces."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from scipy.optimize.elementwise import find_root

from ..geometry.array_types import BoolArray, FloatArray, IntArray
from ..geometry.mesh import Mesh, edge_keys
from ..geometry.surface_points import SurfacePoints
from ..progress import checkpoint
from ..repair.face_parts import FaceParts

MARGIN = 1e-6
"""Least distance of a crossing from both ends of its edge, as a fraction of the edge."""

HALVINGS = 48
"""Number of times that a segment is halved to find where a line ends."""

Function = Callable[[SurfacePoints], FloatArray]
"""A function of n points in faces of a mesh, with values (n,)."""

Predicate = Callable[[SurfacePoints], BoolArray]
"""A condition on n points in faces of a mesh, with answers (n,)."""


@dataclass(frozen=True)
class LevelLine:
    """A line across parts of faces, with the side of negative values to its left.

    Attributes
    ----------
    points : SurfacePoints
        Its n points in the faces that contain the parts. Each segment lies in the face of the point
        at which it begins.
    ends : (n, 3) float array
        Barycentric coordinates, in the same face, of the end of the segment that begins at each
        point. The last row of an open line repeats its last point.
    closed : bool
    """

    points: SurfacePoints
    ends: FloatArray
    closed: bool

    def length(self, mesh: Mesh) -> float:
        """Length on the mesh of these faces."""
        ends = SurfacePoints(self.points.faces, self.ends).positions(mesh)
        return float(np.linalg.norm(ends - self.points.positions(mesh), axis=1).sum())


def level_lines(parts: FaceParts, values: FloatArray, function: Function) -> list[LevelLine]:
    """The lines on which a function is zero.

    Parameters
    ----------
    parts : FaceParts
        Parts of faces, consistently oriented, so fine that the function is almost linear on each.
    values : (v,) float array
        Values of the function at the vertices of the parts.
    function : callable
        It need not be continuous.

    Returns
    -------
    list of LevelLine
        Lines that do not cross. Open ones end at the boundary.
    """
    triangle, tail, head = _crossings(parts, values)
    size = len(values)
    edges = np.concatenate([tail, head])
    keys, index = np.unique(edge_keys(edges[:, 0], edges[:, 1], size), return_inverse=True)
    start, end = index.reshape(2, -1)
    low, high = np.divmod(keys, size)
    owner = np.empty(len(keys), dtype=np.int64)
    owner[end], owner[start] = triangle, triangle
    share = _zeros(parts, owner, low, high, values, function)

    def in_parent(of: IntArray, node: IntArray) -> FloatArray:
        """Barycentric coordinates of the zeros on edges of some parts."""
        one, other = (_at_vertex(parts, of, vertex[node]) for vertex in (low, high))
        return (1.0 - share[node])[:, None] * one + share[node][:, None] * other

    first, last = in_parent(triangle, start), in_parent(triangle, end)
    lines = []
    for chain, closed in _chains(start, end, len(keys)):
        of = triangle[chain]
        faces, points, ends = parts.parent[of], first[chain], last[chain]
        if not closed:
            faces = np.append(faces, faces[-1])
            points, ends = (np.concatenate([rows, ends[-1:]]) for rows in (points, ends))
        lines.append(LevelLine(SurfacePoints(faces, points), ends, closed))
    return lines


def _crossings(parts: FaceParts, values: FloatArray) -> tuple[IntArray, IntArray, IntArray]:
    """The triangles that a line crosses, (t,), and the edges, (t, 2), at both ends of its segment.

    The segment leads from the first edge to the second with negative values to its left.
    """
    inside = (values < 0.0)[parts.faces]
    count = inside.sum(axis=1)
    triangle = np.flatnonzero((count == 1) | (count == 2))
    is_single = count[triangle] == 1
    odd = (inside[triangle] == is_single[:, None]).argmax(axis=1)
    following, before = (odd + 1) % 3, (odd + 2) % 3
    corners, row = parts.faces[triangle], np.arange(len(triangle))
    tail, head = (
        np.stack([corners[row, odd], corners[row, other]], axis=1)
        for other in (
            np.where(is_single, following, before),
            np.where(is_single, before, following),
        )
    )
    return triangle, tail, head


def _at_vertex(parts: FaceParts, triangle: IntArray, vertex: IntArray) -> FloatArray:
    """Barycentric coordinates of a vertex of each triangle in its face, (n, 3)."""
    corner = (parts.faces[triangle] == vertex[:, None]).argmax(axis=1)
    return parts.corners[triangle, corner]


def _zeros(
    parts: FaceParts,
    owner: IntArray,
    low: IntArray,
    high: IntArray,
    values: FloatArray,
    function: Function,
) -> FloatArray:
    """Position of the zero on each edge, as a fraction from its first vertex, (n,).

    Parameters
    ----------
    parts : FaceParts
    owner : (n,) int array
        A triangle at each edge.
    low, high : (n,) int array
        Vertices at its ends, where the values have different signs.
    values : (v,) float array
    function : callable
    """
    if not len(owner):
        return np.zeros(0)
    one, other = _at_vertex(parts, owner, low), _at_vertex(parts, owner, high)
    at_ends = values[low], values[high]

    def along(share: FloatArray, number: FloatArray) -> FloatArray:
        checkpoint()
        edge = number.astype(np.int64)  # which the root finder has converted
        weights = one[edge] + share[:, None] * (other[edge] - one[edge])
        found = function(SurfacePoints(parts.parent[owner[edge]], weights))
        # At the ends, the values that determine the triangles count.
        found = np.where(share <= 0.0, at_ends[0][edge], found)
        return np.where(share >= 1.0, at_ends[1][edge], found)

    ends, number = (np.zeros(len(owner)), np.ones(len(owner))), np.arange(len(owner))
    found = find_root(along, ends, args=(number,), tolerances={"xatol": MARGIN * MARGIN})
    share: FloatArray = found.x.clip(MARGIN, 1.0 - MARGIN)
    return share


def _chains(start: IntArray, end: IntArray, size: int) -> list[tuple[IntArray, bool]]:
    """Join directed segments between nodes into chains: their segments, and whether it is closed.

    No node has more than one segment that begins there, and one that ends there.
    """
    leaving = np.full(size, -1)
    leaving[start] = np.arange(len(start))
    following = leaving[end].tolist()
    has_predecessor = np.zeros(len(start), dtype=bool)
    has_predecessor[leaving[end][leaving[end] >= 0]] = True
    used = np.zeros(len(start), dtype=bool)
    chains = []
    for first in [*np.flatnonzero(~has_predecessor).tolist(), *range(len(start))]:
        if used[first]:
            continue
        chain, segment = [], first
        while segment >= 0 and not used[segment]:
            used[segment] = True
            chain.append(segment)
            segment = following[segment]
        chains.append((np.array(chain, dtype=np.int64), segment == first))
    return chains


def reversed_line(line: LevelLine) -> LevelLine:
    """The line in the opposite direction."""
    faces, points, ends = line.points.faces, line.points.barycentric, line.ends
    if line.closed:
        return LevelLine(SurfacePoints(faces[::-1], ends[::-1]), points[::-1], True)
    faces, points, ends = faces[:-1][::-1], points[:-1][::-1], ends[:-1][::-1]
    return LevelLine(
        SurfacePoints(np.append(faces, faces[-1]), np.concatenate([ends, points[-1:]])),
        np.concatenate([points, points[-1:]]),
        False,
    )


def where(line: LevelLine, condition: Predicate) -> list[LevelLine]:
    """The parts of a line on which a condition holds.

    They end where it ceases to hold, between two points. A part of a closed line is open.
    """
    holds = condition(line.points)
    if holds.all():
        return [line]
    if not holds.any():
        return []
    if line.closed:
        line = _rolled(line, int((~holds).argmax()))
        holds = condition(line.points)
    n = len(holds)
    following = np.append(holds[1:], holds[:1] if line.closed else False)
    begins = np.flatnonzero(~holds & following)
    stops = np.flatnonzero(holds & ~following)
    entry = _change(line, begins, condition)
    stops_inside = stops if line.closed else stops[stops < n - 1]
    leave = dict(zip(stops_inside.tolist(), _change(line, stops_inside, condition), strict=True))
    runs = [(int(begin) + 1, place) for begin, place in zip(begins, entry, strict=True)]
    if holds[0]:
        runs.insert(0, (0, None))
    found = []
    for (first, place), stop in zip(runs, stops.tolist(), strict=True):
        faces = line.points.faces[first : stop + 1]
        points, ends = line.points.barycentric[first : stop + 1], line.ends[first : stop + 1]
        if place is not None:
            faces = np.append(line.points.faces[first - 1], faces)
            points = np.concatenate([place[None], points])
            ends = np.concatenate([line.ends[first - 1][None], ends])
        if stop in leave:
            ends = np.concatenate([ends[:-1], leave[stop][None]])
            faces = np.append(faces, faces[-1])
            points, ends = (np.concatenate([rows, leave[stop][None]]) for rows in (points, ends))
        if len(faces) > 1:
            found.append(LevelLine(SurfacePoints(faces, points), ends, False))
    return found


def _rolled(line: LevelLine, first: int) -> LevelLine:
    """A closed line that begins at another of its points."""
    order = np.roll(np.arange(len(line.points)), -first)
    return replace(line, points=line.points[order], ends=line.ends[order])


def _change(line: LevelLine, segments: IntArray, condition: Predicate) -> FloatArray:
    """Where a condition changes on segments: the last place where it holds, (n, 3)."""
    faces = line.points.faces[segments]
    begin, end = line.points.barycentric[segments], line.ends[segments]
    at_begin = condition(SurfacePoints(faces, begin))
    yes, no = (np.where(at_begin, 0.0, 1.0), np.where(at_begin, 1.0, 0.0))
    for _ in range(HALVINGS):
        middle = 0.5 * (yes + no)
        place = (1.0 - middle)[:, None] * begin + middle[:, None] * end
        holds = condition(SurfacePoints(faces, place))
        yes, no = np.where(holds, middle, yes), np.where(holds, no, middle)
    return (1.0 - yes)[:, None] * begin + yes[:, None] * end
