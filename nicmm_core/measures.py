"""Measures of a curve: lengths, enclosed area, curvature, slope, distance from obstacles."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from .errors import ArgumentError, CurveError
from .geometry.array_types import BoolArray, FloatArray, IntArray
from .geometry.curve import (
    SurfaceCurve,
    arc_lengths,
    checked_curve,
    leg_lengths,
    resample,
    weights_in_faces,
)
from .geometry.geodesic_curvature import geodesic_curvature
from .geometry.mesh import Mesh, edge_lengths, real_array
from .geometry.segment_distances import FaceSegments, SegmentDistances
from .geometry.surface_points import SurfacePoints
from .geometry.tolerances import TINY
from .outputs.cut import cut_mesh
from .outputs.region import enclosed_region
from .repair.free_surface import HARD
from .repair.mapped_mesh import MappedMesh
from .repair.surface_normals import surface_normals

WINDOW = 3.0
"""Least distance of the samples at which curvature is measured, in mean edge lengths along the
curve. Shorter ones would show the bends of the polyline at edges instead of the curve."""

SHARE = 0.2
"""The same in geometric means of the mean edge length and the length of the curve. It grows in
edges as a mesh becomes finer, so that the measured curvature converges."""

FEWEST, MOST = 32, 4000
"""Least and greatest number of samples of a curve."""

FIRST_LIMIT = 0.05
"""Distance up to which obstacles are looked for first, in bounding-box diagonals; it is doubled
until one is found."""

NAMES = (
    "length",
    "leg_lengths",
    "area",
    "least_radius",
    "least_radius_at",
    "greatest_slope",
    "distance_to_obstacle",
)
"""Names of the measures, in the order of `measures_of`."""


@dataclass(frozen=True)
class CurvatureSamples:
    """Geodesic curvature at evenly spaced places of a curve.

    Attributes
    ----------
    points : (n, 3) float array
        Places on the surface.
    conormals : (n, 3) float array
        Unit vectors in the tangent plane, to the left of the curve, seen with the normals upwards.
    curvature : (n,) float array
        In 1/length, positive where the curve turns left; zero at the ends of an open curve.
    """

    points: FloatArray
    conormals: FloatArray
    curvature: FloatArray


def measures_of(
    mapped: MappedMesh,
    curve: SurfaceCurve,
    there: SurfaceCurve,
    obstacles: FloatArray | None,
    up: FloatArray,
    corners: IntArray,
) -> dict[str, Any]:
    """The measures of a curve, as `SurfaceCurve.measures` describes them.

    Parameters
    ----------
    mapped : MappedMesh
        Map from the mesh of the curve to a manifold.
    curve, there : SurfaceCurve
        The curve on its mesh, and on the manifold.
    obstacles : (V,) float array, optional
    up : (3,) float array
    corners : (c,) int array
        Indices of control points near which curvature is not measured.
    """
    mesh = mapped.original
    samples = curvature_samples(mesh, curve)
    radius, place = _least_radius(samples, curve, corners)
    return {
        "length": curve.length,
        "leg_lengths": leg_lengths(curve).tolist(),
        "area": enclosed_area(mapped.mesh, there),
        "least_radius": radius,
        "least_radius_at": place,
        "greatest_slope": greatest_slope(samples, curve.closed, up),
        "distance_to_obstacle": (
            None if obstacles is None else distance_to_obstacle(mapped, there, obstacles)
        ),
    }


def checked_up(up: ArrayLike) -> FloatArray:
    """Check a direction and give it unit length; raises ArgumentError."""
    try:
        direction = real_array(up)
    except (TypeError, ValueError, OverflowError) as error:
        raise ArgumentError(f"up cannot be read as numbers ({error})") from error
    if direction.shape != (3,) or not np.isfinite(direction).all() or not direction.any():
        raise ArgumentError(f"up is {up!r}; pass a direction of three numbers, such as (0, 0, 1)")
    size = np.abs(direction).max()
    return direction / size / float(np.linalg.norm(direction / size))


def enclosed_area(mesh: Mesh, curve: SurfaceCurve) -> float | None:
    """Area of the smaller side of a curve, or None if it bounds no region."""
    if not curve.closed:
        return None
    try:
        return enclosed_region(mesh, cut_mesh(mesh, curve, snap=0.0)).area
    except CurveError:
        return None


def curvature_samples(mesh: Mesh, curve: SurfaceCurve) -> CurvatureSamples:
    """Geodesic curvature at places that are a few edges apart.

    Raises
    ------
    CurveError
        If the curve does not lie on the mesh.
    """
    curve, segment_faces = checked_curve(mesh, curve, across_gaps=True)
    steps = np.linalg.norm(curve.steps, axis=1)
    sides = mesh.faces[segment_faces[: len(steps)]][:, [[1, 2], [2, 0], [0, 1]]]
    edges = edge_lengths(mesh.vertices, sides.reshape(-1, 2)).reshape(-1, 3).mean(axis=1)
    edge = float((edges * steps).sum() / max(steps.sum(), TINY))
    window = max(WINDOW * edge, SHARE * float(np.sqrt(edge * curve.length)))
    count = int(np.clip(curve.length / max(window, TINY), FEWEST, MOST))
    points, segment = resample(curve.points, count, curve.closed)
    normals = surface_normals(mesh, *_places(mesh, curve, segment_faces, segment, points))
    curvature = geodesic_curvature(points, normals, curve.closed)
    return CurvatureSamples(points, np.cross(normals, _tangents(points, curve.closed)), curvature)


def _places(
    mesh: Mesh, curve: SurfaceCurve, faces: IntArray, segment: IntArray, points: FloatArray
) -> tuple[IntArray, FloatArray]:
    """Faces and barycentric coordinates of points on segments of a curve."""
    following = (segment + 1) % len(curve.faces)
    there = faces[segment]
    begin, end = (
        weights_in_faces(mesh, curve.faces[each], curve.barycentric[each], there)
        for each in (segment, following)
    )
    length = np.linalg.norm(curve.steps[segment], axis=1)
    along = np.linalg.norm(points - curve.points[segment], axis=1)
    share = (along / np.maximum(length, TINY)).clip(0.0, 1.0)[:, None]
    return there, (1.0 - share) * begin + share * end


def _tangents(points: FloatArray, closed: bool) -> FloatArray:
    """Unit tangents at evenly spaced points, (n, 3)."""
    if closed:
        along = np.roll(points, -1, axis=0) - np.roll(points, 1, axis=0)
    else:
        along = np.gradient(points, axis=0)
    return along / np.maximum(np.linalg.norm(along, axis=1, keepdims=True), TINY)


def _least_radius(
    samples: CurvatureSamples, curve: SurfaceCurve, corners: IntArray
) -> tuple[float, list[float] | None]:
    """Least radius of geodesic curvature, and where; infinite and None for a geodesic."""
    size = np.abs(samples.curvature)
    size[_near_corners(samples, curve, corners)] = 0.0
    sharpest = int(size.argmax())
    if not size[sharpest] > TINY:
        return float("inf"), None
    return float(1.0 / size[sharpest]), samples.points[sharpest].tolist()


def _near_corners(samples: CurvatureSamples, curve: SurfaceCurve, corners: IntArray) -> BoolArray:
    """Whether the bend at each sample includes that at a corner."""
    near = np.zeros(len(samples.points), dtype=bool)
    if not len(corners):
        return near
    arcs = arc_lengths(curve.steps)
    at = arcs[curve.control_index[corners]]
    own = np.linspace(0.0, arcs[-1], len(near), endpoint=not curve.closed)
    away = np.abs(own[:, None] - at)
    if curve.closed:
        away = np.minimum(away, arcs[-1] - away)
    result: BoolArray = away.min(axis=1) <= own[1] - own[0]
    return result


def greatest_slope(samples: CurvatureSamples, closed: bool, up: FloatArray) -> float:
    """Greatest angle between the curve and the horizontal plane, in radians."""
    sines = np.abs(_tangents(samples.points, closed) @ up).clip(0.0, 1.0)
    return float(np.arcsin(sines.max()))


def distance_to_obstacle(
    mapped: MappedMesh, curve: SurfaceCurve, obstacles: FloatArray
) -> float | None:
    """Least distance along the surface from a curve to obstacles of weight 1; None without any.

    Obstacles are faces whose corners all have weight 1, as for a design.
    """
    mesh = mapped.mesh
    hard = mapped.weights_to(obstacles) >= HARD
    inside = hard[mesh.faces].all(axis=1)
    component = mesh.face_component
    inside &= np.isin(component, component[curve.faces])
    if not inside.any():
        return None
    faces = np.repeat(np.flatnonzero(inside), 3)
    start, end = (
        np.tile(np.eye(3)[order], (int(inside.sum()), 1)) for order in ([1, 2, 0], [2, 0, 1])
    )
    # The nearest place of an obstacle is on its outline.
    outer = ~np.repeat(inside, 3)[mesh.opposite_sides] | (
        mesh.opposite_sides == np.arange(mesh.faces.size)
    )
    outline = outer.reshape(-1, 3)[inside].ravel()
    if inside[curve.faces].any() or not outline.any():
        return 0.0
    segments = FaceSegments(faces[outline], start[outline], end[outline])
    limit = FIRST_LIMIT * mesh.diagonal
    while True:
        away = SegmentDistances(mesh, segments, limit).at(
            SurfacePoints(curve.faces, curve.barycentric)
        )
        if away.min() < limit or limit > mesh.diagonal * len(mesh.faces):
            return float(away.min()) if np.isfinite(away.min()) else None
        limit *= 2.0
