"""The part of a surface beyond a distance from avoided curves.

Faces near the curves are bisected until they resolve the line at this distance, and divided along
it. Distances along the surface are exact (`geometry.segment_distances`).
"""

from __future__ import annotations

import nicmm_kernels
import numpy as np

from ..errors import ArgumentError
from ..geometry import tolerances
from ..geometry.array_types import FloatArray
from ..geometry.curve import weights_in_faces
from ..geometry.mesh import Mesh
from ..geometry.segment_distances import FaceSegments, SegmentDistances
from ..geometry.surface_points import SurfacePoints
from ..repair.divided_faces import positive_parts
from ..repair.face_parts import FaceParts
from ..repair.level_refinement import distances_up_to, least_coarsest, refined_surface
from ..repair.mapped_mesh import MappedMesh
from ..repair.removed_faces import points_at
from .avoided_curve import FADE, Avoided

LEVEL = 1.02
"""Distance at which the surface is divided, in clearances.

The distance that is kept differs from it by up to `SNAP` and about `ERROR`, so it is not less than
the clearance."""

COARSEST = 2.0
"""Greatest longest edge of the faces that are divided at the clearance, in clearances."""

FINEST = 1.0 / 16.0
"""Length of an edge up to which faces are accurate enough in any case, in clearances."""

ERROR = 0.012
"""Greatest error of distances that are interpolated on these faces, at their centroids and in the
middle of their sides, in clearances. Faces with greater errors are bisected further."""

SNAP = 0.006
"""Distance up to which the line at the clearance is moved to a vertex, in clearances."""

RINGS = 3
"""Number of rings of faces, around those within reach, that may be bisected with them."""


def segments_with_clearance(mapped: MappedMesh, avoided: Avoided, clearance: float) -> FaceSegments:
    """The segments of a curve on the mesh from which the clearance is kept."""
    fade = FADE * clearance
    segments, arc = avoided.pieces(mapped.original, avoided.ends(fade))
    counts = avoided.from_junctions(arc) >= fade
    return _on_mesh(mapped, segments.taken(counts))


def _on_mesh(mapped: MappedMesh, segments: FaceSegments) -> FaceSegments:
    """Segments in faces of the given mesh as segments in all faces of the mesh that hold them."""
    if not mapped.differs:
        return segments
    given = mapped.original
    which, faces = [np.arange(len(segments))], [segments.faces]
    corners = given.faces[segments.faces]
    used = (segments.start > 0.0) | (segments.end > 0.0)
    for segment in np.flatnonzero(used.sum(axis=1) < 3).tolist():
        others = given.faces_with(corners[segment][used[segment]])
        which.append(np.full(len(others), segment))
        faces.append(others)
    segment, face = np.concatenate(which), np.concatenate(faces)
    start, end = (
        weights_in_faces(given, segments.faces[segment], weights[segment], face)
        for weights in (segments.start, segments.end)
    )
    index, part, first, last = mapped.in_given.clipped(face, start, end)
    begins, ends = (mapped.in_mesh.in_parents(SurfacePoints(part, w)) for w in (first, last))
    found = [(begins.faces, begins.barycentric, ends.barycentric)]
    # In a face that was removed, a segment is found by the positions of its ends.
    lost = np.setdiff1d(segment[mapped.clean.removed[face]], segment[index])
    farthest = tolerances.ON_SURFACE * given.diagonal
    for number in lost.tolist():
        one, other = (
            points_at(
                mapped.mesh,
                SurfacePoints(segments.faces[[number]], weights[[number]]).positions(given)
                - mapped.origin,
                farthest,
            )
            for weights in (segments.start, segments.end)
        )
        _, here, there = np.intersect1d(one.faces, other.faces, return_indices=True)
        found.append((one.faces[here], one.barycentric[here], other.barycentric[there]))
        found += [(each.faces, each.barycentric, each.barycentric) for each in (one, other)]
    return FaceSegments(*(np.concatenate(arrays) for arrays in zip(*found, strict=True)))


def distances_near(mesh: Mesh, segments: FaceSegments, clearance: float) -> SegmentDistances:
    """Distances from the segments as far as they are needed.

    Raises
    ------
    ArgumentError
        If the clearance is too small beside the length of the segments, or reaches too far.
    """
    least = least_coarsest(mesh, segments) / COARSEST
    if clearance < least:
        raise ArgumentError(
            f"clearance is {clearance:g}, too small beside the lengths of the curves to avoid; "
            f"pass 0, or at least {least:.2g}"
        )
    try:
        return distances_up_to(mesh, segments, LEVEL * clearance, COARSEST * clearance)
    except nicmm_kernels.TooManyWindowsError as error:
        raise ArgumentError(
            f"clearance is {clearance:g}, which reaches over too many faces of this mesh; use a "
            "smaller one"
        ) from error


def beyond_clearance(
    distances: SegmentDistances, parts: FaceParts, vertices: FloatArray, clearance: float
) -> tuple[FaceParts, FloatArray]:
    """The parts beyond the clearance, divided along the line at the clearance, and all vertices."""
    reached = distances.faces_reached
    touched = np.zeros(len(vertices), dtype=bool)
    near = reached[parts.parent]
    for _ in range(RINGS):
        touched[parts.faces[near]] = True
        near |= touched[parts.faces].any(axis=1)
    others, parts = parts.taken(~near), parts.taken(near)
    fixed = np.zeros(len(vertices), dtype=bool)
    fixed[others.faces] = True

    level = LEVEL * clearance
    limits = nicmm_kernels.LevelLimits(
        level, clearance, COARSEST * clearance, FINEST * clearance, ERROR * clearance
    )
    refined = refined_surface(distances, parts, vertices, fixed, limits)
    values = refined.distances - level
    parts, vertices = positive_parts(refined.parts, refined.vertices, values, SNAP * clearance)
    return others.joined(parts), vertices
