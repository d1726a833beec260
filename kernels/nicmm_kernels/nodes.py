# SPDX-License-Identifier: GPL-3.0-or-later
"""Surfaces, and the nodes of curves on them."""

from __future__ import annotations

import ctypes
from typing import Any

import numpy as np

from .library import (
    BOOL,
    COUNT,
    FLOAT,
    INT,
    NUMBER,
    POINTER,
    BoolArray,
    FloatArray,
    IntArray,
    Kernel,
    KernelError,
    address,
    first_fixed,
    optional_address,
    rows,
    rows_of_curves,
)
from .traces import MeshArrays, MeshPointers


class SurfacePointers(ctypes.Structure):
    """`SurfaceArrays` as the library reads them."""

    _fields_ = [
        ("mesh", MeshPointers),
        ("vertex_normals", POINTER),
        ("folded", POINTER),
        ("feature_map", POINTER),
        ("feature_weight", NUMBER),
        ("normal_bending", NUMBER),
    ]


class SurfaceArrays:
    """The arrays of a surface, checked once for all calls. They must not change afterwards.

    Parameters
    ----------
    mesh : MeshArrays
    vertex_normals : (V, 3) float array
        Unit vectors of arbitrary sign.
    folded : (F,) bool array or None
        Faces that are folded back over others.
    feature_map : (V,) float array or None
        φ_fea.
    feature_weight : float
        Factor of the map, in 1/length².
    normal_bending : float
        Weight of the normal curvature, squared, in the bending energy.
    """

    def __init__(
        self,
        mesh: MeshArrays,
        vertex_normals: FloatArray,
        folded: BoolArray | None,
        feature_map: FloatArray | None,
        feature_weight: float,
        normal_bending: float,
    ) -> None:
        self.mesh = mesh
        self._given = (
            mesh, vertex_normals, folded, feature_map, feature_weight, normal_bending
        )  # fmt: skip
        self.pointers = SurfacePointers(
            mesh.pointers,
            address("vertex_normals", vertex_normals, FLOAT, mesh.vertex_count, 3),
            optional_address("folded", folded, BOOL, mesh.face_count),
            optional_address("feature_map", feature_map, FLOAT, mesh.vertex_count),
            feature_weight,
            normal_bending,
        )

    def __reduce__(self) -> tuple[Any, ...]:
        """Copies have pointers of their own."""
        return SurfaceArrays, self._given


class NodePointers(ctypes.Structure):
    """`NodeArrays` as the library reads them."""

    _fields_ = [
        ("n", COUNT),
        ("closed", COUNT),
        ("faces", POINTER),
        ("barycentric", POINTER),
        ("positions", POINTER),
        ("normals", POINTER),
        ("phi_fea", POINTER),
        ("steps", POINTER),
        ("step_lengths", POINTER),
        ("conormals", POINTER),
        ("angles", POINTER),
        ("is_corner", POINTER),
    ]


_PLACE_NODES = Kernel("place_nodes", SurfacePointers, NodePointers)
_MEASURE_CURVES = Kernel("measure_curves", NodePointers, COUNT)


