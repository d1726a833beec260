"""A discrete elastic curve on a surface: the yardstick of how fair a curve could be.

Nodes move along their conormals by Gauss-Newton steps on L ∫ κ_g² ds, are projected
to the mesh and respaced between the control points, which stay where they are. An open curve has
no curvature at its ends. Nothing keeps the curve from crossing itself, and what it finds is a local
optimum near its start.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.interpolate import CubicSpline

from nicmm_core.geometry.array_types import FloatArray, IntArray
from nicmm_core.geometry.curve import SurfaceCurve, geodesic_curvature
from nicmm_core.geometry.mesh import Mesh

from .polylines import NearestPoints

NODES = 240
FEWEST_NODES_OF_A_LEG = 4
REFINEMENT = 8

MOST_STEPS = 100
LEAST_DECREASE = 1e-4
"""Relative decrease of the energy that ends the iteration."""

LONGEST_MOVE = 1.0
"""Farthest that a node moves in one step, in spacings: projection then stays on its sheet."""

DIFFERENCE = 1e-2
"""Of a node's position, in spacings, for the derivatives."""

FIRST_DAMPING, DAMPING_FACTOR, MOST_DAMPING = 1e-8, 10.0, 1e2
"""Of Levenberg and Marquardt, relative to the greatest diagonal entry.

The least is far below 1 because the entries measure the stiffness of zigzags from node to node,
against which a slow swing of the whole curve has almost none.
"""


@dataclass(frozen=True)
class ElasticCurve:
    """Result of the iteration.

    Attributes
    ----------
    curve : SurfaceCurve
        Its points are on the surface, `REFINEMENT` times as many as nodes.
    energies : list of float
        L ∫ κ_g² ds at the nodes, before the first step and after each; they only fall.
    """

    curve: SurfaceCurve
    energies: list[float]


def elastic_curve(mesh: Mesh, start: SurfaceCurve, nodes: int = NODES) -> ElasticCurve:
    """Make a curve as fair as it can be through the control points of its start.

    Parameters
    ----------
    mesh : Mesh
    start : SurfaceCurve
        Through all of its control points, with one at each end where it is open.
    nodes : int
        Rounded up to a multiple of three.

    Returns
    -------
    ElasticCurve
    """
    return _Iteration(mesh, start, -(-nodes // 3) * 3).solve()


@dataclass(frozen=True)
class _State:
    """Nodes on the surface with what the energy needs of them; n is a multiple of three."""

    points: FloatArray
    normals: FloatArray
    closed: bool

    @property
    def spacing(self) -> FloatArray:
        """Half the length of the two segments at each node, of the one at an end, shape (n,)."""
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
        """Unit vectors in the tangent planes, across the curve."""
        along = _neighbour(self.points, 1, self.closed) - _neighbour(self.points, -1, self.closed)
        across = np.cross(self.normals, along)
        return across / np.linalg.norm(across, axis=1, keepdims=True)


def _neighbour(points: FloatArray, step: int, closed: bool) -> FloatArray:
    """The next node of each (step 1) or the one before (-1); an end is its own."""
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
                break  # No step lowers the energy any more.
            self.state = candidate
            energies.append(candidate.energy)
            damping = max(damping / DAMPING_FACTOR, FIRST_DAMPING)
            if energies[-1] > (1.0 - LEAST_DECREASE) * energies[-2]:
                break
        return ElasticCurve(self.refined(), energies)

    def refined(self) -> SurfaceCurve:
        """A cubic spline through the nodes, projected to the mesh.

        Chords between nodes have corners wherever curvature is sampled at other places.
        """
        line = self.line(self.state.points)
        arc = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(line, axis=0), axis=1))])
        spline = CubicSpline(arc, line, bc_type="periodic" if self.closed else "natural")
        count = REFINEMENT * (len(line) - 1) + (not self.closed)
        fine = np.interp(np.arange(count) / REFINEMENT, range(len(arc)), arc)
        return self.surface.curve(spline(fine), REFINEMENT * self.controls, self.closed)

    def line(self, points: FloatArray) -> FloatArray:
        """Points from the first control point to the last, which is the first again if closed."""
        return np.concatenate([points, points[:1]]) if self.closed else points

    def respaced(self, legs: list[FloatArray]) -> FloatArray:
        """Evenly spaced nodes on each leg."""
        nodes = _respaced(legs, self.counts)
        return nodes if self.closed else np.concatenate([nodes, legs[-1][-1:]])

    def projected(self, points: FloatArray) -> _State:
        """Nodes moved to the surface, and the control points exactly to their places."""
        points = points.copy()
        points[self.controls] = self.fixed
        _, faces, barycentric = self.surface.project(points)
        on_surface = self.surface.curve(points, self.controls).points
        return _State(on_surface, self.surface.normals(faces, barycentric), self.closed)

    def normal_equations(self) -> tuple[FloatArray, FloatArray]:
        """Gauss-Newton matrix and slope of the energy for moves of free nodes along the conormals.

        Derivatives are differences of the projected curve, so they know how the surface bends.
        A node acts on itself and its two neighbours only; every third one is moved at a time.
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
            # The moved one among a node and its two neighbours. An end has one neighbour only:
            # what it is given for the other falls on a control point, and these do not move.
            cause = (rows + (first - rows + 1) % 3 - 1) % n
            jacobian[rows, cause] = (changed.roots - roots) / step
            np.add.at(length_slope, cause, (changed.spacing - spacing) / step)
        jacobian = np.sqrt(length) * (jacobian + np.outer(roots, length_slope) / (2.0 * length))
        jacobian = jacobian[:, self.free]
        return jacobian.T @ jacobian, jacobian.T @ (np.sqrt(length) * roots)

    def moved(self, matrix: FloatArray, slope: FloatArray, damping: float) -> _State:
        """The state after a damped step of limited length, projected and respaced."""
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
    """Nodes of each leg, its first control point included and not its last, by its length."""
    lengths = np.array([np.linalg.norm(np.diff(leg, axis=0), axis=1).sum() for leg in legs])
    counts = np.maximum(FEWEST_NODES_OF_A_LEG, np.round(nodes * lengths / lengths.sum()))
    counts[lengths.argmax()] += nodes - counts.sum()
    return counts.astype(np.int64)


def _respaced(legs: list[FloatArray], counts: IntArray) -> FloatArray:
    """Evenly spaced nodes on each leg."""
    nodes = []
    for leg, count in zip(legs, counts, strict=True):
        arc = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(leg, axis=0), axis=1))])
        wanted = np.arange(count) * arc[-1] / count
        nodes.append(np.stack([np.interp(wanted, arc, leg[:, axis]) for axis in range(3)], axis=1))
    return np.concatenate(nodes)
