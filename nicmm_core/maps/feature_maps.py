"""Computes weights for `alignment` and `obstacles` from a mesh or from data on it (section 3.3).

Each ``..._map`` function returns one weight in [0, 1] per vertex, shape (V,), like a painted map;
`maps.guidance` describes the effect of the weights.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import ArrayLike
from scipy import sparse

from ..arguments import checked_number, checked_vertex_values, number_between
from ..errors import ArgumentError
from ..geometry import tolerances
from ..geometry.array_types import FloatArray, IntArray
from ..geometry.mesh import (
    Mesh,
    MeshLike,
    adjacent_sides,
    as_mesh,
    check_indices,
    edge_keys,
    side_keys,
    unique_edges,
)
from ..geometry.normals import unsigned_normals
from ..repair.clean_surface import joined_surface

SHARP_ANGLE = math.radians(30.0)
"""Least angle between the normals of two faces, in radians, at which their edge is sharp."""

USUAL, STRIKING = 0.5, 0.95
"""Quantiles of the curvature over the area that get weight 0 and weight 1 by default."""


def principal_curvatures(mesh: MeshLike) -> FloatArray:
    """Principal curvatures at the vertices, shape (V, 2), in 1/length, the larger one first.

    At each vertex a quadric is fitted to the heights of the two-ring over the tangent plane, with
    larger weights for nearer neighbours. Signs are arbitrary, since a mesh need not be oriented. In
    directions without enough neighbours the surface counts as flat.

    Parameters
    ----------
    mesh : Mesh
        Any mesh; it may be open, unoriented, non-manifold or a soup of triangles.
    """
    mesh = as_mesh(mesh)
    # Not `igl.principal_curvature`, which fails on small meshes and needs an orientation.
    surface = joined_surface(mesh)
    return _principal_curvatures(surface.mesh)[surface.place]


def _principal_curvatures(mesh: Mesh) -> FloatArray:
    """Principal curvatures of a mesh in which coincident vertices are joined."""
    centre, neighbour = _two_rings(mesh)
    normals = unsigned_normals(mesh)
    first = np.cross(normals, np.eye(3)[np.abs(normals).argmin(axis=1)])
    first /= np.maximum(np.linalg.norm(first, axis=1, keepdims=True), tolerances.TINY)
    second = np.cross(normals, first)
    offset = mesh.vertices[neighbour] - mesh.vertices[centre]
    distance = np.linalg.norm(offset, axis=1)
    count = np.bincount(centre, minlength=len(mesh.vertices))
    size = np.bincount(centre, distance, len(mesh.vertices)) / np.maximum(count, 1)
    apart = distance > tolerances.COINCIDENT * mesh.diagonal
    centre, offset, distance = centre[apart], offset[apart], distance[apart]
    # Lengths are relative to the size of the neighbourhood, so that all fits are well conditioned.
    u, v, height = (
        (offset * axis[centre]).sum(axis=1) / size[centre] for axis in (first, second, normals)
    )
    terms = np.stack([0.5 * u * u, u * v, 0.5 * v * v, u, v]) * (size[centre] / distance)
    height *= size[centre] / distance
    fit = _least_squares(terms, height, centre, len(mesh.vertices))
    a, b, c, d, e = fit.T / np.maximum(size, tolerances.TINY) ** np.array([[1, 1, 1, 0, 0]]).T
    # Curvatures from the fundamental forms of the surface (u, v, h) at the origin.
    slope = 1.0 + d * d + e * e
    root = np.sqrt(slope)
    mean = ((1.0 + d * d) * c - 2.0 * d * e * b + (1.0 + e * e) * a) / (2.0 * slope * root)
    gauss = (a * c - b * b) / slope**2
    spread = np.sqrt(np.maximum(mean * mean - gauss, 0.0))
    return np.stack([mean + spread, mean - spread], axis=1)


def curvature_map(
    mesh: MeshLike, low: float | None = None, high: float | None = None
) -> FloatArray:
    """Weights for strongly curved parts of the surface: ridges, grooves and sharp edges.

    Between two limits, the weight is linear in the larger absolute principal curvature.

    Parameters
    ----------
    mesh : Mesh
    low, high : float, optional
        Curvatures with weight 0 and with weight 1, in 1/length. By default these are the median
        over the area, and the 95 % quantile or twice the median, whichever is larger. So a sphere,
        a tube and a plane have no weights.

    Returns
    -------
    (V,) float array

    Raises
    ------
    ArgumentError
        If the limits are not finite numbers, or are equal.

    References
    ----------
    Section 3.3 of the paper, after Xu et al., "A variational approach for feature-aware B-spline
    curve design on surface meshes", 2023.
    """
    mesh = as_mesh(mesh)
    curvature = np.abs(principal_curvatures(mesh)).max(axis=1)
    if low is None or high is None:
        usual, striking = _quantiles_by_area(mesh, curvature, [USUAL, STRIKING])
        low = usual if low is None else checked_number("low", low)
        # With at least twice the usual curvature, a sphere has no weights.
        high = max(striking, 2.0 * low) if high is None else checked_number("high", high)
        if high <= tolerances.FLAT / mesh.diagonal:
            return np.zeros(len(mesh.vertices))
    return value_map(mesh, curvature, low, high)


def sharp_edges(mesh: MeshLike, angle: float = SHARP_ANGLE) -> IntArray:
    """Edges where the surface has a crease.

    Parameters
    ----------
    mesh : Mesh
    angle : float
        Least angle between the normals of the two faces of a sharp edge, in radians; coplanar faces
        have the angle 0. The orientation of faces is ignored.

    Returns
    -------
    (n, 2) int array
        Vertices of the sharp edges. Boundary edges are not sharp, unless they coincide with others.
        Faces without area are ignored.

    Raises
    ------
    ArgumentError
        If the angle is not in 0 … π.
    """
    mesh = as_mesh(mesh)
    limit = number_between("angle", angle, 0.0, math.pi, "an angle in radians")
    surface = joined_surface(mesh)
    solid = np.flatnonzero(surface.mesh.face_areas > 0.0)
    faces, normals = surface.mesh.faces[solid], surface.mesh.face_normals[solid]
    start = faces[:, [1, 2, 0]].ravel()
    # At an edge with more than two faces, consecutive faces are compared.
    one, other = adjacent_sides(faces)
    turned = np.where(start[one] == start[other], -1.0, 1.0)
    normal, beyond = normals[one // 3], normals[other // 3]
    cosine = turned * (normal * beyond).sum(axis=1)
    sine = np.linalg.norm(np.cross(normal, beyond), axis=1)
    is_sharp = np.arctan2(sine, cosine) >= limit
    sharp = np.concatenate([one[is_sharp], other[is_sharp]])
    given = mesh.faces[surface.parts.parent[solid[sharp // 3]]]
    rows = np.arange(len(sharp))
    ends = np.stack([given[rows, sharp % 3 - 2], given[rows, sharp % 3 - 1]], axis=1)
    return np.unique(np.sort(ends, axis=1), axis=0)


def sharp_edge_map(mesh: MeshLike, angle: float = SHARP_ANGLE) -> FloatArray:
    """Weights of 1 at the ends of sharp edges and 0 elsewhere, shape (V,); see `sharp_edges`.

    A map has weights at vertices only. If all corners of a face lie on sharp edges, as on a box of
    twelve triangles, the whole face has weight 1; subdivide such a mesh.
    """
    mesh = as_mesh(mesh)
    weights = edge_map(mesh, sharp_edges(mesh, angle))
    place = joined_surface(mesh).place
    at_place = np.zeros(len(weights))
    np.maximum.at(at_place, place, weights)  # all vertices at one position have the same weight
    return at_place[place]


def edge_map(mesh: MeshLike, edges: ArrayLike) -> FloatArray:
    """Weights of 1 at the ends of given edges, such as seams, and 0 elsewhere, shape (V,).

    Parameters
    ----------
    mesh : Mesh
    edges : (n, 2) array_like of int
        Vertices of edges of the mesh; the array may be empty.

    Raises
    ------
    ArgumentError
        If the array has another shape, or a pair is not an edge of the mesh.
    """
    mesh = as_mesh(mesh)
    pairs = _checked_pairs(edges, len(mesh.vertices))
    size = len(mesh.vertices)
    not_edges = ~np.isin(edge_keys(pairs[:, 0], pairs[:, 1], size), side_keys(mesh.faces, size))
    if not_edges.any():
        first = int(not_edges.argmax())
        raise ArgumentError(
            f"edges[{first}] = {pairs[first].tolist()} is not an edge of a face ("
            f"{not_edges.sum()} are not); pass pairs of end vertices of mesh edges"
        )
    weights = np.zeros(size)
    weights[pairs] = 1.0
    return weights


def value_map(
    mesh: MeshLike, values: ArrayLike, low: float | None = None, high: float | None = None
) -> FloatArray:
    """Weights from values at the vertices, such as a texture or an attribute.

    Parameters
    ----------
    mesh : Mesh
    values : (V,) array_like of float
        Values at the vertices, in any unit.
    low, high : float, optional
        Values with weight 0 and with weight 1. The weight is linear between them and constant
        beyond; ``low`` may be the larger value. By default the least and the greatest value at
        vertices of faces.

    Returns
    -------
    (V,) float array
        The weights. All are zero if the limits are omitted and all values are equal.

    Raises
    ------
    ArgumentError
        If there is not one finite value per vertex, or the limits are equal.
    """
    mesh = as_mesh(mesh)
    checked = checked_vertex_values("values", values, mesh, "value")
    bad = ~np.isfinite(checked)
    if bad.any():
        first = int(bad.argmax())
        raise ArgumentError(f"values[{first}] is {checked[first]}; pass finite numbers")
    used = checked[mesh.referenced]
    start = float(used.min()) if low is None else checked_number("low", low)
    end = float(used.max()) if high is None else checked_number("high", high)
    if start == end:
        if low is None and high is None:
            return np.zeros(len(checked))
        raise ArgumentError(
            f"low and high are both {start:g}; pass the values with weight 0 and with weight 1"
        )
    # Numbers are halved, since the difference of two large ones may overflow.
    return np.clip((0.5 * checked - 0.5 * start) / (0.5 * end - 0.5 * start), 0.0, 1.0)


def _two_rings(mesh: Mesh) -> tuple[IntArray, IntArray]:
    """Pairs of a vertex and a vertex of its two-ring, both (p,), sorted by the first vertex.

    A one-ring does not overdetermine a quadric; more than two rings would smooth out features.
    """
    edges, size = unique_edges(mesh.faces)[0], len(mesh.vertices)
    ends = np.concatenate([edges, edges[:, ::-1]]).T
    ones = np.ones(len(ends[0]), dtype=np.float32)
    beside = sparse.csr_array((ones, (ends[0], ends[1])), shape=(size, size))
    # Two-rings through vertices of high valence would be too large.
    onward = beside[np.flatnonzero(np.diff(beside.indptr) <= 64)]
    reached = beside + sparse.csr_array(onward.T @ onward)
    centre, neighbour = sparse.coo_array(reached).coords
    others = centre != neighbour
    return centre[others].astype(np.int64), neighbour[others].astype(np.int64)


def _least_squares(terms: FloatArray, right: FloatArray, row: IntArray, count: int) -> FloatArray:
    """Minimum-norm solutions of many small least-squares problems.

    Parameters
    ----------
    terms : (k, p) float array
        Coefficients of each equation for the k unknowns of its problem.
    right : (p,) float array
        Right-hand sides of the equations.
    row : (p,) int array
        Index of the problem to which each equation belongs.
    count : int
        Number of problems.

    Returns
    -------
    (count, k) float array
    """
    k = len(terms)
    matrix, vector = np.zeros((count, k, k)), np.zeros((count, k))
    for i in range(k):
        vector[:, i] = np.bincount(row, terms[i] * right, count)
        for j in range(i, k):
            matrix[:, i, j] = matrix[:, j, i] = np.bincount(row, terms[i] * terms[j], count)
    # Below this relative eigenvalue, the direction of a fit is undetermined.
    inverse = np.linalg.pinv(matrix, rcond=1e-8, hermitian=True)
    return np.einsum("nij,nj->ni", inverse, vector)


def _quantiles_by_area(mesh: Mesh, values: FloatArray, shares: list[float]) -> list[float]:
    """Quantiles of values at the vertices, weighted by area."""
    area = np.bincount(mesh.faces.ravel(), np.repeat(mesh.face_areas, 3), len(mesh.vertices))
    order = np.argsort(values, kind="stable")
    below = np.cumsum(area[order])
    places = np.searchsorted(below, np.array(shares) * below[-1]).clip(max=len(order) - 1)
    return [float(value) for value in values[order[places]]]


def _checked_pairs(edges: ArrayLike, n_vertices: int) -> IntArray:
    """Convert edges to pairs of vertex indices, (n, 2), or raise ArgumentError."""
    try:
        pairs = np.array(edges)
    except (TypeError, ValueError) as error:
        raise ArgumentError(
            f"edges cannot be read as vertex indices ({error}); pass an integer array of shape "
            "(n, 2)"
        ) from error
    if pairs.size == 0:
        return np.zeros((0, 2), dtype=np.int64)
    if pairs.shape[1:] != (2,) or not np.issubdtype(pairs.dtype, np.integer):
        raise ArgumentError(
            f"edges has shape {pairs.shape} and type {pairs.dtype}; pass vertex indices of shape "
            "(n, 2)"
        )
    pairs = pairs.astype(np.int64)
    check_indices("edges", pairs, n_vertices)
    return pairs
