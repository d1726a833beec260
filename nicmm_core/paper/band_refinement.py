"""Virtual refinement of the mesh along the initial loop.

φ is linear in every face, so on a coarse mesh its zero set consists of few straight segments and
can hardly bend. Edges near the loop that are long compared with the loop are bisected virtually,
the longest first, so that the curve has enough segments on any mesh. The surface does not change.
"""

from __future__ import annotations

import heapq

import numpy as np
from scipy.spatial import cKDTree

from ..geometry.array_types import BoolArray, FloatArray
from ..path.virtual_splits import SplitMesh
from ..progress import checkpoint

RESOLUTION = 64
"""Ratio of the loop's length to the longest edge near it."""

FINE_BAND, COARSE_BAND = 0.05, 0.2
"""Half widths of the refined bands, relative to the length of the loop.

Edges in the outer band, within which the curve moves, may be twice as long as in the inner one:
faces that are much larger than the solver's narrow band would not count as parts of it. Outside, an
edge may be as long as twice the distance from its midpoint to the band.
"""

MOST_SPLITS = 4_000
"""Maximum number of edges bisected; adjacent needles would need many times more.

The longest edges are bisected first, so stopping at this number leaves an evenly coarser band.
"""


def refine_along(
    split: SplitMesh, component: int, loop: list[int], closed: bool = True
) -> tuple[list[int], float]:
    """Bisect long edges near a path of edges.

    Parameters
    ----------
    split : SplitMesh
        Mesh with the path; it is modified.
    component : int
        Index of the connected component that contains the path.
    loop : list of int
        Vertices of the path; the first one is not repeated at the end.
    closed : bool
        Whether an edge joins the last vertex to the first.

    Returns
    -------
    list of int
        Vertices of the path after the splits.
    float
        Step length of the path's zigzag: the mean length of its edges before the splits, but at
        most the longest edge allowed after them.
    """
    points = np.array([split.position(vertex) for vertex in loop])
    if closed:
        points = np.concatenate([points, points[:1]])
    lengths = np.linalg.norm(np.diff(points, axis=0), axis=1)
    length = float(lengths.sum())
    longest = length / RESOLUTION
    tree = cKDTree(_samples(points, longest))

    def too_long(start: FloatArray, end: FloatArray) -> tuple[FloatArray, BoolArray]:
        """Lengths of edges, and whether they are too long at their distance from the loop."""
        # Rounded, so that edges of equal length remain equal when the model is rotated.
        size = np.round(np.linalg.norm(start - end, axis=1) / longest, 6) * longest
        distance, _ = tree.query(0.5 * (start + end))
        band = np.where(size > 2.0 * longest, COARSE_BAND, FINE_BAND) * length
        return size, (size > longest) & (distance < band + 0.5 * size)

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
    """Points along a polyline, no farther apart than the spacing."""
    points, following = points[:-1], points[1:]
    count = np.ceil(np.linalg.norm(following - points, axis=1) / spacing).astype(int).clip(min=1)
    return np.concatenate(
        [
            start + (end - start) * np.arange(n)[:, None] / n
            for start, end, n in zip(points, following, count, strict=True)
        ]
    )
