"""Via points, which select the course of a curve between consecutive control points.

They select the homotopy class of the curve, such as the side of a limb or the direction around a
handle. Only the curve from which the computation starts passes through them; the final curve does
not interpolate them.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from ..errors import ArgumentError, PointName
from ..geometry.array_types import BoolArray
from ..geometry.mesh import Mesh
from ..geometry.surface_points import (
    SurfacePoints,
    check_distinct,
    check_one_component,
    control_point_names,
    joined,
    locate_points,
)

ViaPoints = Mapping[int, ArrayLike | SurfacePoints]
"""Mapping from the index of a control point to the via points on the leg that starts there."""

OFF_BOUNDARY = 0.2
"""Fraction by which a via point on the boundary is moved towards the centroid of its face."""

LocatedViaPoints = dict[int, SurfacePoints]
"""The same mapping after the checks, with points as faces and barycentric coordinates."""


@dataclass(frozen=True)
class Waypoints:
    """Control points and via points in the order of the path.

    Attributes
    ----------
    points : SurfacePoints
        All k waypoints.
    is_control : (k,) bool array
        Whether each waypoint is a control point.
    names : list of PointName
        Names of the waypoints in messages.
    """

    points: SurfacePoints
    is_control: BoolArray
    names: list[PointName]


def located_via_points(
    mesh: Mesh, points: SurfacePoints, via_points: ViaPoints | None, order: str, closed: bool
) -> LocatedViaPoints:
    """Check via points and convert them to faces and barycentric coordinates.

    Parameters
    ----------
    mesh : Mesh
    points : SurfacePoints
        Control points.
    via_points : mapping, optional
        Mapping from the index of a control point to points, in any form accepted for control
        points.
    order : str
        Order of the control points. Via points need "given", since otherwise the legs are not known
        in advance.
    closed : bool
        Whether the curve is closed. On an open curve no leg starts at the last control point.

    Returns
    -------
    dict of int to SurfacePoints
        Via points by the index of the control point at which their leg starts.

    Raises
    ------
    ArgumentError
        If ``via_points`` is not a mapping from indices of legs, or the order is not "given".
    ControlPointError
        If a via point is out of range or not on the surface.
    """
    if via_points is None:
        return {}
    if not isinstance(via_points, Mapping):
        raise ArgumentError(
            f"via_points is a {type(via_points).__name__}; pass a mapping from the index of a "
            "control point to points, such as {1: [57]}"
        )
    if via_points and order != "given":
        raise ArgumentError(
            f'via_points needs order="given", not {order!r}: otherwise consecutive points are not '
            "known in advance"
        )
    last = len(points) - 1 if closed else len(points) - 2
    for key in via_points:
        if isinstance(key, bool) or not isinstance(key, int | np.integer) or not 0 <= key <= last:
            raise ArgumentError(
                f"via_points[{key!r}] is not the index of a leg; each key must be the index of a "
                f"control point at which a leg starts, 0 … {last}"
            )
    return {
        int(key): locate_points(mesh, value, f"via_points[{key}]")
        for key, value in via_points.items()
    }


def with_via_points(
    mesh: Mesh, points: SurfacePoints, via_points: ViaPoints, order: str, closed: bool
) -> Waypoints:
    """Merge via points with control points in the order of the path, and check them.

    The arguments are those of `located_via_points`. Its errors are raised too, in addition to those
    below.

    Returns
    -------
    Waypoints
        Control points and via points; via points on the boundary are moved into their faces.

    Raises
    ------
    ControlPointError
        If a via point coincides with another point.
    UnreachableError
        If not all points lie on the same component.
    """
    located = located_via_points(mesh, points, via_points, order, closed)
    controls = control_point_names(np.arange(len(points)))
    parts, is_control, names = [], [], []
    for index, control in enumerate(controls):
        via = located.get(index, points[:0])
        parts += [points[index : index + 1], via]
        is_control += [True] + [False] * len(via)
        names += [control, *(PointName(f"via_points[{index}]", i) for i in range(len(via)))]
    together = joined(parts)
    check_distinct(mesh, together, names)
    check_one_component(mesh, together, names)
    controls_only = np.array(is_control)
    return Waypoints(_off_the_boundary(mesh, together, ~controls_only), controls_only, names)


def _off_the_boundary(mesh: Mesh, points: SurfacePoints, which: BoolArray) -> SurfacePoints:
    """Move the selected points that lie on the boundary into the interior of their faces.

    The path may touch the boundary at control points, but not at via points.
    """
    on_rim = np.zeros(len(mesh.vertices), dtype=bool)
    on_rim[mesh.unpaired_edges[0]] = True
    support = (points.barycentric > 0.0) & ~on_rim[mesh.faces[points.faces]]
    moved = (which & ~support.any(axis=1))[:, None]
    inside = (1.0 - OFF_BOUNDARY) * points.barycentric + OFF_BOUNDARY / 3.0
    return SurfacePoints(points.faces, np.where(moved, inside, points.barycentric))


def parse_via_points(texts: list[str]) -> dict[int, list[int]]:
    """Parse the via points of the command line, one text such as ``"1:57,80"`` for each leg.

    Returns
    -------
    dict of int to list of int
        Vertices of the via points by the index of the control point at which their leg starts.

    Raises
    ------
    ArgumentError
        If a text has another form, or two texts are for the same leg.
    """
    via_points: dict[int, list[int]] = {}
    for text in texts:
        key, colon, vertices = text.partition(":")
        try:
            if not colon:
                raise ValueError("it has no colon")
            index, along = int(key), [int(vertex) for vertex in vertices.split(",")]
        except ValueError as error:
            raise ArgumentError(
                f"--via is {text!r}; give the index of a control point (from 0) and vertex "
                "indices, such as 1:57,80"
            ) from error
        if index in via_points:
            raise ArgumentError(
                f"--via names leg {index} twice; give all its vertices in one --via"
            )
        via_points[index] = along
    return via_points
