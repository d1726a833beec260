"""Makes symmetric curves of curves that are not: each half of a curve with its mirror image.

A half is the part of a curve from plane to plane that passes all control points of one side. At the
plane it is joined to its mirror image by a straight trace from the last point before the plane to
the image of that point. On a symmetric surface such a trace crosses the plane at right angles.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from ..geometry.array_types import BoolArray, FloatArray, IntArray
from ..geometry.crossings import crossing_segments
from ..geometry.curve import SurfaceCurve, points_of, with_points
from ..geometry.mirror import ON_PLANE, Mirror
from ..geometry.numbering import RESOLUTIONS
from ..geometry.surface_points import SurfacePoints, joined
from ..relaxation.curve_nodes import CurveSurface, nodes_at
from ..relaxation.discrete_curve import DiscreteCurve, short_segments, without_points
from ..request import Request
from .reflection import asymmetry, joined_places, reflected_places, with_controls

TRIMMED = 1.0 / 1024.0
"""Length of curve next to the plane that is replaced by a trace, relative to the whole length.

It is half the usual distance between nodes.
"""

EXACT = 1e-9
"""Asymmetry of a curve, in bounding-box diagonals, that rounding errors explain."""

ROUNDED = 10.0 * RESOLUTIONS[0]
"""Asymmetry that the rounded coordinates of the canonical copy explain, in the same unit."""


@dataclass(frozen=True)
class Half:
    """The part of a curve on one side of the plane.

    Attributes
    ----------
    points : SurfacePoints
        Points of its polyline.
    control : (p,) int array
        For each of them, the index of its control point in the request, or -1 if it has none.
    is_node : (p,) bool array
        Which points are nodes.
    left_out : (p,) bool array
        Which nodes are left out of results, since they are close to edges.
    """

    points: SurfacePoints
    control: IntArray
    is_node: BoolArray
    left_out: BoolArray


def symmetric_curves(
    surface: CurveSurface, curve: DiscreteCurve, visited: IntArray, request: Request
) -> Iterator[tuple[DiscreteCurve, SurfaceCurve, IntArray]]:
    """Yield the symmetric curves made of the two halves of a curve.

    Parameters
    ----------
    surface : CurveSurface
    curve : DiscreteCurve
        A simple curve through the control points of a request with a mirror.
    visited : (n,) int array
        Indices of the control points in the order in which the curve visits them.
    request : Request

    Yields
    ------
    DiscreteCurve
        A simple curve. The one made of the half on the side of the given points comes first. A half
        that crosses the plane elsewhere, or whose image cannot be traced, is left out.
    SurfaceCurve
        The same curve without nodes close to edges.
    (n,) int array
        Indices of the control points in the order in which this curve visits them.
    """
    for side in (1, -1):
        half = half_of(surface, curve, visited, request, side)
        found = None if half is None else with_image(surface, half, request)
        if found is not None:
            yield found


def exactly_symmetric(
    surface: CurveSurface,
    curve: SurfaceCurve,
    nodes: DiscreteCurve,
    visited: IntArray,
    request: Request,
) -> SurfaceCurve:
    """A symmetric curve with the images of its points on the surface before rounding.

    Parameters
    ----------
    surface : CurveSurface
        The canonical copy with coordinates that are not rounded.
    curve : SurfaceCurve
        A curve on the canonical copy.
    nodes, visited, request : DiscreteCurve, (n,) int array, Request
        The same curve as for `symmetric_curves`.

    Returns
    -------
    SurfaceCurve
        The curve itself if it is already symmetric, if it is not nearly symmetric, or if its image
        cannot be traced.
    """
    plane, mesh = mirror_of(request).plane, surface.mesh
    before = asymmetry(with_points(mesh, curve, points_of(curve)), plane)
    if not EXACT < before / mesh.diagonal <= ROUNDED:
        return curve
    exact = [each for _, each, _ in symmetric_curves(surface, nodes, visited, request)]
    best = min(exact, key=lambda each: asymmetry(each, plane), default=None)
    return curve if best is None or asymmetry(best, plane) >= before else best


def half_of(
    surface: CurveSurface, curve: DiscreteCurve, visited: IntArray, request: Request, side: int
) -> Half | None:
    """The half of a curve on one side of the plane; None if it does not stay on this side.

    The sides of the plane are 1, that of the given points, and -1.
    """
    mirror = mirror_of(request)
    sides = side * mirror.side[visited]
    run = _run_on_side(sides, curve.closed, side)
    if run is None:
        return None
    index, n = curve.node_index[curve.control_nodes][run], len(curve.polyline)
    positions = curve.polyline.positions(surface.mesh)
    heights = side * mirror.plane.heights(positions)
    on_plane = ON_PLANE * surface.mesh.diagonal
    inner = (index[0] + np.arange((index[-1] - index[0]) % n + 1)) % n
    if (heights[np.setdiff1d(inner, index)] < -on_plane).any():
        return None
    control, is_node = np.full(n, -1), np.zeros(n, dtype=bool)
    control[index], is_node[curve.node_index] = visited[run], True
    trimmed = TRIMMED * curve.length
    back = onward = inner[:0]
    if sides[run[0]] and (curve.closed or run[0] > 0):
        way = (index[0] - np.arange(n if curve.closed else index[0] + 1)) % n
        back = way[_until_plane(positions[way], heights[way], is_node[way], on_plane, trimmed)]
    if sides[run[-1]] and (curve.closed or run[-1] < len(visited) - 1):
        way = (index[-1] + np.arange(n if curve.closed else n - index[-1])) % n
        onward = way[_until_plane(positions[way], heights[way], is_node[way], on_plane, trimmed)]
    every = np.concatenate([back[::-1], inner, onward])
    left_out = short_segments(surface.mesh, curve)[every]
    left_out[[0, -1]] = False
    return Half(curve.polyline[every], control[every], is_node[every], left_out)


def _run_on_side(sides: IntArray, closed: bool, side: int) -> IntArray | None:
    """Places of the control points of one side in the order of the curve; None if they are apart.

    `sides` has 1 for each control point on this side, -1 for each on the other, 0 on the plane.
    """
    k, count = len(sides), int((sides >= 0).sum())
    if closed:
        begins = np.flatnonzero((sides >= 0) & (np.roll(sides, 1) < 0))
    else:
        begins = np.array([0 if side > 0 else k - count])
    run = (begins[0] + np.arange(count)) % k
    if len(begins) > 1 or (sides[run] < 0).any() or (sides[run[1:-1]] == 0).any():
        return None
    return run


def _until_plane(
    positions: FloatArray, heights: FloatArray, is_node: BoolArray, on_plane: float, trimmed: float
) -> IntArray:
    """Indices of the points of a way before it reaches the plane, without its first point.

    The last of them is a node, since a trace from a point on an edge may begin in the wrong face.

    Parameters
    ----------
    positions : (p, 3) float array
        Points of the way from a control point.
    heights : (p,) float array
        Their distances from the plane.
    is_node : (p,) bool array
    on_plane : float
        Greatest distance of a point on the plane.
    trimmed : float
        Length next to the plane within which points are left out, but at most half of the way.
    """
    reached = int((heights <= on_plane).argmax())
    steps = np.linalg.norm(np.diff(positions[: reached + 1], axis=0), axis=1)
    high, low = heights[reached - 1], heights[reached]
    steps[-1] *= high / max(high - low, high)  # up to the plane
    left = np.cumsum(steps[::-1])[::-1]
    kept = np.flatnonzero(is_node[:reached] & (left > min(trimmed, 0.5 * left[0])))
    return np.arange(1, kept[-1] + 1)


def with_image(
    surface: CurveSurface, half: Half, request: Request
) -> tuple[DiscreteCurve, SurfaceCurve, IntArray] | None:
    """A half and its mirror image as one simple curve; None if it cannot be traced.

    The results are those of `symmetric_curves`. The curve begins at the first control point of the
    side of the given points.
    """
    mirror = mirror_of(request)
    control = half.control
    image = np.where(control < 0, -1, mirror.image[control])
    own = with_controls(half.points, control, request.points)
    reflected = reflected_places(surface.mesh, mirror.plane, half.points)
    reflected = with_controls(reflected, image, request.points)
    backward = np.flatnonzero((control < 0) | (control != image))[::-1]
    parts = [np.arange(len(control)), len(control) + backward]
    if (mirror.side[control[control >= 0]] < 0).any():
        parts = parts[::-1]
    order = np.concatenate(parts)
    point = np.concatenate([control, image])[order]
    if request.closed:
        at_controls = np.flatnonzero(point >= 0)
        run = _run_on_side(mirror.side[point[at_controls]], True, 1)
        assert run is not None
        order, point = (np.roll(each, -int(at_controls[run[0]])) for each in (order, point))
    found = joined_places(surface, joined([own, reflected])[order], request.closed)
    if found is None or len(crossing_segments(surface.mesh.faces, found[0], request.closed)):
        return None
    polyline, number = found
    node_index = number[np.tile(half.is_node, 2)[order]]
    is_control = np.zeros(len(polyline), dtype=bool)
    is_control[number[point >= 0]] = True
    nodes = nodes_at(surface, polyline[node_index], request.closed)
    curve = DiscreteCurve(nodes, np.flatnonzero(is_control[node_index]), polyline, node_index)
    visited = point[point >= 0]
    curve = curve.with_corners(request.are_corners(visited))
    left_out = np.zeros(len(polyline), dtype=bool)
    left_out[number[np.tile(half.left_out, 2)[order]]] = True
    return curve, without_points(surface.mesh, curve, left_out), visited


def mirror_of(request: Request) -> Mirror:
    """The mirror of a request that has one."""
    assert request.mirror is not None
    return request.mirror
