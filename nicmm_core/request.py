"""What a curve is asked for, checked and in one form, so that requests can be compared."""

from __future__ import annotations

from dataclasses import dataclass, fields, replace
from typing import Any

import numpy as np

from .geometry.array_types import FloatArray
from .geometry.numbering import Renumbered
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
        From the index of a control point to points on the path to the next one.
    method : {"nicmm", "nicmm-paper", "variational"}
    smoothness : float
    obstacles : (V,) float array or None
    clearance : float
        Distance from obstacles of weight 1.
    alignment : (V,) float array or None
    """

    points: SurfacePoints
    closed: bool
    order: str
    via_points: LocatedViaPoints
    method: str
    smoothness: float
    obstacles: FloatArray | None
    clearance: float
    alignment: FloatArray | None
    alternatives: int

    @property
    def has_maps(self) -> bool:
        """Whether there is something to avoid or to follow."""
        return self.obstacles is not None or self.alignment is not None

    @property
    def named_points(self) -> dict[str, SurfacePoints]:
        """All points, by the argument that they come from."""
        via = {f"via_points[{key}]": points for key, points in self.via_points.items()}
        return {"control_points": self.points, **via}


def renumbered_request(there: Renumbered, request: Request) -> Request:
    """A request on the original of a renumbered mesh as one on that."""
    via_points = {key: there.points(points) for key, points in request.via_points.items()}
    return replace(
        request,
        points=there.points(request.points),
        via_points=via_points,
        obstacles=there.values(request.obstacles),
        alignment=there.values(request.alignment),
    )


def same_request(one: Request, other: Request) -> bool:
    """Whether requests do not differ at all."""
    return all(
        _same(getattr(one, field.name), getattr(other, field.name)) for field in fields(Request)
    )


def _same(one: Any, other: Any) -> bool:
    if isinstance(one, SurfacePoints) and isinstance(other, SurfacePoints):
        return _same(one.faces, other.faces) and _same(one.barycentric, other.barycentric)
    if isinstance(one, dict):
        return one.keys() == other.keys() and all(_same(one[key], other[key]) for key in one)
    return np.array_equal(one, other) if isinstance(one, np.ndarray) else bool(one == other)
