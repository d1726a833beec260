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
from scipy.spatial import cKDTree

from ..geometry.array_types import IntArray
from ..geometry.crossings import crossing_segments
from ..geometry.grouping import shortest_chain
from ..geometry.mesh import Mesh
from ..geometry.surface_points import SurfacePoints, in_faces, joined

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
        if not len(touching):
            break
        polyline, number = _moved(mesh, polyline, number, touching, closed, _aside)
    passed = _passed_segments(mesh, place, polyline, closed)
    return _moved(mesh, polyline, number, passed, closed, _into_face)


def _touching(mesh: Mesh, place: IntArray, polyline: SurfacePoints, fixed: IntArray) -> IntArray:
    """Points, except fixed ones, that coincide with another point on the original, ascending."""
    here = polyline.barycentric > 0.0
    places = np.where(here, place[mesh.faces[polyline.faces]], -1)
    order = np.argsort(places, axis=1, kind="stable")
    weights = np.where(here, polyline.barycentric, 0.0)
    keys = np.concatenate(
        [np.take_along_axis(each, order, axis=1) for each in (places, weights)], axis=1
    )
    on_edges = np.flatnonzero(here.sum(axis=1) < 3)
    pairs = cKDTree(keys[on_edges]).query_pairs(SAME_POINT, p=np.inf, output_type="ndarray")
    one, other = on_edges[pairs].T
    stays = np.isin(np.arange(len(polyline)), fixed)
    later = np.where(stays[other], one, other)
    return np.unique(later[~stays[later]])


def _passed_segments(
    mesh: Mesh, place: IntArray, polyline: SurfacePoints, closed: bool
) -> IntArray:
    """Segments along an edge, if other strands have points on copies of this edge, ascending."""
    here = polyline.barycentric > 0.0
    following = np.roll(np.arange(len(polyline)), -1)
    ends = in_faces(mesh, polyline[following], polyline.faces).barycentric
    both = here | (ends > 0.0)
    along = both.sum(axis=1) == 2
    if not closed:
        along[-1] = False
    places = place[mesh.faces[polyline.faces]]
    point, segment = (np.sort(np.where(which, places, -1), axis=1) for which in (here, both))
    on_edge = here.sum(axis=1) == 2
    along = np.flatnonzero(along)
    same = (segment[along, None] == point).all(axis=2).sum(axis=1)
    return along[same > on_edge[along].astype(int) + on_edge[following[along]]]


Move = Callable[[Mesh, SurfacePoints, int, float], tuple[SurfacePoints, IntArray]]
"""Changes a polyline at one point by a share of the greatest distance; new index of each point."""


def _moved(
    mesh: Mesh,
    polyline: SurfacePoints,
    number: IntArray,
    points: IntArray,
    closed: bool,
    move: Move,
) -> tuple[SurfacePoints, IntArray]:
    """Move points, each by less at every attempt until the polyline is simple.

    If no attempt succeeds, a point stays. Returns the polyline and the new index of each of the
    points whose present index is given.
    """
    # Backward, so that points not yet processed keep their indices.
    for point in points[::-1].tolist():
        for share in 0.1 ** np.arange(ATTEMPTS):
            changed, step = move(mesh, polyline, point, float(share))
            if not len(crossing_segments(mesh.faces, changed, closed)):
                polyline, number = changed, np.where(number >= 0, step[number], -1)
                break
    return polyline, number


def _aside(
    mesh: Mesh, polyline: SurfacePoints, point: int, share: float
) -> tuple[SurfacePoints, IntArray]:
    """Lead the polyline around the vertex at a point, or move the point along its edge."""
    at_vertex = (polyline.barycentric[point] > 0.0).sum() == 1
    return (_round_vertex if at_vertex else _along_edge)(mesh, polyline, point, share)


def _round_vertex(
    mesh: Mesh, polyline: SurfacePoints, point: int, share: float
) -> tuple[SurfacePoints, IntArray]:
    """Replace a point at a vertex by points on the edges that meet there."""
    n, faces = len(polyline), polyline.faces
    vertex = int(mesh.faces[faces[point]][polyline.barycentric[point].argmax()])

    def beside(face: int) -> list[int]:
        """The faces across the sides at the vertex."""
        across = mesh.face_neighbours[face]
        return across[(mesh.faces[face] != vertex) & (across >= 0)].tolist()

    fan = shortest_chain(int(faces[point - 1]), beside, lambda face: face == faces[point])
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
    _, small, large = np.argsort(barycentric[point], kind="stable")
    step = share * SHARE * REACH * barycentric[point, small]
    barycentric[point, small] -= step
    barycentric[point, large] += step
    return SurfacePoints(polyline.faces, barycentric), np.arange(len(polyline))


def _into_face(
    mesh: Mesh, polyline: SurfacePoints, point: int, share: float
) -> tuple[SurfacePoints, IntArray]:
    """Insert a point into a segment along an edge, which bends it into the face of the segment."""
    n, face = len(polyline), int(polyline.faces[point])
    following = (point + 1) % n
    end = in_faces(mesh, polyline[np.array([following])], np.array([face])).barycentric[0]
    middle = 0.5 * (polyline.barycentric[point] + end)
    reach = share * REACH
    middle = (1.0 - reach) * middle + reach * (middle == 0.0)
    return SurfacePoints(
        np.insert(polyline.faces, point + 1, face),
        np.insert(polyline.barycentric, point + 1, middle, axis=0),
    ), np.arange(n) + (np.arange(n) > point)
