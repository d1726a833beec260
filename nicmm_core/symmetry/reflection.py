"""Mirror images of points and polylines of a mesh, on the same mesh.

The image of a point is the place of the mesh nearest to the reflected position. Where the
triangulation is symmetric too, the image of a polyline crosses the images of the same edges.
Elsewhere consecutive places are joined by straight traces.
"""

from __future__ import annotations

import igl
import numpy as np

from ..geometry.array_types import FloatArray, IntArray
from ..geometry.curve import SurfaceCurve, shared_faces
from ..geometry.mesh import Mesh
from ..geometry.mirror import Plane
from ..geometry.surface_points import SurfacePoints, in_faces, joined, nearest_points
from ..geometry.tracing import fold_margin, strictly_inside, trace_between
from ..relaxation.curve_nodes import CurveSurface, nodes_at
from ..relaxation.node_traces import DETOUR

ON_EDGE = 1e-5
"""Barycentric coordinate below which the image of a point on an edge is on an edge as well.

Coordinates of canonical copies are rounded, so the images of edges are edges only up to that.
"""

OFF_VERTEX = 1e-9
"""Least of the other coordinates of that image, so that images of two edges do not coincide."""


def reflected_places(mesh: Mesh, plane: Plane, points: SurfacePoints) -> SurfacePoints:
    """The places of a mesh nearest to the reflected positions of points on it."""
    return nearest_places(mesh, plane.reflected(points.positions(mesh)), points.barycentric)


def nearest_places(mesh: Mesh, positions: FloatArray, barycentric: FloatArray) -> SurfacePoints:
    """The places of a mesh nearest to the images of points.

    Parameters
    ----------
    mesh : Mesh
    positions : (n, 3) float array
        The images of the points.
    barycentric : (n, 3) float array
        Coordinates of the points themselves. The place of a point inside a face is strictly inside
        a face; that of a point on an edge or at a vertex is on an edge or at a vertex too if it is
        close to one.
    """
    places, _ = nearest_points(mesh, positions)
    weights, zeros = places.barycentric, (barycentric == 0.0).sum(axis=1)[:, None]
    rank = weights.argsort(axis=1).argsort(axis=1)
    on_side = (rank < zeros) & (weights < ON_EDGE)
    weights = np.where(on_side, 0.0, np.maximum(weights, OFF_VERTEX))
    weights /= weights.sum(axis=1, keepdims=True)
    inside = strictly_inside(places.barycentric)
    return SurfacePoints(places.faces, np.where(zeros == 0, inside, weights))


def with_controls(places: SurfacePoints, control: IntArray, points: SurfacePoints) -> SurfacePoints:
    """Places, of which those with the index of a control point are replaced by that point.

    Parameters
    ----------
    places : SurfacePoints
    control : (n,) int array
        Index of the control point of each place; -1 for the others.
    points : SurfacePoints
        Control points.
    """
    faces, barycentric = places.faces.copy(), places.barycentric.copy()
    which = control >= 0
    faces[which] = points.faces[control[which]]
    barycentric[which] = points.barycentric[control[which]]
    return SurfacePoints(faces, barycentric)


def joined_places(
    surface: CurveSurface, places: SurfacePoints, closed: bool
) -> tuple[SurfacePoints, IntArray] | None:
    """Join consecutive places to a polyline, by straight traces where no face contains both.

    Parameters
    ----------
    surface : CurveSurface
    places : SurfacePoints
        The n places.
    closed : bool
        Whether the last place is joined to the first.

    Returns
    -------
    SurfacePoints
        The polyline, each point in the face of the segment after it.
    (n,) int array
        Index of each place in the polyline.

    None if a trace fails.
    """
    mesh = surface.mesh
    faces = shared_faces(mesh, places)
    apart = np.flatnonzero(faces < 0)
    if not closed:
        apart, faces[-1] = apart[apart < len(places) - 1], places.faces[-1]
    joined_by_face = np.where(faces < 0, places.faces, faces)
    here = in_faces(mesh, places, joined_by_face)
    if not len(apart):
        return here, np.arange(len(places))
    following = (apart + 1) % len(places)
    start, end = here[apart], here[following]
    nodes = nodes_at(surface, here, closed)
    one, other = nodes.normals[apart], nodes.normals[following]
    normals = one + np.where((one * other).sum(axis=1) < 0.0, -1.0, 1.0)[:, None] * other
    away = np.linalg.norm(nodes.positions[following] - nodes.positions[apart], axis=1)
    longest = DETOUR * away + fold_margin(mesh, surface.folded)
    inside = SurfacePoints(start.faces, strictly_inside(start.barycentric))
    traces = trace_between(mesh, inside, end, normals, longest, surface.folded)
    if not traces.reached.all():
        return None
    owner = np.concatenate([np.arange(len(places)), apart[traces.pair]])
    order = np.argsort(owner, kind="stable")
    number = np.searchsorted(owner[order], np.arange(len(places)))
    return joined([here, traces.crossings])[order], number


def asymmetry(curve: SurfaceCurve, plane: Plane) -> float:
    """Greatest distance of a curve to its mirror image, in mesh units.

    It is measured at the points of the curve and at the middles of its segments.
    """
    line = curve.points
    start = np.arange(len(curve.steps))
    ends = np.stack([start, (start + 1) % len(line)], axis=1)
    samples = np.concatenate([line, line[start] + 0.5 * curve.steps])
    return _farthest(plane.reflected(samples), line, ends)


def _farthest(samples: FloatArray, line: FloatArray, segments: IntArray) -> float:
    squared = igl.point_mesh_squared_distance(samples, line, segments)[0]
    return float(np.sqrt(np.max(squared)))
