"""The curve that a level set describes: one loop through the points, taken out as a polyline."""

from __future__ import annotations

from dataclasses import dataclass

from ..array_types import FloatArray
from ..crossings import crossing_segments
from ..curve import SurfaceCurve
from ..design_result import is_one_curve
from ..mesh import Mesh
from ..surface_points import SurfacePoints
from .contour import extract_curves
from .problem import Problem
from .topology import keep_topology


@dataclass(frozen=True)
class ZeroSet:
    """A level set and its zero set.

    Attributes
    ----------
    field : (n,) float array
        φ, exactly zero at the control points.
    breaking_vertices : int
        Vertices whose sign had to be changed to keep one loop.
    curves : list of SurfaceCurve
    """

    field: FloatArray
    breaking_vertices: int
    curves: list[SurfaceCurve]

    def is_simple_curve(self, mesh: Mesh, closed: bool) -> bool:
        """Whether it is a single simple curve, closed or open, through all control points."""
        if not is_one_curve(self.curves, closed):
            return False
        curve = self.curves[0]
        polyline = SurfacePoints(curve.faces, curve.barycentric)
        return not len(crossing_segments(mesh.faces, polyline, closed))


def zero_set(
    mesh: Mesh, problem: Problem, field: FloatArray, keeps_topology: bool = False
) -> ZeroSet:
    """Make φ exactly zero at the control points and one loop, and take its contour.

    Parameters
    ----------
    mesh : Mesh
        The mesh that the problem was built on.
    problem : Problem
    field : (n,) float array
        φ as a solver leaves it.
    keeps_topology : bool
        Whether the solver has seen to both already.
    """
    breaking = 0
    if not keeps_topology:
        field, breaking = keep_topology(
            problem.working,
            problem.loop,
            problem.initial_distance,
            problem.smoother.interpolating(field),
            problem.bundle,
        )
    controls = problem.loop.control_vertices
    curves = extract_curves(mesh, problem.working, field, controls, problem.bundle)
    return ZeroSet(field, breaking, curves)
