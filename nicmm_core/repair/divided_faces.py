"""Divides edges of triangles, and keeps the parts on one side of a line."""

from __future__ import annotations

import numpy as np

from ..geometry.array_types import FloatArray, IntArray
from ..geometry.mesh import edge_keys, edge_lengths, side_keys
from .face_parts import FaceParts


def with_divided_edges(
    parts: FaceParts, vertices: FloatArray, ends: IntArray, middle: IntArray, share: FloatArray
) -> tuple[FaceParts, FloatArray]:
    """Divide edges, (e, 2), at new vertices, in all parts; longer sides of a part first."""
    places = (1.0 - share)[:, None] * vertices[ends[:, 0]] + share[:, None] * vertices[ends[:, 1]]
    vertices = np.concatenate([vertices, places])
    size = len(vertices)
    keys = edge_keys(ends[:, 0], ends[:, 1], size)
    order = np.argsort(keys)
    keys, ends, middle, share = keys[order], ends[order], middle[order], share[order]
    lengths = edge_lengths(vertices, ends)
    while len(keys):
        sides = parts.faces[:, [[1, 2], [2, 0], [0, 1]]]
        of_sides = edge_keys(sides[..., 0], sides[..., 1], size)
        at = np.searchsorted(keys, of_sides).clip(max=len(keys) - 1)
        found = keys[at] == of_sides
        which = np.flatnonzero(found.any(axis=1))
        if not len(which):
            break
        long = np.where(found[which], lengths[at[which]], -1.0)
        edge = at[which, long.argmax(axis=1)]
        parts = parts.divided(which, ends[edge, 0], ends[edge, 1], middle[edge], share[edge])
    return parts, vertices


def positive_parts(
    parts: FaceParts, vertices: FloatArray, values: FloatArray, snap: float
) -> tuple[FaceParts, FloatArray]:
    """The parts with positive values, divided where the values change sign; and all vertices.

    Values up to `snap` become zero.
    """
    sign = np.where(values > snap, 1, np.where(values < -snap, -1, 0))
    ends = edges_of(parts.faces[(sign[parts.faces] > 0).any(axis=1)], len(vertices))
    ends = ends[sign[ends].prod(axis=1) < 0]
    low, high = values[ends].T
    middle = len(vertices) + np.arange(len(ends))
    parts, vertices = with_divided_edges(parts, vertices, ends, middle, low / (low - high))
    at_corners = np.append(sign, np.zeros(len(ends), dtype=np.int64))[parts.faces]
    outside = (at_corners >= 0).all(axis=1) & (at_corners > 0).any(axis=1)
    # On a part whose corners all lie on the line, the values before snapping decide.
    on_line = (at_corners == 0).all(axis=1)
    mean = np.append(values, np.zeros(len(ends)))[parts.faces].sum(axis=1)
    return parts.taken(outside | (on_line & (mean > 0.0))), vertices


def edges_of(faces: IntArray, size: int) -> IntArray:
    """The edges of faces whose corner indices are below ``size``, (e, 2), smaller index first."""
    return np.stack(np.divmod(np.unique(side_keys(faces, size)), size), axis=1)


def side_lengths(vertices: FloatArray, faces: IntArray) -> FloatArray:
    """Length of the side opposite each corner, (f, 3)."""
    sides = faces[:, [[1, 2], [2, 0], [0, 1]]].reshape(-1, 2)
    return edge_lengths(vertices, sides).reshape(-1, 3)
