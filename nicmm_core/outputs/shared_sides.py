"""Adjacent faces."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..geometry.array_types import BoolArray, IntArray


@dataclass(frozen=True)
class SharedSides:
    """Pairs of faces at the same edge; k - 1 pairs at an edge with k faces.

    Attributes
    ----------
    edges : (p, 2) int array
        The edge of each pair, smaller vertex first.
    faces : (p, 2) int array
        The two faces.
    on_chain : (p,) bool array
        Whether the edge is in the chain.
    """

    edges: IntArray
    faces: IntArray
    on_chain: BoolArray


def shared_sides(faces: IntArray, chain_edges: IntArray) -> SharedSides:
    """Adjacent faces, and whether a chain of edges separates them.

    Parameters
    ----------
    faces : (F, 3) int array
    chain_edges : (m, 2) int array
    """
    size = int(faces.max()) + 1
    low, high = np.sort(faces[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2), axis=1).T
    keys = low * size + high
    order = np.argsort(keys, kind="stable")
    same = np.flatnonzero(keys[order[1:]] == keys[order[:-1]])
    one, other = order[same], order[same + 1]
    wanted = np.sort(chain_edges, axis=1) @ np.array([size, 1])
    return SharedSides(
        edges=np.stack([low[one], high[one]], axis=1),
        faces=np.stack([one // 3, other // 3], axis=1),
        on_chain=np.isin(keys[one], wanted),
    )
