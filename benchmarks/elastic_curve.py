"""Computes a discrete elastic curve on a surface: the reference for how fair a curve could be.

Nodes move along their conormals by Gauss-Newton steps on L ∫ κ_g² ds, are projected to the mesh and
spaced evenly between the control points, which stay fixed. An open curve has no curvature at its
ends. The curve may cross itself, and the iteration converges to a local optimum near its start.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.interpolate import CubicSpline

from nicmm_core.geometry.array_types import FloatArray, IntArray
from nicmm_core.geometry.curve import SurfaceCurve, arc_lengths
from nicmm_core.geometry.geodesic_curvature import geodesic_curvature
from nicmm_core.geometry.mesh import Mesh

from .polylines import NearestPoints

NODES = 240
FEWEST_NODES_OF_A_LEG = 4
REFINEMENT = 8

MOST_STEPS = 100
LEAST_DECREASE = 1e-4
"""Relative decrease of the energy below which the iteration ends."""

LONGEST_MOVE = 1.0
"""Longest move of a node in one step, in node spacings.

The limit keeps the projection on the same sheet of the surface.
"""

DIFFERENCE = 1e-2
"""Displacement of a node, in node spacings, for finite differences."""

FIRST_DAMPING, DAMPING_FACTOR, MOST_DAMPING = 1e-8, 10.0, 1e2
"""Levenberg-Marquardt damping, relative to the greatest diagonal entry.

