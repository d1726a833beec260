"""Hops: straight ways over a surface between two places that are close to each other.

A hop has the direction and the length of the straight way along the surface, also around thin
limbs, where the straight line in space leads through them.
"""

from __future__ import annotations

from dataclasses import dataclass

import nicmm_kernels
import numpy as np

from ..geometry import tolerances
from ..geometry.array_types import BoolArray, FloatArray, IntArray
from ..geometry.surface_points import SurfacePoints
from ..geometry.tracing import strictly_inside, trace_from
from ..geometry.vectors import dot, lengths, unit
from ..progress import checkpoint
from ..relaxation.curve_nodes import CurveSurface

HOPS = 20
"""Number of hops from a place to its nearest places, before the reverse hops are added."""

REACH = 4.2
"""Greatest length of a hop, in square roots of the area per cell."""

DETOUR = 1.05
"""Length of the path along edges, relative to the straight way, from which the straight way may
lead across a hole, an obstacle or a boundary.

Along a boundary that turns by less than 60° the path is shorter. There the hop is kept.
"""


@dataclass(frozen=True)
class Hops:
    """Directed hops between cells or other places.

    Attributes
    ----------
    start, end : (m,) int array
        Places at the start and at the end of each hop.
    length : (m,) float array
    leaving, arriving : (m, 3) float array
        Unit tangents at the start and at the end.
    """

    start: IntArray
    end: IntArray
    length: FloatArray
    leaving: FloatArray
    arriving: FloatArray

    @property
    def reversed(self) -> Hops:
        """The same hops in the opposite direction."""
        return Hops(self.end, self.start, self.length, -self.arriving, -self.leaving)


def hops_from(
    surface: CurveSurface,
    at: SurfacePoints,
    places: nicmm_kernels.HopPlaces,
    first: int,
    spacing: float,
) -> Hops:
    """Hops from places to the nearest other ones, sorted by their starts.

    Parameters
    ----------
    surface : CurveSurface
    at : SurfacePoints
        Cells, then control points, as points of faces.
    places : HopPlaces
        The same, as compiled kernels read them.
    first : int
        Index of the first place from which hops are wanted.
    spacing : float
        Square root of the area per cell.
    """
    mesh = surface.mesh
    normals = np.ascontiguousarray(surface.vertex_normals)
    found = nicmm_kernels.surface_hops(
        mesh.edge_graph, normals, places, first, HOPS, REACH * spacing, checkpoint
    )
    in_space = lengths((places.positions[found.end] - places.positions[found.start]).T)
    # The bending at a hop without length would be infinite.
    shortest = np.maximum(in_space, tolerances.SAME_POSITION * mesh.diagonal)
    length = np.maximum(lengths(found.leaving.T), shortest)
    leaving, arriving = unit(found.leaving.T).T, unit(found.arriving.T).T
    kept = ~_across_boundary(surface, at[found.start], leaving, length, found.distance)
    return Hops(found.start[kept], found.end[kept], length[kept], leaving[kept], arriving[kept])


def _across_boundary(
    surface: CurveSurface,
    start: SurfacePoints,
    direction: FloatArray,
    length: FloatArray,
    along_edges: FloatArray,
) -> BoolArray:
    """Which straight ways lead across a boundary, although paths along edges lead around it."""
    mesh, across = surface.mesh, np.zeros(len(length), dtype=bool)
    if (mesh.face_neighbours >= 0).all():
        return across
    around = np.flatnonzero(along_edges > DETOUR * length)
    begin = start[around]
    begin = SurfacePoints(begin.faces, strictly_inside(begin.barycentric))
    _, across[around], _ = trace_from(
        mesh, begin, direction[around], length[around], surface.folded
    )
    return across


def in_both_directions(hops: Hops, size: int) -> tuple[Hops, IntArray]:
    """Hops between places 0 … size - 1 and their reverses, sorted by their starts and ends.

    A hop that is found from both of its ends is the mean of both.

    Returns
    -------
    Hops
        m hops.
    (m,) int array
        Index of the reverse of each hop.
    """
    both = joined_hops([hops, hops.reversed])
    key, place = np.unique(both.start * size + both.end, return_inverse=True)
    start, end = key // size, key % size

    def mean(values: FloatArray) -> FloatArray:
        result: FloatArray = np.bincount(place, values) / np.bincount(place)
        return result

    leaving, arriving = (
        unit(np.stack([mean(axis) for axis in each.T])).T for each in (both.leaving, both.arriving)
    )
    found = Hops(start, end, mean(both.length), leaving, arriving)
    return found, np.searchsorted(key, end * size + start)


def joined_hops(parts: list[Hops]) -> Hops:
    """Concatenate hops."""
    return Hops(
        *(
            np.concatenate([getattr(part, name) for part in parts])
            for name in ("start", "end", "length", "leaving", "arriving")
        )
    )


def continuations(ends: IntArray, first: IntArray) -> tuple[IntArray, IntArray]:
    """All pairs of a hop and an item of the cell where the hop ends, by the indices of both.

    Parameters
    ----------
    ends : (p,) int array
        Cell at which each hop ends.
    first : (cells + 1,) int array
        Index of the first item of each cell, and the number of items at the end. Items are sorted
        by cell; they may be the hops that start there.
    """
    count = first[ends + 1] - first[ends]
    hop = np.repeat(np.arange(len(ends)), count)
    place = np.arange(len(hop)) - np.repeat(np.cumsum(count) - count, count)
    return hop, first[ends[hop]] + place


def turning(one: Hops, before: IntArray, other: Hops, after: IntArray) -> FloatArray:
    """Turning angle θ from hops to their continuations, in radians, 0 … π."""
    arriving, leaving = one.arriving.take(before, axis=0), other.leaving.take(after, axis=0)
    return np.arccos(dot(arriving.T, leaving.T).clip(-1.0, 1.0))


def mean_length(one: Hops, before: IntArray, other: Hops, after: IntArray) -> FloatArray:
    """h, the mean lengths of hops and their continuations; never zero."""
    step = 0.5 * (one.length[before] + other.length[after])
    return np.maximum(step, tolerances.TINY)


def bending(one: Hops, before: IntArray, other: Hops, after: IntArray) -> FloatArray:
    """θ² / h from hops to their continuations."""
    turn = turning(one, before, other, after)
    return turn**2 / mean_length(one, before, other, after)
