"""Determines on which side of a curve each vertex, or each face, of a surface lies.

Two vertices or faces lie on the same side if a path between them crosses the curve an even number
of times. If a closed path crosses the curve an odd number of times, the curve bounds no region on
that component.
"""

from __future__ import annotations

import numpy as np

from .array_types import BoolArray, IntArray
from .grouping import components


def two_sides(count: int, neighbours: IntArray, crossed: BoolArray) -> tuple[IntArray, IntArray]:
    """Find the connected components of a surface, and the two sides of a curve in each.

    Parameters
    ----------
    count : int
        Number of elements, which are vertices or faces.
    neighbours : (m, 2) int array
        Pairs of adjacent elements.
    crossed : (m,) bool array
        Whether the curve passes between each pair an odd number of times.

    Returns
    -------
    (count,) int array
        Label of the component of each element; the labels are not consecutive.
    (count,) int array
        Side of each element, 1 or -1; 0 in components in which the two sides are connected.
    """
    one, other = neighbours.T
    odd = crossed.astype(np.int64)
    # The double cover: the graph has two nodes for each element, one for either side.
    rows = np.concatenate([one, one + count])
    columns = np.concatenate([other + odd * count, other + (1 - odd) * count])
    _, label = components(2 * count, rows, columns)
    here, there = label[:count], label[count:]
    return np.minimum(here, there), np.sign(there - here)
