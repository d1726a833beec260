"""The curve that a level set describes: one loop through the points, taken out as a polyline."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..geometry.array_types import FloatArray
from ..geometry.crossings import crossing_segments
from ..geometry.curve import SurfaceCurve, is_one_curve
from ..geometry.mesh import Mesh
from ..geometry.surface_points import SurfacePoints
from ..path.leg_search import length_factor
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


def shortest_by_map(mesh: Mesh, problem: Problem, zeros: ZeroSet) -> ZeroSet:
    """The zero set, or that of φ₀ or of the initial path, whichever is shortest by the map.

    Lengths count as they do for the path, less in a lane and more in an obstacle. A level set that
    has found a better way is no longer than the path that it was made from. One that is longer has
    gone astray: near sharp edges, where maps are most of all, it may swing round an end of an open
    curve or round a corner of the surface, and so may φ₀.

    Parameters
    ----------
    mesh : Mesh
        The mesh that the problem was built on.
    problem : Problem
        With a feature map.
    zeros : ZeroSet
    """
    fields = [problem.initial_distance, problem.distance]
    candidates = [zeros, *(zero_set(mesh, problem, field, True) for field in fields)]
    simple = [one for one in candidates if one.is_simple_curve(mesh, problem.loop.closed)]
    lengths = [_length_by_map(mesh, problem, one.curves[0]) for one in simple]
    return simple[int(np.argmin(lengths))] if simple else zeros


def _length_by_map(mesh: Mesh, problem: Problem, curve: SurfaceCurve) -> float:
    """Length of a curve where every part counts as for the initial path, in mesh units."""
    assert problem.feature_map is not None
    known = problem.working.input_vertex >= 0
    phi_fea = np.ones(len(mesh.vertices))
    phi_fea[problem.working.input_vertex[known]] = problem.feature_map[known]
    factor = length_factor((phi_fea[mesh.faces[curve.faces]] * curve.barycentric).sum(axis=1))
    positions = curve.points
    if curve.closed:
        positions, factor = np.concatenate([positions, positions[:1]]), np.append(factor, factor[0])
    steps = np.linalg.norm(np.diff(positions, axis=0), axis=1)
    return float(steps @ (0.5 * (factor[:-1] + factor[1:])))
