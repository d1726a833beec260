"""Nodes of a curve on a surface, with the normals and conormals there."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, NamedTuple

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
"""τ_fea = λ_fea / λ_smooth for lengths in square roots of the surface's area.

It sets the smallest radius with which the curve bends to follow a map: about 1/√600, 4 % of that
length. With the level set's ratio, 30, the curve would be too stiff for typical painted maps.
"""


@dataclass(frozen=True)
class CurveSurface:
    """The surface on which a curve moves.

    Attributes
    ----------
    mesh : Mesh
    vertex_normals : (V, 3) float array
        Unit vectors. Their signs do not matter: each face turns them to its own side.
    feature_map : (V,) float array or None
        φ_fea.
    feature_weight : float
        λ_fea / λ_smooth, in 1/length², where there is a feature map.
    folded : (F,) bool array or None
        Faces that are folded back over others: they point against the normals of their corners.
        None if no face is folded.
    """

    mesh: Mesh
    vertex_normals: FloatArray
    feature_map: FloatArray | None = None
    feature_weight: float = 0.0
    folded: BoolArray | None = None

    @cached_property
    def edge_graph(self) -> sparse.csr_array:
        """Lengths of the edges of the mesh, each stored once."""
        mesh = self.mesh
        length = edge_lengths(mesh.vertices, mesh.edges)
        size = len(mesh.vertices)
        return sparse.csr_array((length, (mesh.edges[:, 0], mesh.edges[:, 1])), shape=(size, size))


def curve_surface(mesh: Mesh) -> CurveSurface:
    """The surface of a mesh, without a feature map."""
    normals, folded = normals_and_folds(mesh)
    return CurveSurface(mesh, normals, folded=folded)


def with_maps(
    surface: CurveSurface, obstacles: FloatArray | None, alignment: FloatArray | None, unit: float
) -> CurveSurface:
    """The surface with φ_fea of obstacles and alignment, (V,) each.

    The unit is the square root of the area of the surface.
    """
    if obstacles is None and alignment is None:
        return surface
    phi_fea = feature_map(surface.mesh, obstacles, alignment, unit)
    return replace(surface, feature_map=phi_fea, feature_weight=FEATURE_TENSION / unit**2)


@dataclass(frozen=True)
class Nodes:
    """Nodes of a curve on a surface, or of several curves, which cost hardly more than one.

    Attributes
    ----------
    places : SurfacePoints
        n points.
    closed : bool
        Whether the last node of a curve joins the first.
    positions : (n, 3) float array
    normals : (n, 3) float array
        Unit vectors.
    phi_fea : (n,) float array
        φ_fea.
    curves : int
        Number c of curves, each with n / c nodes in a row.
    """

    places: SurfacePoints
    closed: bool
    positions: FloatArray
    normals: FloatArray
    phi_fea: FloatArray
    curves: int = 1

    @cached_property
    def steps(self) -> FloatArray:
        """Vectors from each node to the next, zero at the last of an open curve, (n, 3)."""
        steps = self.after_each(self.positions.T) - self.positions.T
        if not self.closed:
            steps[:, self.last] = 0.0
        return steps.T

    @cached_property
    def step_lengths(self) -> FloatArray:
        """Distance from each node to the next, zero at the last of an open curve, (n,)."""
        return lengths(self.steps.T)

    @cached_property
    def lengths(self) -> FloatArray:
        """Lengths of the steps of one curve; (n,), or (n - 1,) of an open curve."""
        return self.step_lengths if self.closed else self.step_lengths[:-1]

    @cached_property
    def ds(self) -> FloatArray:
        """Half the length of both steps at each node, (n,)."""
        lengths = self.step_lengths
        return np.maximum(0.5 * (lengths + self.before_each(lengths)), tolerances.TINY)

    def by_curve(self, values: NDArray[Any]) -> NDArray[Any]:
        """Values at nodes, (n,), by curve, (c, n / c)."""
        return values.reshape(self.curves, -1)

    def spread(self, values: NDArray[Any]) -> NDArray[Any]:
        """Values of the curves, (c,), at their nodes, (n,)."""
        return values.repeat(len(self.positions) // self.curves)

    @cached_property
    def first(self) -> IntArray:
        """The first node of each curve, (c,)."""
        return np.arange(0, len(self.positions), len(self.positions) // self.curves)

    @cached_property
    def last(self) -> IntArray:
        """The last node of each curve, (c,)."""
        return self.first + len(self.positions) // self.curves - 1

    @property
    def following(self) -> IntArray:
        """The index of the next node of each, (n,); the first of the curve after its last."""
        return self.after_each(np.arange(len(self.positions)))

    @property
    def with_step(self) -> IntArray:
        """Nodes with a step to the next one: all but the last of open curves."""
        every = np.arange(len(self.positions))
        return every if self.closed else np.delete(every, self.last)

    def after_each(self, values: NDArray[Any]) -> NDArray[Any]:
        """Values at the next node of the curve, (…, n)."""
        result = np.empty(values.shape, values.dtype)
        result[..., :-1] = values[..., 1:]
        result[..., self.last] = values[..., self.first]
        return result

    def before_each(self, values: NDArray[Any]) -> NDArray[Any]:
        """Values at the previous node of the curve, (…, n)."""
        result = np.empty(values.shape, values.dtype)
        result[..., 1:] = values[..., :-1]
        result[..., self.first] = values[..., self.last]
        return result

    @cached_property
    def conormals(self) -> FloatArray:
        """Unit vectors normal to the curve in the tangent planes, shape (n, 3)."""
        along = self.steps.T / np.maximum(self.step_lengths, tolerances.TINY)
        return unit(cross(self.normals.T, along + self.before_each(along))).T

    @cached_property
    def turns(self) -> Turns:
        """How the curves turn at the nodes."""
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
        """Derivatives of normals, (n, 3), and φ_fea, (n,), by moves along conormals."""
        mesh, faces, conormals = surface.mesh, self.places.faces, self.conormals.T
        a, b, c = corners_of(mesh, faces)
        one, other = b - a, c - a
        # Barycentric coordinates of the move: least squares in the plane of the face.
        p, q, r = dot(one, one), dot(one, other), dot(other, other)
        f, g = dot(one, conormals), dot(other, conormals)
        # At least its rounding error, where two long sides are almost parallel.
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
    """How curves turn at their n nodes.

    Attributes
    ----------
    before : (3, n) float array
        The steps to the nodes.
    out_before, out_after : (n,) float array
        Components of the steps before and after along the normals.
    product : (3, n) float array
        Cross product of both steps.
    sine, cosine : (n,) float array
        Of the angle, times the lengths of both steps in the tangent plane.
    angle : (n,) float array
        In the tangent plane; zero at the ends of open curves.
    """

    before: FloatArray
    out_before: FloatArray
    out_after: FloatArray
    product: FloatArray
    sine: FloatArray
    cosine: FloatArray
    angle: FloatArray


def nodes_at(surface: CurveSurface, places: SurfacePoints, closed: bool, curves: int = 1) -> Nodes:
    """Nodes with the normals and φ_fea that the energy needs."""
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
