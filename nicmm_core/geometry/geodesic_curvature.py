"""Geodesic curvature of a polyline on a surface."""

from __future__ import annotations

import numpy as np

from .array_types import FloatArray


def geodesic_curvature(points: FloatArray, normals: FloatArray, closed: bool = True) -> FloatArray:
    """Geodesic curvature at the points of a polyline on a surface (Eq. 10).

    Parameters
    ----------
    points : (n, 3) float array
        Evenly spaced points, see `resample`. Otherwise the values at short segments are noise.
    normals : (n, 3) float array
        Unit surface normals at the points.
    closed : bool, default True
        Whether the last point is joined to the first.

    Returns
    -------
    (n,) float array
        Signed curvature, in 1/length: ``2 sin θ / |r(i+1) - r(i-1)|`` in the tangent plane at r(i).
        It is positive where the curve turns left, seen from the tip of the normal, and zero at the
        ends of an open polyline.
    """
    if not closed:
        return np.pad(_turns(points[:-2], points[1:-1], points[2:], normals[1:-1]), 1)
    return _turns(np.roll(points, 1, axis=0), points, np.roll(points, -1, axis=0), normals)


def _turns(
    previous: FloatArray, points: FloatArray, following: FloatArray, normals: FloatArray
) -> FloatArray:
    """Geodesic curvature at points that have two neighbours each, (n,)."""
    before, after = previous - points, following - points
    before -= (before * normals).sum(axis=1, keepdims=True) * normals
    after -= (after * normals).sum(axis=1, keepdims=True) * normals
    across = np.linalg.norm(after - before, axis=1)
    lengths = np.linalg.norm(before, axis=1) * np.linalg.norm(after, axis=1)
    sine = (np.cross(-before, after) * normals).sum(axis=1) / lengths
    return 2.0 * sine / across
