"""Decides whether a curve through given points exists, from the arrays alone, without the core.

On a surface whose faces are connected across edges there is a simple closed curve through any
points: the boundary of a thin strip along a tree of faces that touches each point. Parts that share
only single vertices are not connected.
"""

from __future__ import annotations

import numpy as np
from scipy import sparse
from scipy.sparse import csgraph

import nicmm_core as nicmm
from nicmm_core.geometry.array_types import BoolArray, FloatArray, IntArray

SAME_PLACE = 1e-9
"""Distance, in bounding-box diagonals, up to which two points coincide."""

ANY_ORDER = 3
"""Greatest number of points at boundaries or non-manifold places that allow every order.

Three such points have only one cyclic order, in which the boundary of a thin strip along a tree
passes them. All other points are interior, and from any part of its boundary the strip can extend a
finger to reach them.
"""


def edge_connected_parts(mesh: nicmm.Mesh, usable: BoolArray | None = None) -> IntArray:
    """Connected part that each face belongs to.

    Two faces are connected if they have a common edge, or open edges between the same two places.

    Parameters
    ----------
    mesh : Mesh
        Mesh, possibly with defects.
    usable : (F,) bool array, optional
        Faces that a curve may enter, by default all; every other face is a separate part.

    Returns
    -------
    (F,) int array
        Index of the part of each face.
    """
    faces = mesh.faces
    sides = np.sort(faces[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2), axis=1)
    _, edge, count = np.unique(sides, axis=0, return_inverse=True, return_counts=True)
    edge = edge.reshape(-1)
    _, place = np.unique(mesh.vertices + 0.0, axis=0, return_inverse=True)
    ends = np.sort(place.reshape(-1)[sides], axis=1)
    is_open = (count[edge] == 1) & (ends[:, 0] != ends[:, 1])
    _, joint = np.unique(ends[is_open], axis=0, return_inverse=True)
    edge[is_open] = len(count) + joint.reshape(-1)
    face = np.repeat(np.arange(len(faces)), 3)
    if usable is not None:
        edge, face = edge[usable[face]], face[usable[face]]
    n_edges = int(edge.max(initial=-1)) + 1
    shape = (len(faces), n_edges)
    incidence = sparse.csr_array((np.ones(len(face)), (face, edge)), shape=shape)
    return csgraph.connected_components(incidence @ incidence.T, directed=False)[1]


def usable_faces(mesh: nicmm.Mesh, obstacles: FloatArray | None) -> BoolArray:
    """Faces that no obstacle blocks, shape (F,): those without weight 1 at all three corners."""
    if obstacles is None:
        return np.ones(len(mesh.faces), dtype=bool)
    return ~(np.asarray(obstacles)[mesh.faces] >= 1.0).all(axis=1)


def why_impossible(
    mesh: nicmm.Mesh, points: nicmm.SurfacePoints, obstacles: FloatArray | None = None
) -> str:
    """Reason why no simple curve visits these points in any order; empty if one exists."""
    positions = points.positions(mesh)
    apart = np.linalg.norm(positions[:, None] - positions[None], axis=2)
    if (apart[np.triu_indices(len(points), 1)] <= SAME_PLACE * mesh.diagonal).any():
        return "two points are at one place"
    usable = usable_faces(mesh, obstacles)
    part = edge_connected_parts(mesh, usable)
    common: set[int] | None = None
    for corners in _supports(mesh, points):
        there = part[_faces_with(mesh, corners) & usable]
        if not len(there):
            return "a point lies inside an obstacle"
        common = set(there.tolist()) if common is None else common & set(there.tolist())
    return "" if common else "the points lie on different parts"


def every_order_possible(
    mesh: nicmm.Mesh, points: nicmm.SurfacePoints, obstacles: FloatArray | None = None
) -> bool:
    """Whether every order of the points is possible, provided that some order is.

    The criterion is sufficient only: with more points at boundaries it depends on the surface.
    """
    usable = usable_faces(mesh, obstacles)
    supports = _supports(mesh, points)
    return sum(not _is_interior(mesh, corners, usable) for corners in supports) <= ANY_ORDER


def _supports(mesh: nicmm.Mesh, points: nicmm.SurfacePoints) -> list[IntArray]:
    """Vertices at which each point has a positive weight."""
    return [
        mesh.faces[face][weights > 0.0]
        for face, weights in zip(points.faces, points.barycentric, strict=True)
    ]


def _faces_with(mesh: nicmm.Mesh, corners: IntArray) -> BoolArray:
    """Faces that contain all of the given vertices, shape (F,)."""
    return np.isin(mesh.faces, corners).sum(axis=1) == len(corners)


def _is_interior(mesh: nicmm.Mesh, corners: IntArray, usable: BoolArray) -> bool:
    """Whether the usable faces around a point form one disc with the point in its interior."""
    faces = mesh.faces[_faces_with(mesh, corners) & usable]
    faces = np.unique(np.sort(faces, axis=1), axis=0)  # duplicate faces count once
    if len(corners) == 3:
        return len(faces) == 1
    if len(corners) == 2:
        return len(faces) == 2
    opposite = faces[faces != corners[0]].reshape(-1, 2)
    vertices, degree = np.unique(opposite, return_counts=True)
    if (degree != 2).any():
        return False
    number = np.searchsorted(vertices, opposite)
    graph = sparse.coo_array((np.ones(len(number)), number.T), shape=(len(vertices), len(vertices)))
    return csgraph.connected_components(graph, directed=False)[0] == 1
