"""Projects positions onto a mesh, for callers of the package.

Inside the package, `geometry.surface_points.nearest_points` does so without checks.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from .errors import ArgumentError
from .geometry import surface_points
from .geometry.array_types import FloatArray
from .geometry.mesh import MeshLike, as_mesh, real_array
from .geometry.surface_points import SurfacePoints


def nearest_points(mesh: MeshLike, positions: ArrayLike) -> tuple[SurfacePoints, FloatArray]:
    """Find the points of a mesh nearest to positions in space.

    The result can be passed as control points, for example of positions that were measured.

    Parameters
    ----------
    mesh : Mesh or object with `vertices` and `faces`
    positions : (k, 3) array_like of float
        Positions, which may be off the mesh.

    Returns
    -------
    SurfacePoints
        Nearest points. In a face without area, they are on its longest edge.
    (k,) float array
        Distances, in mesh units.

    Raises
    ------
    ArgumentError
        If the positions are no array of that shape, not finite, or too far away.
    MeshError
        If the arrays of another library's mesh are not those of a triangle mesh.

    Examples
    --------
    >>> from nicmm_core import nearest_points, shapes
    >>> points, distances = nearest_points(shapes.sphere(3), [[0.0, 0.0, 2.0], [0.0, 3.0, 0.0]])
    >>> distances.round(2)
    array([1., 2.])
    """
    points, distances = surface_points.nearest_points(as_mesh(mesh), _checked_positions(positions))
    if not np.isfinite(distances).all():
        first = int(np.argmin(np.isfinite(distances)))
        raise ArgumentError(f"positions[{first}] is too far from the mesh; pass positions near it")
    return points, distances


def _checked_positions(positions: ArrayLike) -> FloatArray:
    """Convert positions to floats, shape (k, 3), or raise ArgumentError."""
    try:
        checked = real_array(positions)
    except (TypeError, ValueError) as error:
        raise ArgumentError(f"positions cannot be read as numbers ({error})") from error
    if checked.ndim != 2 or checked.shape[1] != 3:
        raise ArgumentError(f"positions has shape {checked.shape}; pass three numbers per position")
    if not np.isfinite(checked).all():
        first = int(np.argmin(np.isfinite(checked).all(axis=1)))
        raise ArgumentError(f"positions[{first}] is NaN or infinite; pass finite positions")
    return checked
