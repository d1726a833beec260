"""Finds degenerate faces, which have no area, and moves their corners to give them one."""

from __future__ import annotations

import numpy as np

from ..geometry import tolerances
from ..geometry.array_types import BoolArray, FloatArray, IntArray
from ..geometry.grouping import components
from ..geometry.mesh import edge_lengths, triangle_areas, unique_edges
from ..progress import checkpoint

ATTEMPTS = 4
"""Maximum number of attempts to move vertices so that every face has an area."""

SEED = 0
"""Seed of the random moves, so that the same mesh always gets the same moves."""


def degenerate_faces(vertices: FloatArray, faces: IntArray, short: float) -> BoolArray:
    """Find faces without area, in which two corners coincide or one lies on the opposite edge.

    A needle has an area, however thin it is, since its shortest edge is transverse to its longest.

    Parameters
    ----------
    vertices : (v, 3) float array
        Positions of the vertices.
    faces : (f, 3) int array
        Corner indices of each triangle.
    short : float
        Length up to which the ends of an edge coincide, in the unit of the positions.

    Returns
    -------
    (f,) bool array
        Whether each face is degenerate.
    """
    lengths = [edge_lengths(vertices, faces[:, [k - 1, k]]) for k in range(3)]
    shortest, longest = np.minimum.reduce(lengths), np.maximum.reduce(lengths)
    twice_area = 2.0 * triangle_areas(vertices, faces)
    return (twice_area <= tolerances.DEGENERATE_SINE * shortest * longest) | (shortest <= short)


def perturbed(
    vertices: FloatArray,
    faces: IntArray,
    short: float,
    flat: BoolArray,
    moving: BoolArray | None = None,
) -> FloatArray:
    """Move vertices so that every face has an area if possible.

    Corners of degenerate faces are moved randomly, along each axis by at most a thousandth of their
    shortest edge of non-zero length.

    Parameters
    ----------
    vertices : (v, 3) float array
        Positions near the origin; far from it, rounding would remove small moves.
    faces : (f, 3) int array
        Corner indices of each triangle.
    short : float
        Length up to which the ends of an edge coincide, in the unit of the positions.
    flat : (f,) bool array
        Result of `degenerate_faces`.
    moving : (v,) bool array, optional
        Whether each vertex is moved in any case.

    Returns
    -------
    (v, 3) float array
        New positions.
    """
    start, still = vertices, flat
    reach = tolerances.PERTURBATION * _shortest_edges(vertices, faces, short)
    generator = np.random.default_rng(SEED)
    for _ in range(ATTEMPTS):
        moves = np.zeros(len(vertices), dtype=bool) if moving is None else moving.copy()
        moves[faces[still]] = True
        checkpoint()
        move = generator.uniform(-1.0, 1.0, start.shape) * reach[:, None]
        vertices = np.where(moves[:, None], start + move, vertices)
        still = degenerate_faces(vertices, faces, short)
        if not still.any():
            break
    return vertices


def _shortest_edges(vertices: FloatArray, faces: IntArray, short: float) -> FloatArray:
    """Length of the shortest edge longer than ``short`` at each vertex, shape (v,).

    Vertices joined by shorter edges count as one vertex. The length is 0 if no edge is longer.
    """
    edges, _ = unique_edges(faces)
    lengths = edge_lengths(vertices, edges)
    n_places, place = components(len(vertices), *edges[lengths <= short].T)
    shortest = np.full(n_places, np.inf)
    for end in edges[lengths > short].T:
        np.minimum.at(shortest, place[end], lengths[lengths > short])
    return np.where(np.isfinite(shortest), shortest, 0.0)[place]
