"""Sorting, grouping and connected components of large arrays, part by part.

A single library call on an array of the size of a large mesh takes half a second, in which nobody
can be asked whether to go on, and most of these calls hold Python's lock, so that no other thread
could ask meanwhile. Here the same results come from calls on parts of `PART` entries at most, with
a `checkpoint` between. Arrays no longer than that are one part.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from scipy import sparse
from scipy.sparse import csgraph

from ..progress import checkpoint
from .array_types import FloatArray, IntArray

PART = 500_000
"""Entries of a part: a few hundredths of a second of sorting."""

FACES = 50_000
"""Faces of a part, about whose corners and sides more is found out than an order."""

SAMPLED = 64
"""Keys that are looked at for each part, to find where parts of about the same size begin."""


def stable_order(keys: IntArray | FloatArray) -> IntArray:
    """Indices that sort the keys, (n,); equal keys stay in their order.

    The same as ``np.argsort(keys, kind="stable")`` of keys without NaN.
    """
    n_parts = -(-len(keys) // PART)
    if n_parts <= 1:
        checkpoint()
        return np.argsort(keys, kind="stable")
    sample = np.sort(keys[:: max(1, len(keys) // (SAMPLED * n_parts))])
    bounds = sample[np.linspace(0, len(sample), n_parts, endpoint=False).astype(int)[1:]]
    checkpoint()
    # Of two bytes, which a radix sort puts in order.
    part = np.searchsorted(bounds, keys, side="right").astype(np.uint16)
    checkpoint()
    order = np.argsort(part, kind="stable")
    ends = np.cumsum(np.bincount(part, minlength=n_parts))
    for start, end in zip(ends - np.diff(ends, prepend=0), ends, strict=True):
        checkpoint()
        inside = order[start:end]
        order[start:end] = inside[np.argsort(keys[inside], kind="stable")]
    checkpoint()
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
    in_order = keys[order]
    checkpoint()
    begins = np.ones(len(keys), dtype=bool)
    np.not_equal(in_order[1:], in_order[:-1], out=begins[1:])
    checkpoint()
    start = np.flatnonzero(begins)
    count = np.diff(start, append=len(keys))
    checkpoint()
    return order, start, count


def distinct_rows(rows: IntArray | FloatArray) -> tuple[IntArray, IntArray]:
    """The first of each set of equal rows, and which set each row belongs to.

    The same as ``return_index`` and ``return_inverse`` of ``np.unique(rows, axis=0)``.

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
    checkpoint()
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
    root = np.arange(size)  # the first node of what each is known to be connected with
    number = np.empty(size, dtype=np.int64)
    for part in parts(len(one)):
        checkpoint()
        ends = root[one[part]], root[other[part]]
        named = np.zeros(size, dtype=bool)
        named[ends[0]] = named[ends[1]] = True
        nodes = np.flatnonzero(named)
        number[nodes] = np.arange(len(nodes))
        checkpoint()
        arcs = np.ones(len(ends[0]), dtype=np.int8), (number[ends[0]], number[ends[1]])
        graph = sparse.coo_array(arcs, shape=(len(nodes),) * 2)
        label = csgraph.connected_components(graph, directed=False)[1]
        checkpoint()
        first = nodes[np.unique(label, return_index=True)[1]]
        root[nodes] = first[label]
        checkpoint()
        root = root[root]
    is_root = root == np.arange(size)
    checkpoint()
    label = (np.cumsum(is_root) - 1)[root]
    checkpoint()
    return int(is_root.sum()), label


def parts(length: int, size: int | None = None) -> Iterator[slice]:
    """Slices of an array of some length, at most ``size`` entries each, `PART` if none is said."""
    step = PART if size is None else size
    for start in range(0, length, step):
        yield slice(start, start + step)
