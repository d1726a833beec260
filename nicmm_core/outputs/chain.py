"""The places where a curve cuts a mesh: at vertices, on edges or inside faces.

Points of the curve close to a vertex or an edge are snapped to it, to avoid thin faces, and
neighbouring points close to each other are merged. Where that would make the curve touch itself,
`cut` keeps its points.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ..geometry.array_types import BoolArray, FloatArray, IntArray
from ..geometry.curve import without_small_weights
from ..geometry.mesh import Mesh
from ..geometry.surface_points import weights_at
from ..geometry.tolerances import TINY


@dataclass(frozen=True)
class Chain:
    """The distinct places on a mesh through which a curve passes, in its order.

    Attributes
    ----------
    closed : bool
    faces : (m,) int array
        A face of the mesh that contains each place.
    barycentric : (m, 3) float array
        Coordinates in that face, exactly zero at corners that do not support the place.
    first_point : (m,) int array
        Index of the first point of the curve that is merged into each place.
    point : (m,) int array
        Index of the point of the curve from which each place has its coordinates.
    segment_faces : (m,) int array
        A face that contains each place and the next one; without meaning at the end of an open
        curve.
    """

    closed: bool
    faces: IntArray
    barycentric: FloatArray
    first_point: IntArray
    point: IntArray
    segment_faces: IntArray

    def __len__(self) -> int:
        return len(self.faces)


def build_chain(
    mesh: Mesh,
    closed: bool,
    faces: IntArray,
    barycentric: FloatArray,
    segment_faces: IntArray,
    margin: FloatArray,
    must_keep: BoolArray,
) -> Chain:
    """Snap the points of a curve to nearby vertices and edges, and merge neighbouring points.

    Parameters
    ----------
    mesh : Mesh
    closed : bool
    faces, barycentric, segment_faces : arrays
        The n points of the curve and the faces of its segments, as from `checked_curve`.
    margin : (n,) float array
        Barycentric coordinates up to this become zero, and neighbours whose coordinates differ by
        less are merged.
    must_keep : (n,) bool array
        Points, such as control points, whose coordinates a merged place takes.
    """
    barycentric = without_small_weights(barycentric, margin)
    corners = mesh.faces[faces]
    n = len(faces)
    following = (np.arange(n) + 1) % n
    support = np.sort(np.where(barycentric > 0.0, corners, -1), axis=1)
    same = (support == support[following]).all(axis=1)
    theirs = weights_at(corners[following], barycentric[following], corners)
    near = np.abs(theirs - barycentric).max(axis=1) < np.minimum(margin, margin[following])
    at_vertex = (barycentric > 0.0).sum(axis=1) == 1
    joins = same & (near | at_vertex)  # with the next point
    if not closed:
        joins[-1] = False
    begins = np.array([0]) if joins.all() else np.flatnonzero(~np.roll(joins, 1))
    # A long run of close points is split where a point is no longer close to the first one.
    begins = _broken_runs(begins, joins, faces, barycentric, corners, margin)
    ends = np.roll(begins, -1)
    count = (ends - begins - 1) % n + 1
    point = np.array(
        [
            next((p for p in _run(b, c, n) if must_keep[p]), b)
            for b, c in zip(begins.tolist(), count.tolist(), strict=True)
        ],
        dtype=np.int64,
    )
    last = (ends - 1) % n
    return Chain(closed, faces[point], barycentric[point], begins, point, segment_faces[last])


def _broken_runs(
    begins: IntArray,
    joins: BoolArray,
    faces: IntArray,
    barycentric: FloatArray,
    corners: IntArray,
    margin: FloatArray,
) -> IntArray:
    """Split runs of joined points where a point is farther than the margin from the first one."""
    n = len(joins)
    found = []
    bounds = [*begins.tolist(), int(begins[0]) + n]
    for begin, end in zip(bounds[:-1], bounds[1:], strict=True):
        first = begin
        found.append(first)
        for p in range(begin + 1, end):
            here = p % n
            theirs = weights_at(corners[[here]], barycentric[[here]], corners[[first % n]])[0]
            at_vertex = np.count_nonzero(theirs) == 1
            if not at_vertex and np.abs(theirs - barycentric[first % n]).max() >= margin[here]:
                first = p
                found.append(here)
    return np.sort(np.array(found, dtype=np.int64) % n)


def _run(begin: int, count: int, n: int) -> list[int]:
    return [(begin + k) % n for k in range(count)]


def superfluous_points(
    positions: FloatArray,
    barycentric: FloatArray,
    faces: IntArray,
    closed: bool,
    must_keep: BoolArray,
    deviation: float,
) -> BoolArray:
    """Points inside faces that can be omitted without moving the curve by more than a deviation.

    Parameters
    ----------
    positions : (n, 3) float array
    barycentric : (n, 3) float array
    faces : (n,) int array
    closed : bool
    must_keep : (n,) bool array
        Points to keep.
    deviation : float
        Largest distance by which the curve may move, in mesh units.

    Returns
    -------
    (n,) bool array
        True for points that can be omitted.
    """
    n = len(faces)
    free = (barycentric > 0.0).all(axis=1) & ~must_keep
    if not closed:
        free[[0, -1]] = False
    superfluous = np.zeros(n, dtype=bool)
    if deviation <= 0.0 or free.all():
        return superfluous
    # Between two points that are kept, the curve does not leave the face.
    stays = np.flatnonzero(~free).tolist()
    waiting = list(zip(stays, [*stays[1:], stays[0] + n], strict=True))
    while waiting:
        begin, end = waiting.pop()
        between = np.arange(begin + 1, end) % n
        if not len(between) or (not closed and end >= n):
            continue
        start, along = positions[begin % n], positions[end % n] - positions[begin % n]
        offset = positions[between] - start
        share = np.clip(offset @ along / max(along @ along, TINY), 0.0, 1.0)
        distance = np.linalg.norm(offset - share[:, None] * along, axis=1)
        if distance.max() <= deviation:
            superfluous[between] = True
            continue
        middle = begin + 1 + int(distance.argmax())
        waiting += [(begin, middle), (middle, end)]
    return superfluous


def points_of(chain: Chain, places: Sequence[int], kept: IntArray, n_points: int) -> IntArray:
    """Indices of the points of a curve that are merged into some places or their neighbours.

    Parameters
    ----------
    chain : Chain
        Chain built from some of the points of the curve.
    places : sequence of int
        Indices of the places in the chain.
    kept : (k,) int array
        Indices of the points of the curve from which the chain was built.
    n_points : int
        Number of points of the curve.
    """
    near = {(place + step) % len(chain) for place in places for step in (-1, 0, 1)}
    begins = kept[chain.first_point]
    count = (np.roll(begins, -1) - begins - 1) % n_points + 1
    runs = [_run(int(begins[p]), int(count[p]), n_points) for p in sorted(near)]
    return np.array([point for run in runs for point in run], dtype=np.int64)
