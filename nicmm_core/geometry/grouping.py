"""Sorting, grouping and connected components of arrays of the size of a mesh."""

from __future__ import annotations

import numpy as np
from scipy import sparse
from scipy.sparse import csgraph

from ..progress import checkpoint
from .array_types import FloatArray, IntArray

LARGE = 2_000_000
"""Keys that are sorted at once: a fifth of a second, in which a design cannot be cancelled."""

SAMPLED = 64
"""Keys that are looked at for each part, to find where parts of about the same size begin."""


def stable_order(keys: IntArray | FloatArray) -> IntArray:
    """Indices that sort the keys, (n,); equal keys stay in their order.

    The same as ``np.argsort(keys, kind="stable")`` of keys without NaN, by parts where they are
    many: the parts hold keys of different sizes.
    """
    checkpoint()
    n_parts = -(-len(keys) // LARGE)
    if n_parts <= 1:
        return np.argsort(keys, kind="stable")
    sample = keys[:: max(1, len(keys) // (SAMPLED * n_parts))]
    bounds = np.quantile(sample, np.arange(1, n_parts) / n_parts)
    part = np.searchsorted(bounds, keys, side="right").astype(np.uint8)
    order = np.argsort(part, kind="stable")
    for inside in np.split(order, np.cumsum(np.bincount(part, minlength=n_parts))[:-1]):
        checkpoint()
        inside[:] = inside[np.argsort(keys[inside], kind="stable")]
    return order


def grouped(keys: IntArray | FloatArray) -> tuple[IntArray, IntArray, IntArray]:
    """Indices of equal keys, side by side.

    Parameters
    ----------
    keys : (n,) array
        Without NaN.

    Returns
    -------
    (n,) int array
        Indices that sort the keys; equal keys stay in their order.
    (g,) int array
        Where in that order each group of equal keys begins.
    (g,) int array
        How many keys each group has.
    """
    order = stable_order(keys)
    checkpoint()
    in_order = keys[order]
    start = np.flatnonzero(np.append(True, in_order[1:] != in_order[:-1])[: len(keys)])
    return order, start, np.diff(start, append=len(keys))


def distinct_rows(rows: IntArray | FloatArray) -> tuple[IntArray, IntArray]:
    """The first of each set of equal rows, and which set each row belongs to.

    The same as ``return_index`` and ``return_inverse`` of ``np.unique(rows, axis=0)``, which sorts
    rows as text and takes many times as long.

    Parameters
    ----------
    rows : (n, d) array
        Without NaN.

    Returns
    -------
    (g,) int array
        Indices, in the lexicographic order of the rows.
    (n,) int array
    """
    first = number = np.zeros(len(rows), dtype=np.int64)
    for column in rows.T:
        _, of_column = _distinct(column)
        first, number = _distinct(number * (len(rows) + 1) + of_column)
    return first, number


def _distinct(keys: IntArray | FloatArray) -> tuple[IntArray, IntArray]:
    """The first index of each key, ascending by key, and the number of each key among them."""
    order, start, count = grouped(keys)
    number = np.empty(len(keys), dtype=np.int64)
    number[order] = np.repeat(np.arange(len(start)), count)
    return order[start], number


def components(size: int, one: IntArray, other: IntArray) -> tuple[int, IntArray]:
    """Connected components of an undirected graph.

    Parameters
    ----------
    size : int
        Of nodes.
    one, other : (m,) int array
        The nodes at both ends of each arc.

    Returns
    -------
    int
        How many there are.
    (size,) int array
        Which one each node belongs to, numbered by their first nodes.
    """
    checkpoint()
    graph = sparse.csr_array((np.ones(len(one), dtype=np.int8), (one, other)), shape=(size, size))
    checkpoint()
    number, label = csgraph.connected_components(graph, directed=False)
    return int(number), label.astype(np.int64)
