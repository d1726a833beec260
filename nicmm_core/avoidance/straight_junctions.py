"""Makes a curve straight next to its junctions with other curves.

Two straight lines through one point do not meet again nearby, so a curve that is straight next to a
junction does not cross the other curve a second time there.
"""

from __future__ import annotations

import numpy as np

from ..geometry.array_types import FloatArray, IntArray
from ..geometry.curve import SurfaceCurve, curve_on_mesh, points_of
from ..geometry.mesh import Mesh
from ..geometry.surface_points import SurfacePoints, joined
from ..geometry.tracing import strictly_inside, trace_between
from ..relaxation.node_traces import DETOUR


def straight_at_junctions(
    mesh: Mesh, curve: SurfaceCurve, junctions: IntArray, reach: FloatArray
) -> SurfaceCurve:
    """Replace the parts of a curve on both sides of some junctions by straight traces.

    Parameters
    ----------
    mesh : Mesh
    curve : SurfaceCurve
    junctions : (j,) int array
        Indices of the control points that are junctions.
    reach : (j,) float array
        Distance from each junction up to which the curve becomes straight. It ends earlier at
        another control point, and where no trace reaches so far.
    """
    for junction, least in zip(junctions.tolist(), reach.tolist(), strict=True):
        for step in (-1, 1):
            curve = _straight_beside(mesh, curve, junction, step, least)
    return curve


def _straight_beside(
    mesh: Mesh, curve: SurfaceCurve, junction: int, step: int, least: float
) -> SurfaceCurve:
    """Replace the part on one side of a junction: before it, with the step -1, or after it."""
    way = _way(curve, junction, step, least)
    for last in range(len(way) - 1, 1, -1):
        trace = _trace(mesh, points_of(curve)[np.array([way[0], way[last]])])
        if trace is not None:
            return _with_trace(mesh, curve, step, way[: last + 1], trace)
    return curve


def _way(curve: SurfaceCurve, junction: int, step: int, least: float) -> list[int]:
    """Points from a junction to the first one beyond a distance, or to the next control point."""
    n, here = len(curve.faces), int(curve.control_index[junction])
    way = [here]
    while curve.closed or 0 <= here + step < n:
        here = (here + step) % n
        if here == way[0]:
            break
        way.append(here)
        away = np.linalg.norm(curve.points[here] - curve.points[way[0]])
        if away >= least or here in curve.control_index:
            break
    return way


def _trace(mesh: Mesh, ends: SurfacePoints) -> SurfacePoints | None:
    """Crossings of the straight trace between two points with edges; None if there is no trace."""
    used = ends.barycentric > 0.0
    if len(mesh.faces_with(np.unique(mesh.faces[ends.faces][used]))):
        return ends[:0]
    start = SurfacePoints(ends.faces[:1], strictly_inside(ends.barycentric[:1]))
    normals = mesh.face_normals[ends.faces].sum(axis=0, keepdims=True)
    away = np.linalg.norm(np.diff(ends.positions(mesh), axis=0), axis=1)
    traces = trace_between(mesh, start, ends[1:], normals, DETOUR * away)
    return traces.crossings if traces.reached[0] else None


def _with_trace(
    mesh: Mesh, curve: SurfaceCurve, step: int, way: list[int], trace: SurfacePoints
) -> SurfaceCurve:
    """The curve with a trace, (m,), in place of the points between the ends of a way."""
    n = len(curve.faces)
    kept = np.setdiff1d(np.arange(n), way[1:-1])
    place = (way[0] + step * np.arange(1, len(trace) + 1) / (len(trace) + 1)) % n
    order = np.argsort(np.concatenate([kept, place]))
    points = joined([points_of(curve)[kept], trace])[order]
    number = np.full(n, -1)
    number[kept] = np.argsort(order)[: len(kept)]
    index = np.where(curve.control_index >= 0, number[curve.control_index], -1)
    return curve_on_mesh(mesh, curve.closed, points.faces, points.barycentric, index)
