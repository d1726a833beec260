"""Sorts and groups arrays as large as a mesh, and finds connected components."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping

import nicmm_kernels
import numpy as np

from ..progress import checkpoint
from .array_types import FloatArray, IntArray


def grouped(keys: IntArray | FloatArray) -> tuple[IntArray, IntArray, IntArray]:
    """Sort keys into groups of equal keys.

    Parameters
    ----------
    keys : (n,) array
        Keys without NaN.

    Returns
    -------
    (n,) int array
        Indices that sort the keys; equal keys stay in their order.
    (g,) int array
        Position in that order at which each group begins.
    (g,) int array
        Number of keys in each group.
    """
    order = np.argsort(keys, kind="stable")
    checkpoint()
    in_order = keys[order]
    start = np.flatnonzero(np.append(True, in_order[1:] != in_order[:-1])[: len(keys)])
    return order, start, np.diff(start, append=len(keys))


def distinct_rows(rows: IntArray | FloatArray) -> tuple[IntArray, IntArray]:
    """Group equal rows.

    The results are those of ``return_index`` and ``return_inverse`` in ``np.unique(rows, axis=0)``.
    This function is many times faster.

    Parameters
    ----------
    rows : (n, d) array
        Rows without NaN.

    Returns
    -------
    (g,) int array
        Index of the first row of each group; the groups are in the lexicographic order of the rows.
    (n,) int array
        Index of the group of each row.
    """
    first = number = np.zeros(len(rows), dtype=np.int64)
    for column in rows.T:
        _, of_column = np.unique(column, return_inverse=True)
        checkpoint()
        keys = number * (len(rows) + 1) + of_column
        _, first, number = np.unique(keys, return_index=True, return_inverse=True)
        checkpoint()
    return first, number


def components(size: int, one: IntArray, other: IntArray) -> tuple[int, IntArray]:
    """Connected components of an undirected graph.

    Parameters
    ----------
    size : int
        Number of nodes.
    one, other : (m,) int array
        Nodes at the two ends of each arc.

    Returns
    -------
    int
        Number of components.
    (size,) int array
        Index of the component of each node; components are in the order of their first nodes.
    """
    return nicmm_kernels.connected_components(
        size,
        np.ascontiguousarray(one, np.int64),
        np.ascontiguousarray(other, np.int64),
        checkpoint,
    )


def first_of_components(size: int, one: IntArray, other: IntArray) -> IntArray:
    """For each node of an undirected graph the first node of its component, (size,).

    The parameters are those of `components`.
    """
    _, label = components(size, one, other)
    return np.unique(label, return_index=True)[1][label]


def occurrences(keys: IntArray, wanted: IntArray) -> tuple[IntArray, IntArray]:
    """Find every occurrence of some keys among others.

    Parameters
    ----------
    keys : (n,) int array
        Keys, which may occur several times.
    wanted : (m,) int array
        Keys to find.

    Returns
    -------
    (p,) int array
        Index of the wanted key of each occurrence, ascending.
    (p,) int array
        Index of the occurrence among the keys.
    """
    order = np.argsort(keys, kind="stable")
    in_order = keys[order]
    begin = np.searchsorted(in_order, wanted, side="left")
    count = np.searchsorted(in_order, wanted, side="right") - begin
    which = np.repeat(np.arange(len(wanted)), count)
    place = np.arange(len(which)) + np.repeat(begin - (np.cumsum(count) - count), count)
    return which, order[place]


def path_between(previous: IntArray | Mapping[int, int], start: int, end: int) -> list[int]:
    """Nodes of a shortest path, from the predecessors that a search from ``start`` has found."""
    path = [end]
    while path[-1] != start:
        path.append(int(previous[path[-1]]))
    return path[::-1]


def shortest_chain(
    start: int, neighbours: Callable[[int], Iterable[int]], is_end: Callable[[int], bool]
) -> list[int]:
    """Nodes of a path of the fewest arcs from a node to an end; empty without one."""
    previous = {start: start}
    queue = [start]
    for node in queue:
        if is_end(node):
            return path_between(previous, start, node)
        for beyond in neighbours(node):
            if beyond not in previous:
                previous[beyond] = node
                queue.append(beyond)
    return []
