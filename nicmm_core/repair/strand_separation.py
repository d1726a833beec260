"""Separates strands of a curve that touch on the original mesh but not on the mapped one.

A curve that is simple on the mapped mesh passes each vertex of that mesh at most once, but two of
these vertices may be copies of one vertex of the original. One strand is then routed around its
copy, across the edges that meet there. Copies of an edge are treated similarly. If strands cross
them at the same point, the point of one strand is moved along the edge. A strand that runs along a
copy is bent into the adjacent face.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from ..geometry.array_types import IntArray
from ..geometry.crossings import crossing_segments
from ..geometry.grouping import path_between
from ..geometry.mesh import Mesh
from ..geometry.surface_points import SurfacePoints, joined, weights_at

REACH = 0.05
"""Greatest distance by which a strand is moved, in lengths of the edges there."""

SHARE = 0.5
"""Greatest such distance, relative to that of the nearest other point of the curve."""

ATTEMPTS = 8
"""Maximum number of attempts to move one point."""

ROUNDS = 4
"""Maximum number of rounds. Strands moved around copies of one vertex may then meet on copies of an
edge."""

SAME_POINT = 1e-9
"""Difference of barycentric weights up to which points on copies of one edge coincide."""


def separated(
    mesh: Mesh, place: IntArray, polyline: SurfacePoints, closed: bool, fixed: IntArray
) -> tuple[SurfacePoints, IntArray]:
    """Move strands apart that meet at copies of a vertex or of a point on an edge.

    Parameters
    ----------
    mesh : Mesh
        The mapped mesh.
    place : (v,) int array
        Index of the place of each vertex, equal for vertices that are one point of the original.
    polyline : SurfacePoints
        n points of a polyline that is simple on the mesh, each in the face of the segment that
        begins there.
    closed : bool
        Whether the last point is joined to the first.
    fixed : (k,) int array
        Indices of points that must not move.

    Returns
    -------
    SurfacePoints
        The polyline with its strands moved apart.
    (n,) int array
        New index of each given point, or -1 if the point was replaced.
    """
    number = np.arange(len(polyline))
    for _ in range(ROUNDS):
        touching = _touching(mesh, place, polyline, number[fixed])
        if not touching:
            break
        # Backward, so that points not yet processed keep their indices.
        for point in touching[::-1]:
            corners = int((polyline.barycentric[point] > 0.0).sum())
            move = _round_vertex if corners == 1 else _along_edge
            polyline, step = _moved(mesh, polyline, point, closed, move)
            number = np.where(number >= 0, step[number], -1)
    for point in _passed_segments(mesh, place, polyline, closed)[::-1]:
        polyline, step = _moved(mesh, polyline, point, closed, _into_face)
        number = np.where(number >= 0, step[number], -1)
    return polyline, number


def _passed_segments(
    mesh: Mesh, place: IntArray, polyline: SurfacePoints, closed: bool
) -> list[int]:
    """Segments along an edge, if other strands have points on copies of this edge, ascending."""
    n = len(polyline)
    here = polyline.barycentric > 0.0
    corners = mesh.faces[polyline.faces]
    on_edge: dict[tuple[int, ...], list[int]] = {}
    for point in np.flatnonzero(here.sum(axis=1) == 2).tolist():
        ends = tuple(sorted(place[corners[point][here[point]]].tolist()))
        on_edge.setdefault(ends, []).append(point)
    found = []
    for point in range(n if closed else n - 1):
        following = (point + 1) % n
        both = {
            *corners[point][here[point]].tolist(),
            *corners[following][here[following]].tolist(),
        }
        if len(both) == 2:
            ends = tuple(sorted(place[list(both)].tolist()))
            if set(on_edge.get(ends, ())) - {point, following}:
                found.append(point)
    return found


def _touching(mesh: Mesh, place: IntArray, polyline: SurfacePoints, fixed: IntArray) -> list[int]:
    """Points, except fixed ones, that coincide with another point on the original, ascending."""
    stays = np.zeros(len(polyline), dtype=bool)
    stays[fixed] = True
    here = polyline.barycentric > 0.0
    places = np.where(here, place[mesh.faces[polyline.faces]], -1)
    order = np.argsort(places, axis=1, kind="stable")
    rows = np.arange(len(places))[:, None]
    places = places[rows, order]
    weights = np.where(here, polyline.barycentric, 0.0)[rows, order]
    on_mesh = here.sum(axis=1) < 3
    first: dict[tuple[int, ...], list[int]] = {}
    found = []
    # Fixed points come first, so the points that coincide with them are moved.
    for point in np.lexsort((np.arange(len(stays)), ~stays)).tolist():
        if not on_mesh[point]:
            continue
        key = tuple(places[point].tolist())
        others = first.setdefault(key, [])
        same = [o for o in others if np.abs(weights[o] - weights[point]).max() <= SAME_POINT]
        if same and not stays[point]:
            found.append(point)
        else:
            others.append(point)
    return sorted(found)


def _moved(
    mesh: Mesh,
    polyline: SurfacePoints,
    point: int,
    closed: bool,
    move: Callable[[Mesh, SurfacePoints, int, float], tuple[SurfacePoints, IntArray]],
) -> tuple[SurfacePoints, IntArray]:
    """Move one point, by less at every attempt until the polyline is simple.

    Returns the polyline and the new index of each point. If no attempt succeeds, the polyline is
    unchanged.
    """
    share = 1.0
    for _ in range(ATTEMPTS):
        changed, number = move(mesh, polyline, point, share)
        if not len(crossing_segments(mesh.faces, changed, closed)):
            return changed, number
        share *= 0.1
    return polyline, np.arange(len(polyline))


def _round_vertex(
    mesh: Mesh, polyline: SurfacePoints, point: int, share: float
) -> tuple[SurfacePoints, IntArray]:
    """Replace a point at a vertex by points on the edges that meet there."""
    n, faces = len(polyline), polyline.faces
    vertex = int(mesh.faces[faces[point]][polyline.barycentric[point].argmax()])
    fan = _faces_between(mesh, vertex, int(faces[point - 1]), int(faces[point]))
    near = (polyline.barycentric * (mesh.faces[faces] == vertex)).sum(axis=1)
    near[point] = 0.0
    reach = share * min(REACH, SHARE * (1.0 - float(near.max())))
    corners = mesh.faces[fan]
    # Each new point is on the edge that a face shares with the face before it.
    common = (corners[1:, :, None] == corners[:-1, None, :]).any(axis=2)
    weights = np.where(corners[1:] == vertex, 1.0 - reach, np.where(common, reach, 0.0))
    around = SurfacePoints(np.array(fan[1:], dtype=np.int64), weights)
    number = np.arange(n) + (len(around) - 1) * (np.arange(n) > point)
    number[point] = -1
    return joined([polyline[:point], around, polyline[point + 1 :]]), number


def _along_edge(
    mesh: Mesh, polyline: SurfacePoints, point: int, share: float
) -> tuple[SurfacePoints, IntArray]:
    """Move a point along its edge, towards the nearer end."""
    barycentric = polyline.barycentric.copy()
    here = barycentric[point]
    small, large = np.where(here > 0.0, here, np.inf).argmin(), here.argmax()
    if small == large:  # both are one half
        small, large = np.flatnonzero(here > 0.0)
    step = share * SHARE * REACH * here[small]
    barycentric[point, small] -= step
    barycentric[point, large] += step
    return SurfacePoints(polyline.faces, barycentric), np.arange(len(polyline))


def _into_face(
    mesh: Mesh, polyline: SurfacePoints, point: int, share: float
) -> tuple[SurfacePoints, IntArray]:
    """Insert a point into a segment along an edge, which bends it into the face of the segment."""
    n, face = len(polyline), int(polyline.faces[point])
    following = (point + 1) % n
    corners = mesh.faces[polyline.faces[following]]
    end = weights_at(corners[None], polyline.barycentric[[following]], mesh.faces[[face]])[0]
    middle = 0.5 * (polyline.barycentric[point] + end)
    reach = share * REACH
    middle = (1.0 - reach) * middle + reach * (middle == 0.0)
    return SurfacePoints(
        np.insert(polyline.faces, point + 1, face),
        np.insert(polyline.barycentric, point + 1, middle, axis=0),
    ), np.arange(n) + (np.arange(n) > point)


def _faces_between(mesh: Mesh, vertex: int, start: int, end: int) -> list[int]:
    """The shortest chain of adjacent faces around a vertex from one face to another."""
    previous = {start: start}
    queue = [start]
    for face in queue:
        if face == end:
            break
        for corner, beyond in zip(mesh.faces[face], mesh.face_neighbours[face], strict=True):
            # Do not cross the side opposite the vertex.
            if corner != vertex and beyond >= 0 and int(beyond) not in previous:
                previous[int(beyond)] = face
                queue.append(int(beyond))
    return path_between(previous, start, end)
