"""The zero set of φ as a polyline on the input mesh: one simple curve through the control points.

The solvers' φ need not have such a zero set, so φ is corrected before the contour is extracted.
"""

from __future__ import annotations

from dataclasses import dataclass

from ..geometry.array_types import FloatArray
from ..geometry.crossings import crossing_segments
from ..geometry.curve import SurfaceCurve, is_one_curve
from ..geometry.mesh import Mesh
from ..geometry.surface_points import SurfacePoints
from .contour import extract_curves
from .problem import Problem
from .topology import keep_topology


@dataclass(frozen=True)
class ZeroSet:
    """A level-set function φ and its zero set.

    Attributes
    ----------
    field : (n,) float array
        φ, exactly zero at the control points.
    breaking_vertices : int
        Number of vertices at which the sign given by the solver would break the topology.
    curves : list of SurfaceCurve
        Components of the zero set.
    """

    field: FloatArray
    breaking_vertices: int
    curves: list[SurfaceCurve]

    def is_simple_curve(self, mesh: Mesh, closed: bool) -> bool:
        """Whether the zero set is one simple curve, closed or open, through all control points."""
        if not is_one_curve(self.curves, closed):
            return False
        curve = self.curves[0]
        polyline = SurfacePoints(curve.faces, curve.barycentric)
        return not len(crossing_segments(mesh.faces, polyline, closed))


def zero_set(
    mesh: Mesh, problem: Problem, field: FloatArray, keeps_topology: bool = False
) -> ZeroSet:
    """Make φ zero at the control points and its zero set one curve, then extract the contour.

    Parameters
    ----------
    mesh : Mesh
        Mesh on which the problem was built.
    problem : Problem
    field : (n,) float array
        φ from a solver.
    keeps_topology : bool
        Whether the solver has already ensured both properties. Then φ is not changed.

    Returns
    -------
    ZeroSet
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
