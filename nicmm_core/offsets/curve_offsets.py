"""Curves at a constant distance from another curve, on one side of it.

Distances along the surface are exact (`geometry.segment_distances`): the shortest paths begin at
the segments of the curve, and are straight across unfolded faces. An offset consists of all points
at its distance whose shortest paths begin on its side of the curve. So offsets split and merge as
the lines of a distance field do, and those of an open curve end beside its ends.

A distance may vary along the curve. It then is that at the place where the shortest path begins.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import nicmm_kernels
import numpy as np

from ..arguments import checked_number
from ..errors import ArgumentError, CurveError
from ..geometry.array_types import BoolArray, FloatArray, IntArray
from ..geometry.curve import SurfaceCurve, arc_lengths, curve_on_mesh, without_small_weights
from ..geometry.mesh import Mesh, real_array
from ..geometry.orientation import turned_faces
from ..geometry.segment_distances import FaceSegments, SegmentDistances, segments_of
from ..geometry.surface_points import SurfacePoints
from ..geometry.tolerances import SAME_POSITION
from ..outputs.chain import necessary_points
from ..repair.face_parts import FaceParts, whole_faces
from ..repair.level_refinement import (
    RefinedSurface,
    distances_up_to,
    faces_near,
    least_coarsest,
    refined_surface,
)
from ..repair.mapped_mesh import MappedMesh
from .level_lines import LevelLine, level_lines, reversed_line, where

COARSEST = 0.5
"""Greatest longest edge of the parts of faces at an offset, in distances."""

FINEST = 1e-3
"""Length of an edge up to which parts of faces are accurate enough in any case, in distances."""

ERROR = 2e-4
"""Greatest error of distances that are interpolated on parts of faces, in distances. An offset is
exact where it crosses an edge of a part, and deviates by about as much in between."""

THINNED = 2e-5
"""Greatest distance by which an offset moves where points inside faces are left out, in
distances."""

WANTED = "a length other than zero, positive for the left side of the curve"


def checked_distances(curve: SurfaceCurve, distances: Any) -> list[FloatArray]:
    """Check the distances of several offsets, each as `checked_distance`.

    Raises
    ------
    ArgumentError
    """
    if not isinstance(distances, Sequence | np.ndarray) or isinstance(distances, str | bytes):
        raise ArgumentError(f"distances is a {type(distances).__name__}; pass a list of distances")
    return [
        checked_distance(f"distances[{index}]", each, curve) for index, each in enumerate(distances)
    ]


def checked_distance(name: str, distance: Any, curve: SurfaceCurve) -> FloatArray:
    """Check the distance of an offset.

    Parameters
    ----------
    name : str
        Name of the argument.
    distance : object
    curve : SurfaceCurve

    Returns
    -------
    (1,) or (k,) float array
        One value, or one for each control point that the curve passes.

    Raises
    ------
    ArgumentError
    """
    if isinstance(distance, str | bytes) or np.ndim(distance) == 0:
        values = np.array([checked_number(name, distance, WANTED)])
    else:
        values = _checked_values(name, distance, int((curve.control_index >= 0).sum()))
    if (values == 0.0).any():
        raise ArgumentError(f"{name} is zero; pass {WANTED}")
    if (values > 0.0).any() and (values < 0.0).any():
        raise ArgumentError(
            f"{name} has positive and negative values; an offset stays on one side of the curve, "
            "so pass values of one sign"
        )
    return values


def _checked_values(name: str, distance: Any, count: int) -> FloatArray:
    """Check one distance for each of some control points."""
    try:
        values = real_array(distance)
    except (TypeError, ValueError, OverflowError) as error:
        raise ArgumentError(f"{name} cannot be read as numbers ({error})") from error
    if values.shape != (count,) or not count:
        raise ArgumentError(
            f"{name} has shape {values.shape}; pass one length, or one for each of the {count} "
            "control points of the curve"
        )
    if not np.isfinite(values).all():
        raise ArgumentError(f"{name} has values that are not finite; pass lengths")
    return values


def offset_curves(
    mapped: MappedMesh, curve: SurfaceCurve, distances: list[FloatArray]
) -> list[list[SurfaceCurve]]:
    """The offsets of a curve at several distances.

    Parameters
    ----------
    mapped : MappedMesh
        Map from the given mesh to a manifold.
    curve : SurfaceCurve
        The curve on the manifold.
    distances : list of (k,) float array
        From `checked_distances`.

    Returns
    -------
    list of list of SurfaceCurve
        The curves on the given mesh at each distance, the longest one first. They have the
        direction of the curve, and no control points.

    Raises
    ------
    CurveError
        If the curve has no length, or the surface near it has only one side.
    ArgumentError
        If a distance is too great or too small for the mesh.
    """
    if not distances:
        return []
    magnitudes = np.concatenate([np.abs(each) for each in distances])
    farthest, nearest = float(magnitudes.max()), float(magnitudes.min())
    band = _band(mapped.mesh, curve, farthest)
    least = least_coarsest(band.mesh, band.segments) / COARSEST
    if nearest < least:
        raise ArgumentError(
            f"distance is {nearest:g}, too small beside the length of the curve; pass at least "
            f"{least:.2g}"
        )
    try:
        found = distances_up_to(band.mesh, band.segments, farthest, COARSEST * farthest)
    except nicmm_kernels.TooManyWindowsError as error:
        raise ArgumentError(
            f"distance is {farthest:g}, which reaches over too many faces of this mesh; use a "
            "smaller one"
        ) from error
    return [
        [
            _on_given(mapped, band, line, THINNED * float(np.abs(each).min()))
            for line in _offsets(band, found, curve, each)
        ]
        for each in distances
    ]


@dataclass(frozen=True)
class _Band:
    """The part of a surface near a curve.

    Attributes
    ----------
    mesh : Mesh
        Its faces, consistently oriented.
    parts : FaceParts
        These faces as faces of the whole mesh.
    segments : FaceSegments
        The segments of the curve on the part.
    """

    mesh: Mesh
    parts: FaceParts
    segments: FaceSegments


def _band(mesh: Mesh, curve: SurfaceCurve, distance: float) -> _Band:
    """The faces that may have points within a distance of a curve."""
    segments = segments_of(mesh, curve)
    start, end = segments.positions(mesh)
    kept = np.linalg.norm(end - start, axis=1) > SAME_POSITION * mesh.diagonal
    if not kept.any():
        raise CurveError("curve has no length; pass a curve through different points")
    segments = segments.taken(kept)
    near, _ = faces_near(mesh, segments, distance)
    vertex, faces = np.unique(mesh.faces[near], return_inverse=True)
    faces = faces.reshape(-1, 3)
    band = Mesh(mesh.vertices[vertex], faces)
    with_curve = band.face_component[np.searchsorted(near, segments.faces[0])]
    near = near[band.face_component == with_curve]
    parts = whole_faces(mesh.faces).taken(near)
    vertex, faces = np.unique(parts.faces, return_inverse=True)
    parts = parts.with_faces(faces.reshape(-1, 3))
    parts = parts.turned(turned_faces(Mesh(mesh.vertices[vertex], parts.faces)))
    band = Mesh(mesh.vertices[vertex], parts.faces)
    if not band.is_oriented:
        raise CurveError(
            "curve lies on a surface with one side only, such as a Möbius strip, on which it has "
            "no left side; cut the surface open first"
        )
    return _Band(band, parts, _in_band(parts, near, segments))


def _in_band(parts: FaceParts, near: IntArray, segments: FaceSegments) -> FaceSegments:
    """Segments of some faces, (n,), as segments of the same faces in a band."""
    face = np.searchsorted(near, segments.faces)
    corner = parts.corners[face].argmax(axis=2)
    start, end = (
        np.take_along_axis(weights, corner, axis=1) for weights in (segments.start, segments.end)
    )
    return FaceSegments(face, start, end)


def _offsets(
    band: _Band, distances: SegmentDistances, curve: SurfaceCurve, distance: FloatArray
) -> list[LevelLine]:
    """The offsets at one distance as lines on a band, the longest one first."""
    widths, is_left = np.abs(distance), bool(distance[0] > 0.0)
    level = float(widths.min())
    if len(widths) > 1:
        distances = distances.relative_to(*_knots(curve, widths))
    end = SAME_POSITION * band.mesh.diagonal

    def value(points: SurfacePoints) -> FloatArray:
        return distances.nearest(points)[0] - level

    def is_on_side(points: SurfacePoints) -> BoolArray:
        _, arcs, sides = distances.nearest(points)
        found = sides == (1.0 if is_left else -1.0)
        # Beyond its ends, an open curve has no sides.
        return found if curve.closed else found & (arcs > end) & (arcs < distances.total - end)

    surface = _resolved(distances, level)
    lines = level_lines(surface.parts, surface.distances - level, value)
    if is_left:
        lines = [reversed_line(line) for line in lines]
    found = [part for line in lines for part in where(line, is_on_side)]
    return sorted(found, key=lambda line: -line.length(band.mesh))


def _knots(curve: SurfaceCurve, widths: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Arc lengths at which widths are given, ascending, and the widths there."""
    arcs = arc_lengths(curve.steps)
    passed = curve.control_index[curve.control_index >= 0]
    order = np.argsort(passed, kind="stable")
    knots, widths = arcs[passed[order]], widths[order]
    if curve.closed:
        knots = np.concatenate([[knots[-1] - arcs[-1]], knots, [knots[0] + arcs[-1]]])
        widths = np.concatenate([widths[-1:], widths, widths[:1]])
    return knots, widths


