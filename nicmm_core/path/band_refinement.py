"""Virtual refinement of the mesh along the initial loop.

φ is linear in every face, so a curve on a coarse mesh has few straight segments and can hardly
bend. Edges near the loop that are long relative to it are bisected virtually, the longest first, so
that the curve has enough segments on any mesh. The surface does not change.
"""

from __future__ import annotations

import heapq

import numpy as np
from scipy.spatial import cKDTree

from ..geometry.array_types import BoolArray, FloatArray
from ..progress import checkpoint
from .virtual_splits import SplitMesh

PIECES = 64
"""Length of the loop over the longest edge near it, where the level set is the result."""

PIECES_TO_START = 32
"""The same where the level set is only the start of a relaxation."""

BAND_SHARE = 0.05
"""Half width of the refined band, relative to the length of the loop.

The curve moves within it. Farther out, the longest edge allowed is twice the distance to the band.
"""

MOST_SPLITS = 3_000
"""Most edges bisected; adjacent needles would need many times more.

The longest edges come first, so stopping early leaves an evenly coarser band.
"""


def refine_along(
    split: SplitMesh, component: int, loop: list[int], closed: bool = True, pieces: int = PIECES
) -> tuple[list[int], float]:
    """Bisect long edges near a path of edges.

    Parameters
    ----------
    split : SplitMesh
        Changed.
    component : int
        The connected component that the path is on.
    loop : list of int
        Vertices of the path, the first not repeated.
    closed : bool
        Whether the last vertex is joined to the first.
    pieces : int
        Length of the path over the longest edge near it.

    Returns
    -------
    list of int
        Vertices of the path after the splits.
    float
        Size of the zigzag of the path: the mean length of its edges before the splits, at most the
        longest edge length allowed after them.
    """
    points = np.array([split.position(vertex) for vertex in loop])
    if closed:
        points = np.concatenate([points, points[:1]])
    lengths = np.linalg.norm(np.diff(points, axis=0), axis=1)
    length = float(lengths.sum())
    longest, half_width = length / pieces, BAND_SHARE * length
    tree = cKDTree(_samples(points, longest))

    def too_long(start: FloatArray, end: FloatArray) -> tuple[FloatArray, BoolArray]:
        """Lengths of edges, and whether they are too long at their distance from the loop."""
        # Rounded, so that edges of equal length stay equal under rotations of the model.
        size = np.round(np.linalg.norm(start - end, axis=1) / longest, 6) * longest
        distance, _ = tree.query(0.5 * (start + end))
        return size, (size > longest) & (distance < half_width + 0.5 * size)

    working, renumbered = split.assemble(component)
    checkpoint()
    original = np.flatnonzero(renumbered >= 0)
    edges = working.edges[working.edge_lengths > longest]
    size, wanted = too_long(*working.vertices[edges].transpose(1, 0, 2))
    queue = [
        (-edge_length, start, end)
        for edge_length, (start, end) in zip(
            size[wanted].tolist(), original[edges[wanted]].tolist(), strict=True
        )
    ]
    heapq.heapify(queue)
    following = dict(zip(loop, loop[1:] + loop[:1] if closed else loop[1:], strict=False))
    for _ in range(MOST_SPLITS):
        if not queue:
            break
        _, start, end = heapq.heappop(queue)
        middle = split.split_edge(start, end)
        if following.get(end) == start:
            start, end = end, start
        if following.get(start) == end:
            following[start], following[middle] = middle, end
        around = sorted(split.neighbours(middle))
        positions = np.array([split.position(vertex) for vertex in around])
        here = np.broadcast_to(split.position(middle), positions.shape)
        for size, wanted, vertex in zip(*too_long(here, positions), around, strict=True):
            if wanted:
                heapq.heappush(queue, (-float(size), min(vertex, middle), max(vertex, middle)))
    refined = [loop[0]]
    while following.get(refined[-1], loop[0]) != loop[0]:
        refined.append(following[refined[-1]])
    return refined, min(float(lengths.mean()), longest)


def _samples(points: FloatArray, spacing: float) -> FloatArray:
    """Samples of a polyline, no farther apart than the spacing."""
    points, following = points[:-1], points[1:]
    count = np.ceil(np.linalg.norm(following - points, axis=1) / spacing).astype(int).clip(min=1)
    return np.concatenate(
        [
            start + (end - start) * np.arange(n)[:, None] / n
            for start, end, n in zip(points, following, count, strict=True)
        ]
    )
