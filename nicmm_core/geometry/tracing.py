"""Straight traces over the faces of a mesh: between two points, or of a given length from a point.

A trace is a normal section: the intersection of the surface with a plane that contains the surface
normal. The signs of the corners' heights above this plane decide which side of a face is crossed
next, so a trace cannot get lost between two faces. Two consecutive points of a trace lie in one
face, which is the face stored with the first of them. The cost depends on the number of faces
passed, not on the size of the mesh.
"""

from __future__ import annotations

from dataclasses import dataclass

import nicmm_kernels
import numpy as np

from ..progress import checkpoint
from . import tolerances
from .array_types import BoolArray, FloatArray, IntArray
from .mesh import Mesh
from .surface_points import SurfacePoints

MOST_FACES = 4096
"""Maximum number of faces of a trace. A longer trace runs around the surface and is not a short
connection."""

LIMITS = nicmm_kernels.TraceLimits(tolerances.INSIDE, MOST_FACES)


@dataclass(frozen=True)
class Traces:
    """Traces between m pairs of points; the points themselves are not included.

    Attributes
    ----------
    reached : (m,) bool array
        Whether each trace reached its end. Traces that failed have no crossings.
    pair : (q,) int array
        Index of the pair to which each crossing belongs, ascending.
    crossings : SurfacePoints
        Crossings with edges, in order along each trace. Each is given in the face that the trace
        enters there.
    """

    reached: BoolArray
    pair: IntArray
    crossings: SurfacePoints


def trace_between(
    mesh: Mesh,
    start: SurfacePoints,
    end: SurfacePoints,
    normals: FloatArray,
    longest: FloatArray,
    folded: BoolArray | None = None,
    ahead: FloatArray | None = None,
) -> Traces:
    """Trace from points inside faces to other points nearby.

    A trace over folded faces runs forward, backward and forward again. The length of the backward
    part is subtracted.

    Parameters
    ----------
    mesh : Mesh
    start : SurfacePoints
        m points, each strictly inside its face.
    end : SurfacePoints
        m points anywhere. A point on an edge or at a vertex is reached in every face that contains
        it.
    normals : (m, 3) float array
        Vectors that the planes contain, besides those from the starts to the ends.
    longest : (m,) float array
        Greatest length of each trace up to the face of its end, in mesh units.
    folded : (F,) bool array, optional
        Whether each face of the mesh is folded back over its neighbours.
    ahead : (m, 3) float array, optional
        Directions in which the traces leave their starts; by default towards the ends. Round the
        edge of a thin part, a trace may have to begin in another direction.
    """
    checkpoint()
    reached, counts, faces, barycentric = nicmm_kernels.trace_between(
        mesh.for_kernels,
        start.for_kernels,
        end.for_kernels,
        np.ascontiguousarray(normals),
        np.ascontiguousarray(longest),
        folded,
        fold_margin(mesh, folded),
        None if ahead is None else np.ascontiguousarray(ahead),
        MOST_FACES,
        checkpoint,
    )
    pair = np.arange(len(counts)).repeat(counts)
    return Traces(reached, pair, SurfacePoints(faces, barycentric))


def fold_margin(mesh: Mesh, folded: BoolArray | None) -> float:
    """Extra length of traces before backward parts over folded faces are subtracted."""
    return 0.0 if folded is None else 4.0 * mesh.mean_edge_length


def trace_from(
    mesh: Mesh,
    start: SurfacePoints,
    direction: FloatArray,
    length: FloatArray,
    folded: BoolArray | None = None,
) -> tuple[SurfacePoints, BoolArray, int]:
    """Move points straight along the surface.

    Over folded faces a trace runs backward, so the length that remains grows there, and the trace
    ends beyond the fold. This does not apply to a point that starts in a folded face.

    A point stays where it is if its trace returns to its first face, or passes more than
    `MOST_FACES` faces.

    Parameters
    ----------
    mesh : Mesh
    start : SurfacePoints
        m points, each strictly inside its face unless its distance is zero.
    direction : (m, 3) float array
        Unit vectors, nearly tangent to the faces.
    length : (m,) float array
        Distances to move, in mesh units; not negative. Where it is zero, the point stays as it is.
    folded : (F,) bool array, optional
        Whether each face of the mesh is folded back over its neighbours.

    Returns
    -------
    SurfacePoints
        The moved points; those that moved are strictly inside their faces.
    (m,) bool array
        Whether each point stopped at a boundary or a non-manifold edge.
    int
        Greatest number of faces that any point passed; it determines the cost of the call.
    """
    checkpoint()
    faces, barycentric, blocked, most_passed = nicmm_kernels.trace_from(
        mesh.for_kernels,
        *start.for_kernels,
        np.ascontiguousarray(direction),
        np.ascontiguousarray(length),
        folded,
        LIMITS,
        checkpoint,
    )
    return SurfacePoints(faces, barycentric), blocked, most_passed


def strictly_inside(barycentric: FloatArray) -> FloatArray:
    """Barycentric coordinates, (n, 3), moved off the sides and corners of their faces.

    Coordinates below `tolerances.INSIDE` are raised to it, up to the scaling to sum 1.
    """
    moved = np.maximum(barycentric, tolerances.INSIDE).T
    return (moved / (moved[0] + moved[1] + moved[2])).T
