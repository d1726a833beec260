"""The level set that belongs to a curve: distance to it, with a sign where it bounds a region.

The sign is found from the edges that the curve crosses: their ends lie on different sides, the ends
of all other edges on one. Where that contradicts itself, the curve bounds nothing.
"""

from __future__ import annotations

import numpy as np

from ..geometry.array_types import FloatArray, IntArray
from ..geometry.curve import SurfaceCurve
from ..geometry.mesh import Mesh, unique_edges
from ..geometry.sides import two_sides
from ..level_set.redistancing import build_distance_surface, distance_to_segments, spread


def curve_field(mesh: Mesh, curve: SurfaceCurve) -> FloatArray:
    """Distance to a curve at the vertices, in mesh units, shape (V,).

    Negative inside a closed curve that bounds a region, which is the side with the smaller area.
    Vertices that are not connected to the curve get the greatest distance: they are outside.
    """
    surface = build_distance_surface(mesh.vertices, mesh.faces, mesh.mean_edge_length)
    n_segments = len(curve.points) if curve.closed else len(curve.points) - 1
    segment = np.arange(n_segments)
    distance = np.full(len(mesh.vertices), np.inf)
    for corner in range(3):
        vertex = mesh.faces[curve.faces[segment], corner]
        start, end = curve.points[segment], curve.points[(segment + 1) % len(curve.points)]
        to_segment = distance_to_segments(mesh.vertices[vertex], start, end)
        np.minimum.at(distance, vertex, to_segment)
    spread(surface, distance, np.inf)
    reached = np.isfinite(distance)
    side = _side(mesh, curve) if curve.closed else None
    field = distance if side is None else side * distance
    field[~reached] = distance[reached].max()
    return field


def _side(mesh: Mesh, curve: SurfaceCurve) -> IntArray | None:
    """-1 inside a closed curve, +1 outside and 0 on it, (V,); None where it bounds nothing."""
    n_vertices = len(mesh.vertices)
    edges, _ = unique_edges(mesh.faces)
    corners = mesh.faces[curve.faces]
    weights = curve.barycentric > 0.0
    on_curve = np.zeros(n_vertices, dtype=bool)
    at_vertex = weights.sum(axis=1) == 1
    on_curve[corners[at_vertex][weights[at_vertex]]] = True
    # A point on an edge crosses it if the curve comes from one face and goes on in another.
    changes = (weights.sum(axis=1) == 2) & (curve.faces != np.roll(curve.faces, 1))
    crossed = np.sort(corners[changes][weights[changes]].reshape(-1, 2), axis=1)
    size = np.array([n_vertices, 1])
    parity = np.zeros(len(edges), dtype=np.int64)
    np.add.at(parity, np.searchsorted(edges @ size, crossed @ size), 1)
    parity %= 2
    off = ~on_curve[edges].any(axis=1)
    part, side = two_sides(n_vertices, edges[off], parity[off] == 1)
    if (side == 0)[~on_curve].any():
        return None
    # What only vertices on the curve join to the rest counts as outside.
    here = np.zeros(n_vertices, dtype=bool)
    here[mesh.faces[mesh.face_component == mesh.face_component[curve.faces[0]]]] = True
    area = np.bincount(mesh.faces.ravel(), np.repeat(mesh.face_areas, 3), n_vertices)
    largest = np.bincount(part, np.where(here & ~on_curve, area, 0.0)).argmax()
    here &= part == largest
    side = np.where(here, side, 1)
    inside, outside = (area[here & (side == sign)].sum() for sign in (-1, 1))
    if inside > outside:
        side[here] *= -1
    side[on_curve] = 0
    return side
