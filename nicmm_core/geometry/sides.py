"""The two sides of a curve, among whatever a surface is made of: its vertices or its faces.

Two of these lie on the same side where a way leads from one to the other that crosses the curve an
even number of times. Where a way round the surface crosses it an odd number of times, the curve
bounds nothing there.
"""

from __future__ import annotations

import numpy as np
from scipy import sparse
from scipy.sparse import csgraph

from .array_types import BoolArray, IntArray


def two_sides(count: int, neighbours: IntArray, crossed: BoolArray) -> tuple[IntArray, IntArray]:
    """Parts that hang together, and the two sides in each.

    Parameters
    ----------
    count : int
        Of vertices, or of faces.
    neighbours : (m, 2) int array
        Which of them lie beside each other.
    crossed : (m,) bool array
        Whether the curve passes between them an odd number of times.

    Returns
    -------
    (count,) int array
        A number for each part.
    (count,) int array
        1 or -1; 0 in parts in which a way leads from one side to the other.
    """
    one, other = neighbours.T
    odd = crossed.astype(np.int64)
    # Each stands twice in the graph, once for either side.
    rows = np.concatenate([one, one + count])
    columns = np.concatenate([other + odd * count, other + (1 - odd) * count])
    graph = sparse.coo_array((np.ones(len(rows)), (rows, columns)), shape=(2 * count,) * 2)
    _, label = csgraph.connected_components(graph, directed=False)
    here, there = label[:count], label[count:]
    return np.minimum(here, there), np.sign(there - here)
