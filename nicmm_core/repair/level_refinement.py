"""Refines a surface near a line at a constant distance from segments.

Distances along the surface are exact (`geometry.segment_distances`). Faces are bisected until
linear interpolation resolves the line.
"""

from __future__ import annotations

from dataclasses import dataclass

import nicmm_kernels
import numpy as np
from scipy.spatial import cKDTree

from ..geometry.array_types import BoolArray, FloatArray, IntArray
from ..geometry.mesh import Mesh, opposite_sides
from ..geometry.segment_distances import FaceSegments, SegmentDistances
from ..geometry.surface_points import SurfacePoints
from ..progress import checkpoint
from .divided_faces import side_lengths
from .face_parts import FaceParts

REACH = 1.25
"""Distance beyond the line up to which distances are computed, in lengths of the longest edge of
the faces there, if that is not longer than allowed."""

MOST_PIECES = 20_000
"""Greatest length of the segments, relative to the longest edges that are allowed at the line. The
faces along them would be divided into some ten times as many parts."""


@dataclass(frozen=True)
class RefinedSurface:
    """Parts of the faces of a mesh, which resolve a line at a constant distance.

    Attributes
    ----------
    parts : FaceParts
    vertices : (v, 3) float array
    distances : (v,) float array
        Distances of the vertices. They may be too great or infinite far from the line.
    """

    parts: FaceParts
    vertices: FloatArray
    distances: FloatArray


def distances_up_to(
    mesh: Mesh, segments: FaceSegments, distance: float, coarsest: float
) -> SegmentDistances:
    """Distances from segments as far as a line at a distance needs them.

    Parameters
    ----------
    mesh : Mesh
    segments : FaceSegments
    distance : float
        Greatest distance of the line.
    coarsest : float
        Greatest longest edge of the parts at the line.

    Raises
    ------
    nicmm_kernels.TooManyWindowsError
    """
    _, longest = faces_near(mesh, segments, distance)
    return SegmentDistances(mesh, segments, distance + REACH * min(longest, coarsest))


def least_coarsest(mesh: Mesh, segments: FaceSegments) -> float:
    """Least value of `coarsest` for a line near segments; a smaller one would need too many parts.

    Parameters
    ----------
    mesh : Mesh
    segments : FaceSegments
    """
    start, end = segments.positions(mesh)
    return float(np.linalg.norm(end - start, axis=1).sum()) / MOST_PIECES


def faces_near(mesh: Mesh, segments: FaceSegments, distance: float) -> tuple[IntArray, float]:
    """The faces that may have points within a distance of segments, and their longest edge.

    Parameters
    ----------
    mesh : Mesh
    segments : FaceSegments
    distance : float

    Returns
    -------
    (n,) int array
        The faces, ascending.
    float
    """
    # A straight distance is not greater than a distance along the surface.
    ends = np.concatenate(segments.positions(mesh))
    pieces = np.linalg.norm(ends[: len(segments)] - ends[len(segments) :], axis=1)
    longest = side_lengths(mesh.vertices, mesh.faces).max(axis=1)
    reach = distance + 0.5 * float(pieces.max(initial=0.0))
    away, _ = cKDTree(ends).query(mesh.vertices, distance_upper_bound=reach + longest.max())
    near = np.flatnonzero(away[mesh.faces].min(axis=1) <= reach + longest)
    return near, float(longest[near].max(initial=0.0))


def refined_surface(
    distances: SegmentDistances,
    parts: FaceParts,
    vertices: FloatArray,
    fixed: BoolArray,
    limits: nicmm_kernels.LevelLimits,
) -> RefinedSurface:
    """Bisect parts of faces until they resolve a line at a constant distance.

    Parameters
    ----------
    distances : SegmentDistances
    parts : FaceParts
        Parts of faces of the mesh of these distances.
    vertices : (v, 3) float array
    fixed : (v,) bool array
        A side between two such vertices is not divided.
    limits : nicmm_kernels.LevelLimits
    """
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
        distances.faces_reached,
        limits,
        checkpoint,
    )
    return RefinedSurface(
        FaceParts(refined.faces, refined.parents, refined.corners),
        refined.vertices,
        refined.distances,
    )


def _distances_of_vertices(distances: SegmentDistances, parts: FaceParts, count: int) -> FloatArray:
    """Distances of the vertices of parts, (count,); infinite for other vertices."""
    vertex, first = np.unique(parts.faces, return_index=True)
    row, corner = np.divmod(first, 3)
    found = np.full(count, np.inf)
    found[vertex] = distances.at(SurfacePoints(parts.parent[row], parts.corners[row, corner]))
    return found
