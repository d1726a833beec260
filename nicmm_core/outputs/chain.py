"""The places where a curve cuts a mesh: at vertices, on edges or inside faces.

Points of the curve close to a vertex or an edge are snapped to it, to avoid thin faces, and
neighbouring points close to each other are merged. Where that would make the curve touch itself,
`cut` keeps its points.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..geometry.array_types import BoolArray, FloatArray, IntArray
from ..geometry.curve import SurfaceCurve, without_small_weights
from ..geometry.distances import distance_to_segments
from ..geometry.mesh import Mesh
from ..geometry.surface_points import SurfacePoints, weights_at


@dataclass(frozen=True)
class Chain:
    """The distinct places on a mesh through which a curve passes, in its order.

    Attributes
    ----------
    closed : bool
    places : SurfacePoints
        The m places. Coordinates are exactly zero at corners that do not support the place.
    point : (m,) int array
        Index of the point of the curve from which each place has its coordinates.
    segment_faces : (m,) int array
        A face that contains each place and the next one; without meaning at the end of an open
        curve.
    place_of : (n,) int array
        Index of the place into which each point of the curve is merged. A point that is omitted
        belongs to the place before it.
    """

    closed: bool
    places: SurfacePoints
    point: IntArray
    segment_faces: IntArray
    place_of: IntArray

    def __len__(self) -> int:
        return len(self.places)


def build_chain(
    mesh: Mesh,
    curve: SurfaceCurve,
    segment_faces: IntArray,
    used: IntArray,
    margin: FloatArray,
    must_keep: BoolArray,
) -> Chain:
    """Snap points of a curve to nearby vertices and edges, and merge neighbouring points.

    Parameters
    ----------
    mesh : Mesh
    curve : SurfaceCurve
        A curve of n points, as from `checked_curve`.
    segment_faces : (n,) int array
        The faces of its segments, as from `checked_curve`.
    used : (u,) int array
        The points from which the chain is built, ascending; other points are omitted.
    margin : (n,) float array
        Barycentric coordinates up to this become zero, and neighbours whose coordinates differ by
        less are merged.
    must_keep : (n,) bool array
        Points, such as control points, whose coordinates a merged place takes.
    """
    margin, corners = margin[used], mesh.faces[curve.faces[used]]
    barycentric = without_small_weights(curve.barycentric[used], margin)
    begins = _runs(corners, barycentric, margin, curve.closed)
    # The points before the first run belong to the last one.
    run_of = (np.searchsorted(begins, np.arange(len(used)), side="right") - 1) % len(begins)
    along = np.roll(np.arange(len(used)), -begins[0])
    kept = along[must_keep[used[along]]][::-1]
    source = begins.copy()
    source[run_of[kept]] = kept  # of several in one run, the first is assigned last
    last = np.roll(begins, -1) - 1
    used_before = np.searchsorted(used, np.arange(len(curve.faces)), side="right") - 1
    return Chain(
        curve.closed,
        SurfacePoints(curve.faces[used[source]], barycentric[source]),
        used[source],
        segment_faces[used[last]],
        run_of[used_before],
    )


def _runs(corners: IntArray, barycentric: FloatArray, margin: FloatArray, closed: bool) -> IntArray:
    """Indices at which runs of points that are merged begin, ascending."""
    n = len(corners)
    following = (np.arange(n) + 1) % n
    support = np.sort(np.where(barycentric > 0.0, corners, -1), axis=1)
    same = (support == support[following]).all(axis=1)
    theirs = weights_at(corners[following], barycentric[following], corners)
    near = np.abs(theirs - barycentric).max(axis=1) < np.minimum(margin, margin[following])
    at_vertex = (barycentric > 0.0).sum(axis=1) == 1
    joins = same & (near | at_vertex)  # with the next point
    joins[-1] &= closed
    begins: list[int] = []
    first = int((~np.roll(joins, 1)).argmax())
    for point in [*range(first, n), *range(first)]:
        if begins and joins[point - 1]:
            # A long run of close points is split where one is no longer close to the first one.
            start = begins[-1]
            here = weights_at(corners[[point]], barycentric[[point]], corners[[start]])[0]
            if at_vertex[point] or np.abs(here - barycentric[start]).max() < margin[point]:
                continue
        begins.append(point)
    return np.sort(np.array(begins, dtype=np.int64))


def necessary_points(
    positions: FloatArray,
    barycentric: FloatArray,
    closed: bool,
    must_keep: BoolArray,
    deviation: float,
) -> IntArray:
    """Indices of points of a curve without which it would move by more than a deviation, ascending.

    Only points inside faces are omitted.

    Parameters
    ----------
    positions : (n, 3) float array
    barycentric : (n, 3) float array
    closed : bool
    must_keep : (n,) bool array
        Points to keep.
    deviation : float
        Largest distance by which the curve may move, in mesh units.
    """
    n = len(positions)
    kept = ~(barycentric > 0.0).all(axis=1) | must_keep
    if not closed:
        kept[[0, -1]] = True
    if deviation <= 0.0 or not kept.any():
        return np.arange(n)
    # Between two points that are kept, the curve does not leave the face.
    ends = np.flatnonzero(kept).tolist()
    waiting = list(zip(ends, [*ends[1:], ends[0] + n], strict=True))
    while waiting:
        begin, end = waiting.pop()
        between = np.arange(begin + 1, end) % n
        start, stop = positions[[begin % n]], positions[[end % n]]
        distance = distance_to_segments(positions[between], start, stop)
        if distance.max(initial=0.0) > deviation:
            middle = begin + 1 + int(distance.argmax())
            kept[middle % n] = True
            waiting += [(begin, middle), (middle, end)]
    return np.flatnonzero(kept)
