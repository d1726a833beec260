"""What a curve is asked for, checked and in one form, so that requests can be compared."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .geometry.array_types import FloatArray
from .geometry.surface_points import SurfacePoints
from .path.via_points import LocatedViaPoints


@dataclass(frozen=True)
class Request:
    """A curve on a mesh; nothing in it belongs to the caller.

    Attributes
    ----------
    points : SurfacePoints
        Control points.
    closed : bool
    order : {"given", "shortest"}
    via_points : dict
        From the index of a control point to points on the way to the next one.
    obstacles, alignment : (V,) float array or None
    clearance : float
        Distance from obstacles of weight 1.
    smoothness : float
    """

    points: SurfacePoints
    closed: bool
    order: str
    via_points: LocatedViaPoints
    obstacles: FloatArray | None
    alignment: FloatArray | None
    clearance: float
    smoothness: float

    @property
    def has_maps(self) -> bool:
        """Whether there is something to avoid or to follow."""
        return self.obstacles is not None or self.alignment is not None

    @property
    def named_points(self) -> dict[str, SurfacePoints]:
        """All points, by the argument that they come from."""
        via = {f"via_points[{key}]": points for key, points in self.via_points.items()}
        return {"control_points": self.points, **via}


def same_request(one: Request, other: Request) -> bool:
    """Whether requests do not differ at all."""
    return (
        one.closed == other.closed
        and one.order == other.order
        and one.clearance == other.clearance
        and one.smoothness == other.smoothness
        and _same_points(one.points, other.points)
        and one.via_points.keys() == other.via_points.keys()
        and all(_same_points(one.via_points[key], other.via_points[key]) for key in one.via_points)
        and _same_map(one.obstacles, other.obstacles)
        and _same_map(one.alignment, other.alignment)
    )


def _same_points(one: SurfacePoints, other: SurfacePoints) -> bool:
    faces = np.array_equal(one.faces, other.faces)
    return faces and np.array_equal(one.barycentric, other.barycentric)


def _same_map(one: FloatArray | None, other: FloatArray | None) -> bool:
    if one is None or other is None:
        return one is other
    return np.array_equal(one, other)
