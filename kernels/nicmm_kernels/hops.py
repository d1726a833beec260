# SPDX-License-Identifier: GPL-3.0-or-later
"""Straight ways over a surface from a place to the places nearby."""

from __future__ import annotations

import ctypes
from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from .edge_paths import RESUMED, EdgeGraphArrays, EdgeGraphPointers
from .library import (
    COUNT,
    FLOAT,
    INT,
    NUMBER,
    POINTER,
    FloatArray,
    IntArray,
    Kernel,
    address,
    in_several_calls,
    rows,
)
from .traces import MeshPointers


class _Hops(ctypes.Structure):
    _fields_ = [
        ("place_count", COUNT),
        ("cell_count", COUNT),
        ("first", COUNT),
        ("most", COUNT),
        ("longest", NUMBER),
        ("corners", POINTER),
        ("positions", POINTER),
        ("normals", POINTER),
        ("vertex_normals", POINTER),
        ("counts", POINTER),
        ("ends", POINTER),
        ("distances", POINTER),
        ("leaving", POINTER),
        ("arriving", POINTER),
    ]


_ITEMS = Kernel("surface_hops_items", COUNT)
_SURFACE_HOPS = Kernel("surface_hops", MeshPointers, EdgeGraphPointers, _Hops, *RESUMED)


class HopPlaces(NamedTuple):
    """Places between which hops are searched for: first cells, then points of faces.

    Attributes
    ----------
    cells : int
        Number of cells, which are vertices.
    corners : (p, 3) int array
        Vertices of the face of each place; for a cell, three times its vertex.
    positions, normals : (p, 3) float array
        Positions, and unit normals of any sign.
    """

    cells: int
    corners: IntArray
    positions: FloatArray
    normals: FloatArray


class FoundHops(NamedTuple):
    """Hops by ascending start, those from one place by ascending distance.

    Attributes
    ----------
    start, end : (h,) int array
        Indices of places.
    distance : (h,) float array
        Distances along edges.
    leaving, arriving : (h, 3) float array
        The straight way in the tangent plane at the start, and turned to that at the end. Its
        length is the length of the hop.
    """

    start: IntArray
    end: IntArray
    distance: FloatArray
    leaving: FloatArray
    arriving: FloatArray


def surface_hops(
    graph: EdgeGraphArrays,
    vertex_normals: FloatArray,
    places: HopPlaces,
    first: int,
    most: int,
    longest: float,
    meanwhile: Callable[[], object],
) -> FoundHops:
    """Straight ways from places to the nearest other ones.

    Of several cells at the same distance, that of the lowest index is nearer.

    Parameters
    ----------
    graph : EdgeGraphArrays
    vertex_normals : (V, 3) float array
        Unit normals of any sign.
    places : HopPlaces
    first : int
        Index of the first place from which hops are wanted.
    most : int
        Number of hops that are wanted from each place.
    longest : float
        Distance along edges up to which places are searched for, in mesh units.
    meanwhile : callable
        Called between two calls of the kernel, at least after every `MOST_WORK` arcs.
    """
    p = rows("corners", places.corners)
    count = p - first
    counts, ends = np.zeros(count, dtype=np.int64), np.zeros((count, most), dtype=np.int64)
    distances, leaving, arriving = (np.zeros((count, most, *each)) for each in ((), (3,), (3,)))
    hops = _Hops(
        p, places.cells, first, most, longest,
        address("corners", places.corners, INT, p, 3),
        address("positions", places.positions, FLOAT, p, 3),
        address("normals", places.normals, FLOAT, p, 3),
        address("vertex_normals", vertex_normals, FLOAT, graph.vertex_count, 3),
        counts.ctypes.data, ends.ctypes.data, distances.ctypes.data, leaving.ctypes.data,
        arriving.ctypes.data,
    )  # fmt: skip
    scratch = np.empty(_ITEMS.result(graph.vertex_count))
    in_several_calls(
        _SURFACE_HOPS, count, (graph.mesh.pointers, graph.pointers, hops), scratch, meanwhile
    )
    found = np.arange(most) < counts[:, None]
    start = first + np.arange(count).repeat(counts)
    return FoundHops(start, ends[found], distances[found], leaving[found], arriving[found])
