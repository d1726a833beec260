"""The zero set of φ as a polyline on the input mesh: one simple curve through the control points.

The solvers' φ need not have such a zero set, so φ is corrected before the contour is extracted.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..geometry.array_types import FloatArray
from ..geometry.crossings import crossing_segments
from ..geometry.curve import SurfaceCurve, is_one_curve
from ..geometry.mesh import Mesh
from ..geometry.surface_points import SurfacePoints
from ..maps.guidance import length_factor
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


def shortest_by_map(mesh: Mesh, problem: Problem, zeros: ZeroSet) -> ZeroSet:
    """Choose the shortest of three zero sets: a solver's, that of φ₀ and the initial path's.

    Lengths are weighted by the feature map as for the path: less in a lane and more in an obstacle.
    A good zero set is not longer than the path from which it was made. A longer zero set is wrong:
    near sharp edges, where maps are common, it may loop around an end of an open curve or a corner
    of the surface. The zero set of φ₀ may do so too.

    Parameters
    ----------
    mesh : Mesh
        Mesh on which the problem was built.
    problem : Problem
        Problem with a feature map.
    zeros : ZeroSet
        Zero set from a solver.

    Returns
    -------
    ZeroSet
        The shortest of those that are one simple curve, or ``zeros`` if none of them is.
    """
    fields = [problem.initial_distance, problem.distance]
    candidates = [zeros, *(zero_set(mesh, problem, field, True) for field in fields)]
    simple = [one for one in candidates if one.is_simple_curve(mesh, problem.loop.closed)]
    lengths = [_length_by_map(mesh, problem, one.curves[0]) for one in simple]
    return simple[int(np.argmin(lengths))] if simple else zeros


def _length_by_map(mesh: Mesh, problem: Problem, curve: SurfaceCurve) -> float:
    """Length of a curve in mesh units, weighted by the feature map as for the initial path."""
    assert problem.feature_map is not None
    known = problem.working.input_vertex >= 0
    phi_fea = np.ones(len(mesh.vertices))
    phi_fea[problem.working.input_vertex[known]] = problem.feature_map[known]
    factor = length_factor((phi_fea[mesh.faces[curve.faces]] * curve.barycentric).sum(axis=1))
    steps = np.linalg.norm(curve.steps, axis=1)
    mean = 0.5 * (factor + np.roll(factor, -1))
    return float(steps @ mean[: len(steps)])
