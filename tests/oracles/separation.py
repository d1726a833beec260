"""Proves that curves and the bands around them separate points, without the code that refuses them.

The mesh is cut along the curves and refined. libigl's exact geodesics on the refined mesh, from the
vertices along the curves, are upper bounds of the distance from the curves. An edge is closed if a
curve runs along it, or if all of its points are closer to a curve than the clearance. Any path is a
sequence of faces that leads across open edges; so points that open edges do not connect are
separated.
"""

from __future__ import annotations

from collections.abc import Sequence

import igl
import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

import nicmm_core as nicmm
from nicmm_core.geometry.array_types import FloatArray, IntArray

SNAP = 1e-3
"""Distance, in edges, up to which cuts move to vertices.

On thinner triangles, libigl needs far too much memory. The bounds of the distance regard it."""

FINE = 0.5
"""Length of edges, in clearances, that are not halved any more."""

REACH = 1.5
"""Distances are computed on the faces within as many clearances of the curves."""


def proven_apart(
    mesh: nicmm.Mesh, curves: Sequence[nicmm.SurfaceCurve], clearance: float, vertices: IntArray
) -> bool:
    """Whether no curve that keeps its distance leads through all of some vertices.

    Parameters
    ----------
    mesh : Mesh
        Oriented manifold.
    curves : sequence of SurfaceCurve
        Curves that are avoided, and do not meet.
    clearance : float
        Least distance from these curves, in mesh units.
    vertices : (k,) int array
        Vertices of the mesh that are not on the curves.

    Returns
    -------
    bool
        True only with a proof; False means that none was found.
    """
    cut = nicmm.cut_mesh(mesh, list(curves), snap=SNAP)
    positions, faces, chains = cut.vertices, cut.faces, cut.chain_edges
    moved = SNAP * _longest_edge(mesh.vertices, mesh.faces)
    while True:
        distance = _distance_bounds(positions, faces, chains, clearance) + moved
        if (distance[vertices] < clearance).any():
            return True
        if _are_apart(positions, faces, chains, distance, clearance, vertices):
            return True
        near = np.isfinite(distance)[faces].all(axis=1)
        if clearance == 0.0 or _longest_edge(positions, faces[near]) < FINE * clearance:
            return False
        positions, faces, chains = _halved(positions, faces, chains)


def _distance_bounds(
    positions: FloatArray, faces: IntArray, chains: IntArray, clearance: float
) -> FloatArray:
    """Upper bounds of the distance of the vertices from the curves, infinite far from them."""
    distance = np.full(len(positions), np.inf)
    sources = np.unique(chains)
    distance[sources] = 0.0
    if clearance == 0.0:
        return distance
    straight = cKDTree(positions[sources]).query(positions)[0]
    near = (straight < REACH * clearance + _longest_edge(positions, faces))[faces].all(axis=1)
    held, local = np.unique(faces[near], return_inverse=True)
    ours = np.flatnonzero(np.isin(held, sources))
    none, all_of_them = np.zeros(0, dtype=np.int64), np.arange(len(held))
    found = igl.exact_geodesic(positions[held], local.reshape(-1, 3), ours, none, all_of_them, none)
    distance[held] = np.where(np.isfinite(found) & (found >= 0.0), found, np.inf)
    return distance


def _are_apart(
    positions: FloatArray,
    faces: IntArray,
    chains: IntArray,
    distance: FloatArray,
    clearance: float,
    vertices: IntArray,
) -> bool:
    """Whether open edges leave some of the vertices without a connection to the first one."""
    edges, edge_of = _edges(faces, len(positions))
    length = np.linalg.norm(positions[edges[:, 0]] - positions[edges[:, 1]], axis=1)
    farthest = 0.5 * (distance[edges].sum(axis=1) + length)
    is_open = farthest >= clearance
    is_open[_numbers(edges, chains)] = False
    # A graph of faces and open edges. Every face at a vertex can be reached from there.
    face = np.repeat(np.arange(len(faces)), 3)
    passes = is_open[edge_of]
    pairs = np.stack([face[passes], len(faces) + edge_of[passes]])
    nodes = len(faces) + len(edges)
    graph = coo_array((np.ones(pairs.shape[1], dtype=bool), pairs), shape=(nodes, nodes))
    label = connected_components(graph, directed=False)[1]
    first, *others = (
        set(label[np.flatnonzero((faces == vertex).any(axis=1))].tolist()) for vertex in vertices
    )
    return any(not first & other for other in others)


def _halved(
    positions: FloatArray, faces: IntArray, chains: IntArray
) -> tuple[FloatArray, IntArray, IntArray]:
    """Divide every face into four, and every edge of the curves into two."""
    size = len(positions)
    edges, edge_of = _edges(faces, size)
    m = size + edge_of.reshape(-1, 3)
    a, b, c = faces.T
    quarters = [(a, m[:, 2], m[:, 1]), (m[:, 2], b, m[:, 0]), (m[:, 1], m[:, 0], c), m.T]
    new_faces = np.concatenate([np.stack(quarter, axis=1) for quarter in quarters])
    new = size + _numbers(edges, chains)
    new_chains = np.concatenate(
        [np.stack([chains[:, 0], new], axis=1), np.stack([new, chains[:, 1]], axis=1)]
    )
    return np.concatenate([positions, positions[edges].mean(axis=1)]), new_faces, new_chains


def _longest_edge(positions: FloatArray, faces: IntArray) -> float:
    corners = positions[faces]
    return float(np.linalg.norm(corners - corners[:, [1, 2, 0]], axis=2).max())


def _edges(faces: IntArray, size: int) -> tuple[IntArray, IntArray]:
    """The edges of faces, sorted, and the edge opposite each corner, (3 F,)."""
    sides = np.sort(faces[:, [[1, 2], [2, 0], [0, 1]]], axis=2).reshape(-1, 2)
    keys, edge_of = np.unique(sides @ [size, 1], return_inverse=True)
    return np.stack(np.divmod(keys, size), axis=1), edge_of


def _numbers(edges: IntArray, chains: IntArray) -> IntArray:
    """The places of the edges of curves among all edges."""
    size = int(edges.max()) + 1
    return np.searchsorted(edges @ [size, 1], np.sort(chains, axis=1) @ [size, 1])
