"""The part of a surface beyond a distance from avoided curves.

Faces near the curves are bisected until they resolve the line at this distance, and divided along
it. Distances along the surface are exact (`geometry.segment_distances`).
"""

from __future__ import annotations

import nicmm_kernels
import numpy as np
from scipy.spatial import cKDTree

from ..errors import ArgumentError
from ..geometry import tolerances
from ..geometry.array_types import FloatArray
from ..geometry.curve import weights_in_faces
from ..geometry.mesh import Mesh, opposite_sides
from ..geometry.segment_distances import FaceSegments, SegmentDistances
from ..geometry.surface_points import SurfacePoints
from ..progress import checkpoint
from ..repair.divided_faces import positive_parts, side_lengths
from ..repair.face_parts import FaceParts
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

REACH = 1.25
"""Distance beyond the line up to which distances are computed, in lengths of the longest edge of
the faces there, if that is at most `COARSEST`."""

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
    """Distances from the segments as far as they are needed."""
    # A straight distance is not greater than a distance along the surface.
    longest = side_lengths(mesh.vertices, mesh.faces).max(axis=1)
    away, _ = cKDTree(np.concatenate(segments.positions(mesh))).query(
        mesh.vertices, distance_upper_bound=LEVEL * clearance + longest.max()
    )
    near = away[mesh.faces].min(axis=1) <= LEVEL * clearance + longest
    longest = min(longest[near].max(initial=0.0), COARSEST * clearance)
    try:
        return SegmentDistances(mesh, segments, LEVEL * clearance + REACH * longest)
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
    refined = nicmm_kernels.refine_at_level(
        distances.paths,
        nicmm_kernels.PartArrays(
            np.ascontiguousarray(parts.faces),
            opposite_sides(parts.faces).astype(np.int64),
            np.ascontiguousarray(parts.parent),
            np.ascontiguousarray(parts.corners),
            np.ascontiguousarray(vertices),
            _distances_of_vertices(distances, parts, len(vertices)),
            fixed,
        ),
        reached,
        nicmm_kernels.LevelLimits(
            level, clearance, COARSEST * clearance, FINEST * clearance, ERROR * clearance
        ),
        checkpoint,
    )
    parts = FaceParts(refined.faces, refined.parents, refined.corners)
    values = refined.distances - level
    parts, vertices = positive_parts(parts, refined.vertices, values, SNAP * clearance)
    return others.joined(parts), vertices


def _distances_of_vertices(distances: SegmentDistances, parts: FaceParts, count: int) -> FloatArray:
    """Distances of the vertices of parts, (count,); infinite for other vertices."""
    vertex, first = np.unique(parts.faces, return_index=True)
    row, corner = np.divmod(first, 3)
    found = np.full(count, np.inf)
    found[vertex] = distances.at(SurfacePoints(parts.parent[row], parts.corners[row, corner]))
    return found
