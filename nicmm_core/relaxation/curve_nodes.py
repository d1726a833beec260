"""Represents curves on a surface by nodes, with the normals, conormals and φ_fea there."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, NamedTuple

import nicmm_kernels
import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from ..geometry import tolerances
from ..geometry.array_types import BoolArray, FloatArray, IntArray
from ..geometry.mesh import Mesh, edge_lengths
from ..geometry.normals import normals_and_folds
from ..geometry.surface_points import SurfacePoints, at_corners, corners_of, interpolated
from ..geometry.vectors import cross, dot, lengths, unit
from ..maps.guidance import feature_map

FEATURE_TENSION = 600.0
"""The part of τ_fea that scales with the surface, times its area.

It determines the smallest radius to which the curve bends to follow a map: about 1/√600, 4 % of
the square root of the area. With 30, the ratio λ_fea / λ_smooth of the level set, the curve would
be too stiff for typical painted maps.
"""


@dataclass(frozen=True)
class CurveSurface:
    """The surface on which a curve moves.

    Attributes
    ----------
    mesh : Mesh
    vertex_normals : (V, 3) float array
        Unit vectors. Their signs are arbitrary: at each face they are turned to its side.
    feature_map : (V,) float array or None
        φ_fea.
    feature_weight : float
        `FEATURE_TENSION` over the area, in 1/length², where there is a feature map.
    folded : (F,) bool array or None
        Which faces are folded back over others, so that they point against the normals of their
        corners. None if no face is folded.
    """

    mesh: Mesh
    vertex_normals: FloatArray
    feature_map: FloatArray | None = None
    feature_weight: float = 0.0
    folded: BoolArray | None = None

    @cached_property
    def for_kernels(self) -> nicmm_kernels.SurfaceArrays:
        """The surface as compiled kernels read it."""
        feature_map = self.feature_map
        return nicmm_kernels.SurfaceArrays(
            self.mesh.for_kernels,
            np.ascontiguousarray(self.vertex_normals),
            self.folded,
            None if feature_map is None else np.ascontiguousarray(feature_map),
            self.feature_weight,
        )

    @cached_property
    def edge_graph(self) -> sparse.csr_array:
        """Sparse matrix of edge lengths, (V, V); each edge is stored once."""
        mesh = self.mesh
        length = edge_lengths(mesh.vertices, mesh.edges)
        size = len(mesh.vertices)
        return sparse.csr_array((length, (mesh.edges[:, 0], mesh.edges[:, 1])), shape=(size, size))


def curve_surface(mesh: Mesh) -> CurveSurface:
    """Prepare a mesh as the surface of curves, without a feature map."""
    normals, folded = normals_and_folds(mesh)
    return CurveSurface(mesh, normals, folded=folded)


def with_maps(
    surface: CurveSurface, obstacles: FloatArray | None, alignment: FloatArray | None, unit: float
) -> CurveSurface:
    """The surface with φ_fea computed from weights of obstacles and alignment, (V,) each.

    The unit of lengths, `unit`, is the square root of the area of the component.
    """
    if obstacles is None and alignment is None:
        return surface
    phi_fea = feature_map(surface.mesh, obstacles, alignment, unit)
    return replace(surface, feature_map=phi_fea, feature_weight=FEATURE_TENSION / unit**2)


@dataclass(frozen=True)
class Nodes:
    """Nodes of one or more curves on a surface; several curves cost hardly more than one.

    Attributes
    ----------
    places : SurfacePoints
        The n nodes as points of the mesh.
    closed : bool
        Whether the last node of each curve is joined to its first.
    positions : (n, 3) float array
    normals : (n, 3) float array
        Unit normals of the surface at the nodes.
    phi_fea : (n,) float array
        φ_fea at the nodes.
    curves : int
        Number c of curves, each with n / c consecutive nodes.
    """

    places: SurfacePoints
    closed: bool
    positions: FloatArray
    normals: FloatArray
    phi_fea: FloatArray
    curves: int = 1

    @cached_property
    def per_curve(self) -> int:
        """Number of nodes of each curve."""
        return len(self.positions) // self.curves

    @cached_property
    def steps(self) -> FloatArray:
        """Vectors from each node to the next, (n, 3); zero at the last node of an open curve."""
        steps = self.after_each(self.positions.T) - self.positions.T
        if not self.closed:
            steps[:, self.last] = 0.0
        return steps.T

    @cached_property
    def step_lengths(self) -> FloatArray:
        """Distances from each node to the next, (n,); zero at the last node of an open curve."""
        return lengths(self.steps.T)

    @cached_property
    def lengths(self) -> FloatArray:
        """Lengths of the steps of a single curve: (n,) if it is closed, (n - 1,) if it is open."""
        return self.step_lengths if self.closed else self.step_lengths[:-1]

    @cached_property
    def ds(self) -> FloatArray:
        """Arc length that belongs to each node, half the sum of its two steps, (n,)."""
        lengths = self.step_lengths
        return np.maximum(0.5 * (lengths + self.before_each(lengths)), tolerances.TINY)

    def by_curve(self, values: NDArray[Any]) -> NDArray[Any]:
        """Values at nodes, (n,), as one row per curve, (c, n / c)."""
        return values.reshape(self.curves, -1)

    def spread(self, values: NDArray[Any]) -> NDArray[Any]:
        """Values of the curves, (c,), repeated for their nodes, (n,)."""
        return values.repeat(self.per_curve)

    @cached_property
    def first(self) -> IntArray:
        """Index of the first node of each curve, (c,)."""
        return np.arange(0, len(self.positions), self.per_curve)

    @cached_property
    def last(self) -> IntArray:
        """Index of the last node of each curve, (c,)."""
        return self.first + self.per_curve - 1

    @property
    def following(self) -> IntArray:
        """Index of the node after each node, (n,); the last node is followed by the first."""
        return self.after_each(np.arange(len(self.positions)))

    @property
    def with_step(self) -> IntArray:
        """Indices of the nodes with a step to the next node: all but the last of open curves."""
        every = np.arange(len(self.positions))
        return every if self.closed else np.delete(every, self.last)

    def after_each(self, values: NDArray[Any]) -> NDArray[Any]:
        """Values at nodes, (…, n), shifted so that each node has the value of the next node."""
        result = np.empty(values.shape, values.dtype)
        result[..., :-1] = values[..., 1:]
        result[..., self.last] = values[..., self.first]
        return result

    def before_each(self, values: NDArray[Any]) -> NDArray[Any]:
        """Values at nodes, (…, n), shifted so that each node has the value of the previous node."""
        result = np.empty(values.shape, values.dtype)
        result[..., 1:] = values[..., :-1]
        result[..., self.first] = values[..., self.last]
        return result

    @cached_property
    def conormals(self) -> FloatArray:
        """Unit vectors in the tangent planes, normal to the curve, shape (n, 3)."""
        along = self.steps.T / np.maximum(self.step_lengths, tolerances.TINY)
        return unit(cross(self.normals.T, along + self.before_each(along))).T

    @cached_property
    def turns(self) -> Turns:
        """Turning of the curves at the nodes."""
        after, normal = self.steps.T, self.normals.T
        before = self.before_each(after)
        out_before, out_after = dot(before, normal), dot(after, normal)
        product = cross(before, after)
        sine, cosine = dot(product, normal), dot(before, after) - out_before * out_after
        angle = np.arctan2(sine, cosine)
        if not self.closed:
            angle[self.first] = angle[self.last] = 0.0
        return Turns(before, out_before, out_after, product, sine, cosine, angle)

    def conormal_derivatives(self, surface: CurveSurface) -> tuple[FloatArray, FloatArray]:
        """Derivatives of the normals, (n, 3), and of φ_fea, (n,), by moves along conormals."""
        mesh, faces, conormals = surface.mesh, self.places.faces, self.conormals.T
        a, b, c = corners_of(mesh, faces)
        one, other = b - a, c - a
        # Barycentric coordinates of the move: least squares in the plane of the face.
        p, q, r = dot(one, one), dot(one, other), dot(other, other)
        f, g = dot(one, conormals), dot(other, conormals)
        # Not below its rounding error, where two long sides are almost parallel.
        determinant = np.maximum(p * r - q * q, np.finfo(float).eps * p * r)
        determinant = np.maximum(determinant, tolerances.TINY)
        u, v = (r * f - q * g) / determinant, (p * g - q * f) / determinant
        change = np.array([-u - v, u, v])
        normals, corner_normals = self.normals.T, _corner_normals(surface, faces)
        length = dot(interpolated(corner_normals, self.places.barycentric.T), normals)
        turn = interpolated(corner_normals, change) / np.maximum(length, tolerances.TINY)
        turn -= dot(turn, normals) * normals
        drift = np.zeros(len(faces))
        if surface.feature_map is not None:
            drift = dot(change, surface.feature_map[mesh.faces[faces]].T)
        return turn.T, drift


class Turns(NamedTuple):
    """Turning of curves at their n nodes.

    Attributes
    ----------
    before : (3, n) float array
        The step to each node.
    out_before, out_after : (n,) float array
        Components along the normal of the steps before and after each node.
    product : (3, n) float array
        Cross product of both steps.
    sine, cosine : (n,) float array
        Sine and cosine of the angle, times the lengths of both steps in the tangent plane.
    angle : (n,) float array
        Turning angle in the tangent plane, in radians; zero at the ends of open curves.
    """

    before: FloatArray
    out_before: FloatArray
    out_after: FloatArray
    product: FloatArray
    sine: FloatArray
    cosine: FloatArray
    angle: FloatArray


def nodes_at(surface: CurveSurface, places: SurfacePoints, closed: bool, curves: int = 1) -> Nodes:
    """Create nodes at given places, with the normals and φ_fea that the energy needs."""
    weight = places.barycentric.T
    normals = unit(interpolated(_corner_normals(surface, places.faces), weight)).T
    phi_fea = np.ones(len(places))
    if surface.feature_map is not None:
        phi_fea = dot(weight, surface.feature_map[surface.mesh.faces[places.faces]].T)
    return Nodes(places, closed, places.positions(surface.mesh), normals, phi_fea, curves)


def _corner_normals(surface: CurveSurface, faces: IntArray) -> FloatArray:
    """Vertex normals at the corners, turned to the side of each face, shape (3, 3, n)."""
    normals = at_corners(surface.mesh, faces, surface.vertex_normals)
    of_faces = surface.mesh.face_normals.take(faces, axis=0).T.copy()
    against = dot(normals.swapaxes(0, 1), of_faces[:, None]) < 0.0
    return np.where(against[:, None], -normals, normals) if against.any() else normals