The first value, which is also the least, is far below 1: the diagonal entries measure the stiffness
against zigzags from node to node, compared with which the stiffness against smooth deformations
of the whole curve is tiny.
"""


@dataclass(frozen=True)
class ElasticCurve:
    """Elastic curve and its energies.

    Attributes
    ----------
    curve : SurfaceCurve
        Curve with `REFINEMENT` times as many points as nodes, all on the surface.
    energies : list of float
        L ∫ κ_g² ds at the nodes, before the first step and after each step; strictly decreasing.
    """

    curve: SurfaceCurve
    energies: list[float]


def elastic_curve(mesh: Mesh, start: SurfaceCurve, nodes: int = NODES) -> ElasticCurve:
    """Minimise the bending of a curve whose control points stay fixed.

    Parameters
    ----------
    mesh : Mesh
        Surface.
    start : SurfaceCurve
        Curve that passes its control points in order; an open one starts and ends at one.
    nodes : int
        Number of nodes, rounded up to a multiple of three.

    Returns
    -------
    ElasticCurve
        The minimiser and its energies.

    Raises
    ------
    ValueError
        If the control points do not follow one another along ``start``.
    """
    return _Iteration(mesh, start, -(-nodes // 3) * 3).solve()


@dataclass(frozen=True)
class _State:
    """Nodes on the surface and the quantities of the energy; n is a multiple of three."""

    points: FloatArray
    normals: FloatArray
    closed: bool

    @property
    def spacing(self) -> FloatArray:
        """Half the total length of the segments that meet at each node, shape (n,)."""
        lengths = np.linalg.norm(_neighbour(self.points, 1, self.closed) - self.points, axis=1)
        before = np.linalg.norm(_neighbour(self.points, -1, self.closed) - self.points, axis=1)
        return 0.5 * (lengths + before)

    @property
    def roots(self) -> FloatArray:
        """κ_g √ds at each node, shape (n,)."""
        return geodesic_curvature(self.points, self.normals, self.closed) * np.sqrt(self.spacing)

    @property
    def energy(self) -> float:
        return float((self.roots**2).sum() * self.spacing.sum())

    @property
    def conormals(self) -> FloatArray:
        """Unit conormals: tangent vectors of the surface that are perpendicular to the curve."""
        along = _neighbour(self.points, 1, self.closed) - _neighbour(self.points, -1, self.closed)
        across = np.cross(self.normals, along)
        return across / np.linalg.norm(across, axis=1, keepdims=True)


def _neighbour(points: FloatArray, step: int, closed: bool) -> FloatArray:
    """Next (step 1) or previous (step -1) node of each node; an end is its own neighbour."""
    moved = np.roll(points, -step, axis=0)
    if not closed:
        end = -1 if step == 1 else 0
        moved[end] = points[end]
    return moved


class _Iteration:
    def __init__(self, mesh: Mesh, start: SurfaceCurve, nodes: int) -> None:
        self.surface = NearestPoints(mesh)
        self.closed = bool(start.closed)
        legs = _legs(start)
        self.counts = _nodes_of_legs(legs, nodes if self.closed else nodes - 1)
        before = np.concatenate([[0], np.cumsum(self.counts)])
        self.controls = before[:-1] if self.closed else before
        self.free = np.setdiff1d(np.arange(nodes), self.controls)
        self.fixed = start.points[start.control_index]
        self.state = self.projected(self.respaced(legs))

    def solve(self) -> ElasticCurve:
        energies = [self.state.energy]
        damping = FIRST_DAMPING
        for _ in range(MOST_STEPS):
            matrix, slope = self.normal_equations()
            while damping <= MOST_DAMPING:
                candidate = self.moved(matrix, slope, damping)
                if candidate.energy < energies[-1]:
                    break
                damping *= DAMPING_FACTOR
            else:
                break  # no step lowers the energy any further
            self.state = candidate
            energies.append(candidate.energy)
            damping = max(damping / DAMPING_FACTOR, FIRST_DAMPING)
            if energies[-1] > (1.0 - LEAST_DECREASE) * energies[-2]:
                break
        return ElasticCurve(self.refined(), energies)

    def refined(self) -> SurfaceCurve:
        """Cubic spline through the nodes, projected to the mesh.

        The polygon of the nodes would not do: curvature is sampled at other points, and there
        its corners would distort the result.
        """
        line = self.line(self.state.points)
        arc = arc_lengths(np.diff(line, axis=0))
        spline = CubicSpline(arc, line, bc_type="periodic" if self.closed else "natural")
        count = REFINEMENT * (len(line) - 1) + (not self.closed)
        fine = np.interp(np.arange(count) / REFINEMENT, range(len(arc)), arc)
        return self.surface.curve(spline(fine), REFINEMENT * self.controls, self.closed)

    def line(self, points: FloatArray) -> FloatArray:
        """Points with the first one repeated at the end if the curve is closed."""
        return np.concatenate([points, points[:1]]) if self.closed else points

    def respaced(self, legs: list[FloatArray]) -> FloatArray:
        """Nodes that are evenly spaced on each leg."""
        nodes = _respaced(legs, self.counts)
        return nodes if self.closed else np.concatenate([nodes, legs[-1][-1:]])

    def projected(self, points: FloatArray) -> _State:
        """State with all nodes projected to the surface and the control points kept fixed."""
        points = points.copy()
        points[self.controls] = self.fixed
        _, faces, barycentric = self.surface.project(points)
        on_surface = self.surface.curve(points, self.controls).points
        return _State(on_surface, self.surface.normals(faces, barycentric), self.closed)

    def normal_equations(self) -> tuple[FloatArray, FloatArray]:
        """Gauss-Newton matrix and gradient for moves of the free nodes along their conormals.

        Derivatives are finite differences of the projected curve, so they include the curvature
        of the surface. A node affects only its own residual and those of its two neighbours, so
        every third node is displaced at the same time.
        """
        state, n = self.state, len(self.state.points)
        step = DIFFERENCE * state.spacing.mean()
        length, roots, spacing = state.spacing.sum(), state.roots, state.spacing
        jacobian = np.zeros((n, n))
        length_slope = np.zeros(n)
        rows = np.arange(n)
        for first in range(3):
            moved = state.points.copy()
            moved[first::3] += step * state.conormals[first::3]
            _, faces, barycentric = self.surface.project(moved)
            corners = self.surface.mesh.vertices[self.surface.mesh.faces[faces]]
            changed = _State(
                (barycentric[:, :, None] * corners).sum(axis=1),
                self.surface.normals(faces, barycentric),
                self.closed,
            )
            # The displaced node among a node and its two neighbours. An end has only one
            # neighbour: the wrapped index refers to a control point, whose column is dropped.
            cause = (rows + (first - rows + 1) % 3 - 1) % n
            jacobian[rows, cause] = (changed.roots - roots) / step
            np.add.at(length_slope, cause, (changed.spacing - spacing) / step)
        jacobian = np.sqrt(length) * (jacobian + np.outer(roots, length_slope) / (2.0 * length))
        jacobian = jacobian[:, self.free]
        return jacobian.T @ jacobian, jacobian.T @ (np.sqrt(length) * roots)

    def moved(self, matrix: FloatArray, slope: FloatArray, damping: float) -> _State:
        """State after a damped step of limited length, projected and respaced."""
        diagonal = damping * matrix.diagonal().max() * np.eye(len(matrix))
        step = -np.linalg.solve(matrix + diagonal, slope)
        limit = LONGEST_MOVE * self.state.spacing.mean()
        step *= min(1.0, limit / max(np.abs(step).max(), 1e-300))
        points = self.state.points.copy()
        points[self.free] += step[:, None] * self.state.conormals[self.free]
        points = self.projected(points).points
        line = self.line(points)
        bounds = np.concatenate([[0], np.cumsum(self.counts)])
        legs = [line[a : b + 1] for a, b in zip(bounds[:-1], bounds[1:], strict=True)]
        return self.projected(self.respaced(legs))


def _legs(curve: SurfaceCurve) -> list[FloatArray]:
    """Polylines between consecutive control points, both ends included."""
    first, n = curve.control_index[0], len(curve.points)
    if curve.closed:
        bounds = [*((curve.control_index - first) % n), n]
        line = np.roll(curve.points, -first, axis=0)
        line = np.concatenate([line, line[:1]])
    else:
        bounds, line = [*curve.control_index], curve.points
    if any(b <= a for a, b in zip(bounds[:-1], bounds[1:], strict=True)):
        raise ValueError("the control points do not follow one another along the curve")
    return [line[a : b + 1] for a, b in zip(bounds[:-1], bounds[1:], strict=True)]


def _nodes_of_legs(legs: list[FloatArray], nodes: int) -> IntArray:
    """Number of nodes per leg, by its length; the last point of a leg belongs to the next one."""
    lengths = np.array([np.linalg.norm(np.diff(leg, axis=0), axis=1).sum() for leg in legs])
    counts = np.maximum(FEWEST_NODES_OF_A_LEG, np.round(nodes * lengths / lengths.sum()))
    counts[lengths.argmax()] += nodes - counts.sum()
    return counts.astype(np.int64)


def _respaced(legs: list[FloatArray], counts: IntArray) -> FloatArray:
    """Nodes that are evenly spaced on each leg, without the last point of the leg."""
    nodes = []
    for leg, count in zip(legs, counts, strict=True):
        arc = arc_lengths(np.diff(leg, axis=0))
        wanted = np.arange(count) * arc[-1] / count
        nodes.append(np.stack([np.interp(wanted, arc, leg[:, axis]) for axis in range(3)], axis=1))
    return np.concatenate(nodes)
