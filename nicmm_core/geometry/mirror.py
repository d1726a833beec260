"""A mirror plane, and which control points are mirror images of which."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from ..errors import ArgumentError
from .array_types import FloatArray, IntArray
from .mesh import Mesh, real_array

ON_PLANE = 1e-6
"""Distance from the plane, in bounding-box diagonals, up to which a control point is on it."""

ROUNDED = 1e-10
"""Unit to which planes on copies of the mesh are rounded, far coarser than rounding errors."""

AXES = ["X", "Y", "Z"]

_FORM = "pass a point of the plane and its normal, such as ((0, 0, 0), (1, 0, 0))"


@dataclass(frozen=True, eq=False)
class Plane:
    """A plane.

    Attributes
    ----------
    point : (3,) float array
    normal : (3,) float array
        A unit vector.
    """

    point: FloatArray
    normal: FloatArray

    def heights(self, positions: FloatArray) -> FloatArray:
        """Signed distances of positions, (n, 3), from the plane, (n,)."""
        heights: FloatArray = (positions - self.point) @ self.normal
        return heights

    def reflected(self, positions: FloatArray) -> FloatArray:
        """The mirror images of positions, (n, 3)."""
        return positions - 2.0 * self.heights(positions)[:, None] * self.normal


@dataclass(frozen=True, eq=False)
class Mirror:
    """The plane of a symmetric curve, and the images of its control points.

    Attributes
    ----------
    plane : Plane
        Its normal points to the side of the points that the caller has given.
    image : (n,) int array
        For each control point of the whole curve, the index of its mirror image. A point on the
        plane is its own image.
    side : (n,) int array
        1 for the points that the caller has given, -1 for their images, 0 for points on the plane.
    """

    plane: Plane
    image: IntArray
    side: IntArray

    def mapped(self, positions: Callable[[FloatArray], FloatArray], diagonal: float) -> Mirror:
        """The mirror on a copy of the mesh, rounded, so that it depends on the surface only.

        Parameters
        ----------
        positions : callable
            Maps positions, (n, 3), to the copy by a similarity.
        diagonal : float
            Diagonal of the copy.
        """
        here, ahead = positions(np.stack([self.plane.point, self.plane.point + self.plane.normal]))
        normal = np.round((ahead - here) / np.linalg.norm(ahead - here) / ROUNDED) * ROUNDED
        normal /= np.linalg.norm(normal)
        unit = ROUNDED * diagonal
        return replace(self, plane=Plane(np.round(here @ normal / unit) * unit * normal, normal))


def checked_plane(name: str, given: Any, mesh: Mesh) -> Plane:
    """Convert a point and a normal to a plane, or raise ArgumentError.

    The point of the result is that nearest to the centre of the bounding box of the mesh.
    """
    try:
        values = real_array(given)
    except (TypeError, ValueError) as error:
        raise ArgumentError(f"{name} cannot be read as numbers ({error}); {_FORM}") from error
    if values.shape != (2, 3):
        raise ArgumentError(f"{name} has shape {values.shape}, not (2, 3); {_FORM}")
    if not np.isfinite(values).all():
        raise ArgumentError(f"{name} is {values.tolist()}, with NaN or infinity; {_FORM}")
    point, normal = values
    greatest = np.abs(normal).max()
    if greatest == 0.0:
        raise ArgumentError(f"{name} has the normal (0, 0, 0); {_FORM}")
    normal = normal / greatest  # its square might overflow or vanish
    normal = normal / np.linalg.norm(normal)
    corners = mesh.vertices[mesh.referenced]
    centre = 0.5 * (corners.min(axis=0) + corners.max(axis=0))
    return Plane(centre - ((centre - point) @ normal) * normal, normal)


def parse_plane(text: str | None) -> FloatArray | None:
    """Parse the plane of the command line: ``"X"``, or six numbers such as ``"0,0,0,1,0,0"``.

    Returns
    -------
    (2, 3) float array or None
        A point of the plane and its normal; None if there is no text.

    Raises
    ------
    ArgumentError
        If the text has another form.
    """
    if text is None:
        return None
    if text.upper() in AXES:
        return np.stack([np.zeros(3), np.eye(3)[AXES.index(text.upper())]])
    try:
        return np.array([float(number) for number in text.split(",")]).reshape(2, 3)
    except ValueError as error:
        raise ArgumentError(
            f"--mirror is {text!r}; give X, Y or Z, or a point of the plane and its normal, such "
            "as 0,0,0,1,0,0"
        ) from error
