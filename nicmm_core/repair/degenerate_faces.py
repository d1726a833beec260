"""Degenerate faces: finds faces without area and moves their corners to give them one."""

from __future__ import annotations

import numpy as np

from ..geometry import tolerances
from ..geometry.array_types import BoolArray, FloatArray, IntArray
from ..geometry.grouping import components
from ..geometry.mesh import edge_lengths, unique_edges
from ..progress import checkpoint

ATTEMPTS = 4
"""Attempts at moving vertices until every face has an area."""

SEED = 0
"""Seed of the random moves, so that the same mesh always gets the same moves."""


def degenerate_faces(vertices: FloatArray, faces: IntArray, short: float) -> BoolArray:
    """Which faces have no area: two corners coincide, or one lies on the opposite edge.

    A needle has an area, however thin it is, since its shortest edge is transverse to the longest.

    Parameters
    ----------
    vertices : (v, 3) float array
    faces : (f, 3) int array
    short : float
        Length up to which the ends of an edge coincide.

    Returns
    -------
    (f,) bool array
    """
    checkpoint()
    sides = vertices[np.roll(faces, -1, axis=1)]
    checkpoint()
    sides -= vertices[faces]
    checkpoint()
    lengths = np.sort(np.linalg.norm(sides, axis=2), axis=1)
    checkpoint()
    twice_area = np.linalg.norm(np.cross(sides[:, 0], sides[:, 1]), axis=1)
    without = twice_area <= tolerances.WITHOUT_AREA * lengths[:, 0] * lengths[:, 2]
    return without | (lengths[:, 0] <= short)


def with_areas(
    vertices: FloatArray,
    faces: IntArray,
    short: float,
    flat: BoolArray,
    moving: BoolArray | None = None,
) -> FloatArray:
    """Move vertices so that every face has an area where possible; return them, shape (v, 3).

    Corners of flat faces are moved by a thousandth of their shortest edge with a length, each in a
    random direction.

    Parameters
    ----------
    vertices : (v, 3) float array
        Near the origin; far from it, rounding would remove small moves.
    faces : (f, 3) int array
    short : float
        Length up to which the ends of an edge coincide.
    flat : (f,) bool array
        The result of `degenerate_faces`.
    moving : (v,) bool array, optional
        Vertices that are always moved.
    """
    start, still = vertices, flat
    checkpoint()
    reach = tolerances.MOVED * _shortest_edges(vertices, faces, short)
    generator = np.random.default_rng(SEED)
    for _ in range(ATTEMPTS):
        moves = np.zeros(len(vertices), dtype=bool) if moving is None else moving.copy()
        moves[faces[still]] = True
        checkpoint()
        move = generator.uniform(-1.0, 1.0, start.shape) * reach[:, None]
        checkpoint()
        vertices = np.where(moves[:, None], start + move, vertices)
        still = degenerate_faces(vertices, faces, short)
        if not still.any():
            break
    return vertices


def _shortest_edges(vertices: FloatArray, faces: IntArray, short: float) -> FloatArray:
    """Length of the shortest edge longer than ``short`` at each vertex, shape (v,).

    Vertices joined by shorter edges count as one. Zero if no edge is longer.
    """
    edges, _ = unique_edges(faces)
    lengths = edge_lengths(vertices, edges)
    checkpoint()
    n_places, place = components(len(vertices), *edges[lengths <= short].T)
    shortest = np.full(n_places, np.inf)
    for end in edges[lengths > short].T:
        checkpoint()
        np.minimum.at(shortest, place[end], lengths[lengths > short])
    return np.where(np.isfinite(shortest), shortest, 0.0)[place]
