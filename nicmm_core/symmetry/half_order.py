"""The order in which the half of a symmetric curve visits its control points."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ..courses.hop_graph import distances_along_edges
from ..geometry.array_types import BoolArray, FloatArray, IntArray
from ..geometry.mirror import Mirror
from ..path.visiting_order import shortest_order
from ..relaxation.curve_nodes import CurveSurface
from ..request import Request


def in_shortest_order(surface: CurveSurface, request: Request) -> tuple[Request, IntArray]:
    """The same request with its points in the order of a short path for the half.

    The half of a closed curve runs from the plane through all its points to the plane, that of an
    open curve from its first point. It begins or ends at a point on the plane.

    Parameters
    ----------
    surface : CurveSurface
    request : Request
        A request with a mirror and the order "shortest".

    Returns
    -------
    Request
        The request with the order "given".
    (n,) int array
        For each of its control points, the index in the given request.
    """
    mirror = request.mirror
    assert mirror is not None
    count = int((mirror.side >= 0).sum())
    along = distances_along_edges(surface, request.points[:count])
    size = len(surface.mesh.vertices)
    heights = mirror.plane.heights(surface.mesh.vertices)
    beyond = np.flatnonzero(heights <= max(float(heights.min()), 0.0))
    to_plane = along[:, beyond].min(axis=1)
    half = _order(along[:, size:], to_plane, mirror.side[:count] == 0, request.closed)
    back = half[::-1][mirror.side[half[::-1]] != 0]
    number = np.concatenate([half, mirror.image[back]])
    place = np.argsort(number)
    ordered = Mirror(mirror.plane, place[mirror.image[number]], mirror.side[number])
    return replace(
        request,
        points=request.points[number],
        order="given",
        corners=np.sort(place[request.corners]),
        mirror=ordered,
    ), number


def _order(
    distance: FloatArray, to_plane: FloatArray, on_plane: BoolArray, closed: bool
) -> IntArray:
    """The order of the points of the half, (k,), as a short tour with the plane as a further point.

    Parameters
    ----------
    distance : (k, k) float array
    to_plane : (k,) float array
        Distances of the points to the plane.
    on_plane : (k,) bool array
        Which of them are on it. The tour passes them next to the plane.
    closed : bool
    """
    count = len(distance)
    bound = float(distance.sum() + to_plane.sum())
    to_plane = np.where(on_plane, 0.0, bound + to_plane)
    # The plane has the index k. An open tour has a further point k + 1 between its free end and the
    # plane, at distance zero from all.
    extra = 1 if closed else 2
    whole = np.zeros((count + extra, count + extra))
    whole[:count, :count] = distance
    whole[count, :count] = whole[:count, count] = to_plane
    tour = shortest_order(whole, closed=True)
    tour = np.roll(tour, -int((tour == count).argmax()))
    if not closed and tour[1] != count + 1:
        tour = np.roll(tour[::-1], 1)
    return tour[tour < count]
