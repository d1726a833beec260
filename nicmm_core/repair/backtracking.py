"""Removes the points at which a polyline turns back along an edge.

Where thin faces were removed, points of a curve that crossed them in turn lie on one edge, and
rounding may change their order along it. The polyline would then touch itself.
"""

from __future__ import annotations

import numpy as np

from ..geometry.array_types import BoolArray, IntArray
from ..geometry.mesh import Mesh
from ..geometry.surface_points import SurfacePoints


def without_backtracking(
    mesh: Mesh, polyline: SurfacePoints, kept: IntArray, closed: bool
) -> tuple[SurfacePoints, IntArray]:
    """Remove points at which a polyline turns back along an edge.

    Parameters
    ----------
    mesh : Mesh
    polyline : SurfacePoints
        n points, each in the face of the segment that begins there.
    kept : (k,) int array
        Indices of points that stay, such as control points.
    closed : bool
        Whether the last point is joined to the first.

    Returns
    -------
    SurfacePoints
        The m points that remain.
    (n,) int array
        Index of each point among those that remain; that of the next one if it was removed.
    """
    which = np.arange(len(polyline))
    free = np.ones(len(which), dtype=bool)
    free[kept] = False
    if not closed:
        free[[0, -1]] = False
    while len(which) > 3:
        turning = np.flatnonzero(_turns_back(mesh, polyline[which]) & free[which])
        if not len(turning):
            break
        which = np.delete(which, turning[0])
    return polyline[which], np.searchsorted(which, np.arange(len(polyline))) % len(which)


def _turns_back(mesh: Mesh, polyline: SurfacePoints) -> BoolArray:
    """Whether the polyline arrives at and leaves each point, (n,), on the same side of an edge."""
    corners, weights = mesh.faces[polyline.faces], polyline.barycentric
    triple = np.stack([np.roll(np.arange(len(corners)), shift) for shift in (1, 0, -1)])
    corners, weights = corners[triple], weights[triple]  # (3, n, 3)
    end = np.where(weights > 0.0, corners, -1).max(axis=(0, 2))
    start = np.where(weights > 0.0, corners, end[:, None]).min(axis=(0, 2))
    at_end = corners == end[:, None]
    on_edge = at_end | (corners == start[:, None]) | (weights <= 0.0)
    share = np.where(at_end, weights, 0.0).sum(axis=2)
    result: BoolArray = on_edge.all(axis=(0, 2)) & (
        (share[1] - share[0]) * (share[2] - share[1]) < 0.0
    )
    return result
