"""Perturbs a good mesh so that it has nearly degenerate faces, as in section 4.6 of the paper."""

from __future__ import annotations

import igl
import numpy as np

from nicmm_core.geometry.array_types import FloatArray, IntArray
from nicmm_core.geometry.mesh import Mesh

LEAST_FRACTION, GREATEST_FRACTION = 0.5, 0.9
"""Displacement relative to the opposite edge, [s_min, s_max]; the paper does not give its values.

The height of an equilateral triangle is 0.87 of its edge, so these values move a corner close to
the opposite edge.
"""

LEAST_ANGLE = 1.0
"""Least angle in degrees, as in the example of the paper; moves that violate it are discarded."""

LEAST_PROXIMITY = 0.01
"""Least distance between two vertices, in mean edge lengths."""


def perturbed(
    mesh: Mesh, every: int, generator: np.random.Generator, kept: IntArray
) -> tuple[Mesh, int]:
    """Move one vertex of one face in every ``every`` towards or away from its opposite edge.

    The vertex moves in the plane of the face, perpendicularly to the edge, by a random fraction of
    the length of the edge, and is projected back onto the face. The move is discarded if it brings
    the vertex too close to another one or gives the face too small an angle.

    Parameters
    ----------
    mesh : Mesh
        Good mesh.
    every : int
        Number of faces per selected face; with 1, every face is selected.
    generator : numpy.random.Generator
        Source of the random choices.
    kept : (k,) int array
        Vertices that do not move, such as control points.

    Returns
    -------
    Mesh
        Perturbed mesh with the same faces.
    int
        Number of moved vertices.
    """
    vertices = mesh.vertices.copy()
    proximity = LEAST_PROXIMITY * mesh.mean_edge_length
    fixed = np.zeros(len(vertices), dtype=bool)
    fixed[kept] = True
    selected = generator.choice(len(mesh.faces), size=len(mesh.faces) // every, replace=False)
    for face in selected:
        corners = np.roll(mesh.faces[face], -int(generator.integers(3)))
        fraction = generator.uniform(LEAST_FRACTION, GREATEST_FRACTION)
        side = generator.choice([-1.0, 1.0])
        if fixed[corners[0]]:
            continue
        triangle = vertices[corners]
        place = _displaced(triangle, side * fraction)
        distance = np.linalg.norm(vertices - place, axis=1)
        distance[corners[0]] = np.inf
        if distance.min() < proximity:
            continue
        triangle[0] = place
        if angles(triangle[None]).min() >= LEAST_ANGLE:
            vertices[corners[0]] = place
    moved = (vertices != mesh.vertices).any(axis=1)
    return Mesh(vertices, mesh.faces), int(moved.sum())


def angles(triangles: FloatArray) -> FloatArray:
    """Inner angles in degrees, shape (m, 3), of triangles (m, 3, 3)."""
    to_next = np.roll(triangles, -1, axis=1) - triangles
    to_last = np.roll(triangles, 1, axis=1) - triangles
    across = np.linalg.norm(np.cross(to_next, to_last), axis=2)
    return np.degrees(np.arctan2(across, (to_next * to_last).sum(axis=2)))


def _displaced(triangle: FloatArray, fraction: float) -> FloatArray:
    """First corner, moved perpendicularly to the opposite edge and projected to the triangle."""
    edge = triangle[2] - triangle[1]
    across = triangle[0] - triangle[1]
    across -= edge * (across @ edge) / (edge @ edge)
    height = np.linalg.norm(across)
    if height == 0.0:
        return triangle[0]
    place = triangle[0] - fraction * np.linalg.norm(edge) / height * across
    face = np.array([[0, 1, 2]])
    return igl.point_mesh_squared_distance(place[None], triangle, face)[2].reshape(3)