def _resolved(distances: SegmentDistances, level: float) -> RefinedSurface:
    """The faces near a line at a distance, divided so that they resolve it."""
    mesh = distances.mesh
    parts = whole_faces(mesh.faces).taken(distances.faces_reached)
    limits = nicmm_kernels.LevelLimits(
        level, level, COARSEST * level, FINEST * level, ERROR * level
    )
    fixed = np.zeros(len(mesh.vertices), dtype=bool)
    return refined_surface(distances, parts, mesh.vertices, fixed, limits)


def _on_given(mapped: MappedMesh, band: _Band, line: LevelLine, deviation: float) -> SurfaceCurve:
    """A line on a band of the manifold as a curve on the given mesh.

    Points inside faces are left out where that moves the curve by no more than a deviation.
    """
    points = band.parts.in_parents(line.points)
    weights = without_small_weights(points.barycentric.clip(0.0))
    free = np.zeros(len(weights), dtype=bool)
    positions = points.positions(mapped.mesh)
    kept = necessary_points(positions, weights, line.closed, free, deviation)
    none = np.zeros(0, dtype=np.int64)
    curve = curve_on_mesh(mapped.mesh, line.closed, points.faces[kept], weights[kept], none)
    if not mapped.differs:
        return curve
    curve = mapped.curve_back(curve)
    return mapped.clean.removed_faces.led_across(curve, SurfacePoints(none, np.zeros((0, 3))))
