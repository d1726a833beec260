"""Arguments of `design_curve` that need no mesh stage to be checked."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from .errors import ArgumentError, MissingPackageError
from .geometry.array_types import FloatArray
from .geometry.mesh import Mesh, real_array
from .path.initial_loop import ORDERS

METHODS = ("nicmm", "nicmm-paper", "variational")

SMOOTHNESS_RANGE = (1e-3, 1e3)


def check_choices(order: str, method: str) -> None:
    """Raise ArgumentError unless both are known."""
    if not isinstance(method, str) or method not in METHODS:
        raise ArgumentError(f"method is {method!r}; choose one of {', '.join(map(repr, METHODS))}")
    if not isinstance(order, str) or order not in ORDERS:
        raise ArgumentError(f"order is {order!r}; choose one of {', '.join(map(repr, ORDERS))}")


def check_closed(closed: bool) -> None:
    """Raise ArgumentError unless it says yes or no."""
    if not isinstance(closed, bool | np.bool_):
        raise ArgumentError(f"closed is {closed!r}; pass True or False")


def check_torch() -> None:
    """Raise MissingPackageError unless PyTorch can be imported."""
    try:
        import torch  # noqa: F401
    except ImportError as error:
        raise MissingPackageError(
            f'method "nicmm-paper" needs PyTorch, which cannot be imported ({error}); install it '
            "into this Python with 'pip install torch', or choose the method \"nicmm\""
        ) from error


def checked_vertex_values(name: str, values: ArrayLike, mesh: Mesh, kind: str) -> FloatArray:
    """One number a vertex, (V,), or an ArgumentError that names them; they may be infinite."""
    try:
        checked = real_array(values)
    except (TypeError, ValueError) as error:
        raise ArgumentError(f"{name} cannot be read as numbers ({error})") from error
    if checked.shape != (len(mesh.vertices),):
        raise ArgumentError(
            f"{name} has shape {checked.shape}; pass one {kind} a vertex, ({len(mesh.vertices)},)"
        )
    return checked


def checked_map(name: str, weights: ArrayLike | None, mesh: Mesh) -> FloatArray | None:
    """Weights in [0, 1] at the vertices, (V,), or an ArgumentError that names them."""
    if weights is None:
        return None
    checked = checked_vertex_values(name, weights, mesh, "weight")
    bad = ~((checked >= 0.0) & (checked <= 1.0))
    if bad.any():
        first = int(bad.argmax())
        raise ArgumentError(f"{name}[{first}] is {checked[first]}; weights must lie in 0 … 1")
    return checked


def checked_clearance(clearance: float, obstacles: FloatArray | None) -> float:
    """A length that is not negative, or an ArgumentError."""
    try:
        value = float(clearance)
    except (TypeError, ValueError, OverflowError) as error:
        raise ArgumentError(f"clearance is {clearance!r}; pass a length") from error
    if not 0.0 <= value < np.inf:
        raise ArgumentError(f"clearance is {clearance!r}; pass a length that is not negative")
    if value > 0.0 and obstacles is None:
        raise ArgumentError(f"clearance is {clearance!r} without obstacles to keep it from")
    return value


def checked_smoothness(smoothness: float) -> float:
    """A number in `SMOOTHNESS_RANGE`, or an ArgumentError."""
    try:
        value = float(smoothness)
    except (TypeError, ValueError, OverflowError) as error:
        raise ArgumentError(f"smoothness is {smoothness!r}; pass a positive number") from error
    low, high = SMOOTHNESS_RANGE
    if not low <= value <= high:
        raise ArgumentError(f"smoothness is {smoothness!r}; pass a number in {low:g} … {high:g}")
    return value