def place_nodes(
    surface: SurfaceArrays, faces: IntArray, barycentric: FloatArray
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Positions, (n, 3), unit normals, (n, 3), and φ_fea, (n,), at n points of a surface.

    Parameters
    ----------
    surface : SurfaceArrays
    faces : (n,) int array
        Faces of the points.
    barycentric : (n, 3) float array
        Coordinates in them.
    """
    n = rows("faces", faces)
    positions, normals, phi_fea = np.empty((n, 3)), np.empty((n, 3)), np.empty(n)
    pointers = NodePointers(
        n, 0, address("faces", faces, INT, n), address("barycentric", barycentric, FLOAT, n, 3),
        positions.ctypes.data, normals.ctypes.data, phi_fea.ctypes.data,
    )  # fmt: skip
    _PLACE_NODES(surface.pointers, pointers)
    return positions, normals, phi_fea


class NodeArrays:
    """The nodes of c curves, checked once for all calls. They must not change afterwards.

    Parameters
    ----------
    faces : (n,) int array
        Faces of the nodes.
    barycentric : (n, 3) float array
        Coordinates in them.
    positions, normals : (n, 3) float array
        Positions of the nodes and unit normals of the surface there.
    phi_fea : (n,) float array
        φ_fea there.
    closed : bool
        Whether the last node of each curve is joined to its first.
    curves : int
        Number c of curves, each with n / c consecutive nodes.
    corners : (n,) bool array or None
        Nodes at which the curve may turn freely.

    Attributes
    ----------
    steps : (n, 3) float array
        Vectors from each node to the next; zero at the last node of an open curve.
    step_lengths : (n,) float array
        Their lengths.
    conormals : (n, 3) float array
        Unit vectors in the tangent planes, normal to the curve.
    angles : (n,) float array
        Turning angles in the tangent planes, in radians; zero at the ends of open curves and at
        corners.
    """

    def __init__(
        self,
        faces: IntArray,
        barycentric: FloatArray,
        positions: FloatArray,
        normals: FloatArray,
        phi_fea: FloatArray,
        closed: bool,
        curves: int = 1,
        corners: BoolArray | None = None,
    ) -> None:
        n = rows("faces", faces)
        if curves < 1 or n % curves:
            raise KernelError(f"curves is {curves}; pass a divisor of the number of nodes, {n}")
        self.count, self.closed, self.curves = n, closed, curves
        self._given = (faces, barycentric, positions, normals, phi_fea, closed, curves, corners)
        self.steps, self.step_lengths = np.empty((n, 3)), np.empty(n)
        self.conormals, self.angles = np.empty((n, 3)), np.empty(n)
        self.pointers = NodePointers(
            n, int(closed), address("faces", faces, INT, n),
            address("barycentric", barycentric, FLOAT, n, 3),
            address("positions", positions, FLOAT, n, 3),
            address("normals", normals, FLOAT, n, 3), address("phi_fea", phi_fea, FLOAT, n),
            self.steps.ctypes.data, self.step_lengths.ctypes.data, self.conormals.ctypes.data,
            self.angles.ctypes.data, optional_address("corners", corners, BOOL, n),
        )  # fmt: skip
        _MEASURE_CURVES(self.pointers, curves)

    def __reduce__(self) -> tuple[Any, ...]:
        """Copies have pointers of their own."""
        return NodeArrays, self._given

    def one(self) -> NodePointers:
        """The nodes of a single curve, for kernels that compute one."""
        if self.curves != 1:
            raise KernelError(f"there are {self.curves} curves; pass the nodes of one")
        return self.pointers


class SpacingRules(ctypes.Structure):
    """How nodes are spaced.

    Parameters
    ----------
    nodes_per_radian : float
        Additional nodes per radian by which the normals turn.
    short_move : float
        Move below which a node stays, in mean distances between neighbouring nodes.
    """

    _fields_ = [("nodes_per_radian", NUMBER), ("short_move", NUMBER)]


_EVEN_PLACES = Kernel("even_places", SpacingRules, *[COUNT] * 4, *[POINTER] * 7)


def even_places(
    normals: FloatArray,
    step_lengths: FloatArray,
    lengths: FloatArray,
    fixed: BoolArray,
    closed: bool,
    times: int,
    rules: SpacingRules,
) -> tuple[IntArray, FloatArray]:
    """Where new nodes of c curves of n nodes each are even.

    Parameters
    ----------
    normals : (c, n, 3) float array
        Unit normals of the surface at the nodes. New nodes are closer together where they turn.
    step_lengths : (c, n) float array
        Distances from each node to the next; zero at the last node of an open curve.
    lengths : (c, n) float array
        Lengths of the ways from each node to the next, which may be longer.
    fixed : (c, n) bool array
        Nodes that stay. The first one of each curve is one of them.
    closed : bool
        Whether the last node of each curve is joined to its first.
    times : int
        Number of new steps for each step.
    rules : SpacingRules

    Returns
    -------
    (c, m) int array
        The node before each new node, by its index in its curve. There are m = times n new nodes of
        a closed curve, and times (n - 1) + 1 of an open one.
    (c, m) float array
        Share of the way from there to the next node.
    """
    c, n = rows_of_curves("fixed", fixed)
    if times < 1:
        raise KernelError(f"times is {times}; pass a positive number")
    m = times * n if closed else times * (n - 1) + 1
    arcs, at, shares = np.empty(n + 1), np.zeros((c, m), dtype=np.int64), np.zeros((c, m))
    _EVEN_PLACES(
        rules, c, n, int(closed), times, address("normals", normals, FLOAT, c, n, 3),
        address("step_lengths", step_lengths, FLOAT, c, n),
        address("lengths", lengths, FLOAT, c, n), first_fixed(fixed, c, n),
        arcs.ctypes.data, at.ctypes.data, shares.ctypes.data,
    )  # fmt: skip
    return at, shares
