"""The zero set of φ as a polyline on the input mesh, and whether it is one simple curve."""

from __future__ import annotations

from ..geometry.array_types import FloatArray
from ..geometry.crossings import crossing_segments
from ..geometry.curve import SurfaceCurve, is_one_curve
from ..geometry.mesh import Mesh
from ..geometry.surface_points import SurfacePoints
from .contour import extract_curves
from .problem import Problem


def zero_set(mesh: Mesh, problem: Problem, field: FloatArray) -> list[SurfaceCurve]:
    """Components of the zero set of φ (n,), on the mesh on which the problem was built."""
    controls = problem.loop.control_vertices
    return extract_curves(mesh, problem.working, field, controls, problem.bundle)


def is_simple_curve(mesh: Mesh, curves: list[SurfaceCurve], closed: bool) -> bool:
    """Whether a zero set is one simple curve, closed or open, through all control points."""
    if not is_one_curve(curves, closed):
        return False
    curve = curves[0]
    polyline = SurfacePoints(curve.faces, curve.barycentric)
    return not len(crossing_segments(mesh.faces, polyline, closed))
