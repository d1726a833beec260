"""Adds the mirror images of control points, via points and maps to what the caller has given."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..errors import ArgumentError, ControlPointError, PointName
from ..geometry import tolerances
from ..geometry.array_types import FloatArray, IntArray
from ..geometry.mesh import Mesh
from ..geometry.mirror import ON_PLANE, Mirror, Plane
from ..geometry.surface_points import (
    SurfacePoints,
    check_count,
    check_distinct,
    control_point_names,
    joined,
    nearest_points,
    snapped,
)
from ..path.via_points import LocatedViaPoints

FARTHEST_IMAGE = 0.05
"""Greatest distance of the mirror image of a point from the surface, in bounding-box diagonals."""

RESOLUTION = 2.0**-36
"""Unit to which barycentric coordinates of images are rounded."""

ASYMMETRIC = "the mesh is not symmetric enough about this plane there"


@dataclass(frozen=True)
class ReflectedVertices:
    """The mirror image of each vertex of a mesh, where it has one.

    Attributes
    ----------
    plane : Plane
    vertices : (v,) int array
        Vertices whose images lie on the surface, up to `FARTHEST_IMAGE`.
    places : SurfacePoints
        Their images.
    """

    plane: Plane
    vertices: IntArray
    places: SurfacePoints


def reflected_vertices(mesh: Mesh, plane: Plane) -> ReflectedVertices:
    """The mirror images of all vertices that belong to faces."""
    vertices = np.flatnonzero(mesh.referenced)
    places, distance = nearest_points(mesh, plane.reflected(mesh.vertices[vertices]))
    near = distance <= FARTHEST_IMAGE * mesh.diagonal
    return ReflectedVertices(plane, vertices[near], snapped(places[near]))


def symmetric_weights(mesh: Mesh, weights: FloatArray, reflected: ReflectedVertices) -> FloatArray:
    """The greater one of the weight of each vertex and that of its mirror image, (V,)."""
    corners = weights[mesh.faces[reflected.places.faces]]
    there = (reflected.places.barycentric * corners).sum(axis=1)
    # Rounding must not turn an obstacle of weight 1 into a smaller one.
    there = np.where(there > 1.0 - tolerances.ROUNDED, 1.0, there)
    result = weights.copy()
    result[reflected.vertices] = np.maximum(result[reflected.vertices], there)
    return result


def with_images(
    mesh: Mesh,
    points: SurfacePoints,
    plane: Plane,
    closed: bool,
    order: str,
    among: IntArray | None,
) -> tuple[SurfacePoints, Mirror]:
    """Add the mirror images of control points.

    Parameters
    ----------
    mesh : Mesh
    points : SurfacePoints
        Control points on one side of the plane, or on it.
    plane : Plane
    closed : bool
    order : {"given", "shortest"}
        With "given", only the first and the last point of a closed curve, and the last point of an
        open one, may lie on the plane. With "shortest", as many of any points.
    among : (q,) int array or None
        Faces on which images may lie; None for all.

    Returns
    -------
    SurfacePoints
        The points, and then their images in reverse order, without those of points on the plane.
    Mirror

    Raises
    ------
    ControlPointError
        If there are too few points, points on both sides of the plane, a point on the plane where
        the curve may not cross it, or a point or image that is repeated.
    ArgumentError
        If an image is too far from the surface.
    """
    heights = plane.heights(points.positions(mesh))
    side = np.where(np.abs(heights) <= ON_PLANE * mesh.diagonal, 0, np.sign(heights)).astype(int)
    _check_sides(side, closed, order)
    if (side < 0).any():
        side, plane = -side, Plane(plane.point, -plane.normal)
    count = len(points)
    apart = np.flatnonzero(side)[::-1]
    check_count(count + len(apart), closed, " with mirror images")
    positions = plane.reflected(points[apart].positions(mesh))
    images, distance = nearest_points(mesh, positions, among)
    _check_distances(mesh, apart, distance)
    together = joined([points, _rounded(snapped(images))])
    names = control_point_names(np.arange(count))
    check_distinct(mesh, points, names)
    of_images = [PointName("mirror images of control_points", index) for index in apart.tolist()]
    try:
        check_distinct(mesh, together, names + of_images)
    except ControlPointError as error:
        raise ControlPointError(
            f"{error.points[0]} and {error.points[1]} are the same point, so {ASYMMETRIC}; choose "
            "points farther from the plane, or another plane",
            *error.points,
        ) from error
    image = np.arange(count + len(apart))
    image[apart] = count + np.arange(len(apart))
    image[count:] = apart
    return together, Mirror(plane, image, np.append(side, -np.ones(len(apart), dtype=int)))


def _rounded(points: SurfacePoints) -> SurfacePoints:
    """Points with rounded coordinates, so that the order of the corners makes no difference."""
    weights = np.round(points.barycentric / RESOLUTION) * RESOLUTION
    weights[np.arange(len(weights)), weights.argmax(axis=1)] += 1.0 - weights.sum(axis=1)
    return SurfacePoints(points.faces, weights)


def _check_sides(side: IntArray, closed: bool, order: str) -> None:
    """Raise ControlPointError if points, (k,), are on both sides or on the plane where not allowed.

    `side` is the sign of the height of each point, and 0 on the plane.
    """
    both = [np.flatnonzero(side == sign) for sign in (1, -1)]
    if all(map(len, both)):
        one, other = sorted(int(each[0]) for each in both)
        first, second = PointName("control_points", one), PointName("control_points", other)
        raise ControlPointError(
            f"{first} and {second} are on different sides of the mirror; pass the points of one "
            "side, since their mirror images are added",
            first,
            second,
        )
    on_plane = np.flatnonzero(side == 0)
    if order == "given":
        allowed = [0, len(side) - 1] if closed else [len(side) - 1]
        wrong = np.setdiff1d(on_plane, allowed)
    else:
        wrong = on_plane[2 if closed else 1 :]
    if len(wrong):
        name = PointName("control_points", int(wrong[0]))
        where = "the first and the last point" if closed else "the last point"
        raise ControlPointError(
            f"{name} is on the mirror, but a{' closed' if closed else 'n open'} symmetric curve "
            f"crosses it {'twice' if closed else 'once'}, so only {where} may be there; move "
            f"{name}, or leave it out",
            name,
        )


def _check_distances(mesh: Mesh, apart: IntArray, distance: FloatArray) -> None:
    far = distance > FARTHEST_IMAGE * mesh.diagonal
    if far.any():
        name = PointName("control_points", int(apart[far.argmax()]))
        share = float(distance[far.argmax()]) / mesh.diagonal
        raise ArgumentError(
            f"the mirror image of {name} is {share:.0%} of the mesh's diagonal away from the "
            f"surface, more than {FARTHEST_IMAGE:.0%}, so {ASYMMETRIC}; choose another plane or "
            "another point",
            name,
        )


def with_via_images(
    mesh: Mesh,
    via_points: LocatedViaPoints,
    count: int,
    mirror: Mirror,
    among: IntArray | None,
) -> LocatedViaPoints:
    """Add the mirror images of via points to the mirrored legs.

    Parameters
    ----------
    mesh : Mesh
    via_points : dict of int to SurfacePoints
        Via points of the legs that start at the given control points.
    count : int
        Number of the given control points.
    mirror : Mirror
    among : (q,) int array or None
        Faces on which images may lie; None for all.
    """
    result: LocatedViaPoints = {}
    for leg, via in via_points.items():
        heights = np.abs(mirror.plane.heights(via.positions(mesh)))
        places, _ = nearest_points(mesh, mirror.plane.reflected(via.positions(mesh)), among)
        backward = np.arange(len(via))[::-1]
        if leg < count - 1:
            result[leg] = via
            result[int(mirror.image[leg + 1])] = snapped(places)[backward]
        else:  # the leg to the other side is its own image
            apart = backward[heights[backward] > ON_PLANE * mesh.diagonal]
            result[leg] = joined([via, snapped(places)[apart]])
    return result
