"""Represents curves on a surface by nodes, with the normals, conormals and φ_fea there."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import nicmm_kernels
import numpy as np
from numpy.typing import NDArray

from ..geometry import tolerances
from ..geometry.array_types import BoolArray, FloatArray, IntArray
from ..geometry.mesh import Mesh
from ..geometry.normals import folds, normals_and_folds
from ..geometry.surface_points import SurfacePoints
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
    normal_bending : float
        Weight of κ_n² in the bending energy, relative to κ_g².
    """

    mesh: Mesh
    vertex_normals: FloatArray
    feature_map: FloatArray | None = None
    feature_weight: float = 0.0
    folded: BoolArray | None = None
    normal_bending: float = 0.0

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
            self.normal_bending,
        )


def curve_surface(mesh: Mesh, vertex_normals: FloatArray | None = None) -> CurveSurface:
    """Prepare a mesh as the surface of curves, without a feature map.

    Normals at its vertices, (V, 3), may be given.
    """
    if vertex_normals is not None:
        return CurveSurface(mesh, vertex_normals, folded=folds(mesh, vertex_normals))
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
    corners : (n,) bool array or None
        Control points at which the curve may turn freely; None without any.
    """

    places: SurfacePoints
    closed: bool
    positions: FloatArray
    normals: FloatArray
    phi_fea: FloatArray
    curves: int = 1
    corners: BoolArray | None = None

    @cached_property
    def per_curve(self) -> int:
        """Number of nodes of each curve."""
        return len(self.positions) // self.curves

    @cached_property
    def for_kernels(self) -> nicmm_kernels.NodeArrays:
        """The nodes as compiled kernels read them, with what they compute from the positions."""
        return nicmm_kernels.NodeArrays(
            *self.places.for_kernels,
            np.ascontiguousarray(self.positions),
            np.ascontiguousarray(self.normals),
            np.ascontiguousarray(self.phi_fea),
            self.closed,
            self.curves,
            self.corners,
        )

    @property
    def steps(self) -> FloatArray:
        """Vectors from each node to the next, (n, 3); zero at the last node of an open curve."""
        return self.for_kernels.steps

    @property
    def step_lengths(self) -> FloatArray:
        """Distances from each node to the next, (n,); zero at the last node of an open curve."""
        return self.for_kernels.step_lengths

    @property
    def conormals(self) -> FloatArray:
        """Unit vectors in the tangent planes, normal to the curve, shape (n, 3)."""
        return self.for_kernels.conormals

    @property
    def angles(self) -> FloatArray:
        """Turning in the tangent planes, in radians, (n,); zero at open ends and at corners."""
        return self.for_kernels.angles

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


def nodes_at(
    surface: CurveSurface,
    places: SurfacePoints,
    closed: bool,
    curves: int = 1,
    corners: BoolArray | None = None,
) -> Nodes:
    """Create nodes at given places, with the normals and φ_fea that the energy needs."""
    positions, normals, phi_fea = nicmm_kernels.place_nodes(
        surface.for_kernels, *places.for_kernels
    )
    return Nodes(places, closed, positions, normals, phi_fea, curves, corners)


def nodes_among(nodes: Nodes, which: IntArray) -> Nodes:
    """Curves through some of the nodes, whose indices have a row for each curve, (c, n)."""
    among = which.ravel()
    return replace(
        nodes,
        places=nodes.places[among],
        positions=nodes.positions.take(among, axis=0),
        normals=nodes.normals.take(among, axis=0),
        phi_fea=nodes.phi_fea.take(among),
        curves=len(which),
        corners=None if nodes.corners is None else nodes.corners[among],
    )
