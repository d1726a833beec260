"""A checked request for a curve, in one canonical form, so that requests can be compared."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, fields, is_dataclass, replace
from typing import Any

import numpy as np

from .geometry.array_types import BoolArray, FloatArray, IntArray
from .geometry.curve import SurfaceCurve
from .geometry.mirror import Mirror
from .geometry.surface_points import SurfacePoints
from .path.via_points import LocatedViaPoints


@dataclass(frozen=True)
class Request:
    """A request for a curve on a mesh; it shares no data with the caller.

    Attributes
    ----------
    points : SurfacePoints
        Control points; with a mirror, those that the caller has given, and then their images.
    closed : bool
    order : {"given", "shortest"}
    via_points : dict
        Points on the path to the next control point, by the index of the control point before.
    method : {"elastic", "nicmm", "variational"}
    smoothness : float
    corners : (c,) int array
        Indices of the control points at which the curve may turn freely, ascending.
    normal_bending : float
        Weight of the normal curvature, squared, in the bending energy.
    obstacles : (V,) float array or None
    clearance : float
        Least distance from obstacles of weight 1 and from curves to avoid, in mesh units.
    avoid : tuple of SurfaceCurve or None
        Curves on the given mesh that the curve does not cross; they are not mapped.
    alignment : (V,) float array or None
    mirror : Mirror or None
        The plane of a symmetric curve.
    alternatives : int
        Largest number of further curves along other courses.
    """

    points: SurfacePoints
    closed: bool
    order: str
    via_points: LocatedViaPoints
    method: str
    smoothness: float
    corners: IntArray
    normal_bending: float
    obstacles: FloatArray | None
    clearance: float
    avoid: tuple[SurfaceCurve, ...] | None
    alignment: FloatArray | None
    mirror: Mirror | None
    alternatives: int

    @property
    def has_maps(self) -> bool:
        """Whether there are obstacles or an alignment map."""
        return self.obstacles is not None or self.alignment is not None

    def are_corners(self, visited: IntArray) -> BoolArray:
        """Whether the curve may turn freely at control points, given by their indices, (n,)."""
        return np.isin(visited, self.corners)

    @property
    def named_points(self) -> dict[str, SurfacePoints]:
        """Control points and via points, by the argument that contains them."""
        via = {f"via_points[{key}]": points for key, points in self.via_points.items()}
        if self.mirror is None:
            return {"control_points": self.points, **via}
        count = int((self.mirror.side >= 0).sum())
        images = {"mirror images of control_points": self.points[count:]}
        return {"control_points": self.points[:count], **images, **via}


def mapped_request(
    request: Request,
    points: Callable[[SurfacePoints], SurfacePoints],
    weights: Callable[[FloatArray], FloatArray],
) -> Request:
    """Map a request to another mesh, by functions that map its points and its weights."""
    return replace(
        request,
        points=points(request.points),
        via_points={key: points(via) for key, via in request.via_points.items()},
        obstacles=None if request.obstacles is None else weights(request.obstacles),
        alignment=None if request.alignment is None else weights(request.alignment),
    )


def same_request(one: Request, other: Request) -> bool:
    """Whether two requests are equal in every field."""
    return _same(one, other)


def same_maps(one: Request, other: Request) -> bool:
    """Whether two requests have the same obstacles and the same alignment."""
    return _same(one.obstacles, other.obstacles) and _same(one.alignment, other.alignment)


def _same(one: Any, other: Any) -> bool:
    if is_dataclass(one) and type(one) is type(other):
        return all(
            _same(getattr(one, each.name), getattr(other, each.name)) for each in fields(one)
        )
    if isinstance(one, tuple) and isinstance(other, tuple):
        return len(one) == len(other) and all(map(_same, one, other))
    if isinstance(one, np.ndarray) or isinstance(other, np.ndarray):
        return np.array_equal(one, other)
    if isinstance(one, dict):
        return one.keys() == other.keys() and all(_same(one[key], other[key]) for key in one)
    return bool(one == other)
