"""Computes the level set of a final curve: the distance to it, signed if it bounds a region.

The two ends of an edge lie on different sides if the curve crosses the edge an odd number of times,
and on the same side otherwise. If these conditions contradict each other, the curve bounds no
region.
"""

from __future__ import annotations

import numpy as np

from .array_types import FloatArray, IntArray
from .curve import SurfaceCurve
from .distances import build_distance_surface, distance_to_segments, propagate
from .mesh import Mesh, unique_edges
from .sides import two_sides


def curve_field(mesh: Mesh, curve: SurfaceCurve) -> FloatArray:
    """Distance to a curve at the vertices, in mesh units, shape (V,).

    Negative inside a closed curve that bounds a region, which is the side with the smaller area.
    Vertices on other components are outside, at the greatest distance found.
    """
    surface = build_distance_surface(mesh.vertices, mesh.faces, mesh.mean_edge_length)
    steps = curve.steps
    start, faces = curve.points[: len(steps)], curve.faces[: len(steps)]
    distance = np.full(len(mesh.vertices), np.inf)
    for vertex in mesh.faces[faces].T:
        to_segment = distance_to_segments(mesh.vertices[vertex], start, start + steps)
        np.minimum.at(distance, vertex, to_segment)
    propagate(surface, distance, np.inf)
    reached = np.isfinite(distance)
    side = _side(mesh, curve) if curve.closed else None
    field = distance if side is None else side * distance
    field[~reached] = distance[reached].max()
    return field


def _side(mesh: Mesh, curve: SurfaceCurve) -> IntArray | None:
    """-1 inside a closed curve, +1 outside and 0 on it, (V,); None if it bounds no region."""
    n_vertices = len(mesh.vertices)
    edges, _ = unique_edges(mesh.faces)
    corners = mesh.faces[curve.faces]
    weights = curve.barycentric > 0.0
    on_curve = np.zeros(n_vertices, dtype=bool)
    at_vertex = weights.sum(axis=1) == 1
    on_curve[corners[at_vertex][weights[at_vertex]]] = True
    # At a point on an edge, the curve crosses the edge if it passes from one face to another.
    changes = (weights.sum(axis=1) == 2) & (curve.faces != np.roll(curve.faces, 1))
    crossed = np.sort(corners[changes][weights[changes]].reshape(-1, 2), axis=1)
    size = np.array([n_vertices, 1])
    place = np.searchsorted(edges @ size, crossed @ size)
    odd = np.bincount(place, minlength=len(edges)) % 2 == 1
    off = ~on_curve[edges].any(axis=1)
    part, side = two_sides(n_vertices, edges[off], odd[off])
    if (side == 0)[~on_curve].any():
        return None
    # Parts connected to the rest only through vertices on the curve count as outside.
    component = mesh.face_component
    here = np.isin(np.arange(n_vertices), mesh.faces[component == component[curve.faces[0]]])
    area = np.bincount(mesh.faces.ravel(), np.repeat(mesh.face_areas, 3), n_vertices)
    largest = np.bincount(part, np.where(here & ~on_curve, area, 0.0)).argmax()
    here &= part == largest
    side = np.where(here, side, 1)
    inside, outside = (area[here & (side == sign)].sum() for sign in (-1, 1))
    if inside > outside:
        side[here] *= -1
    side[on_curve] = 0
    return side
