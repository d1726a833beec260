"""Checks the arguments of public functions: options, numbers, weights and vertex values.

Every check raises an error that names the argument and says what to pass instead.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from . import options
from .errors import ArgumentError, CurveError
from .geometry import tolerances
from .geometry.array_types import FloatArray, IntArray
from .geometry.curve import SurfaceCurve, checked_curve, points_of
from .geometry.mesh import Mesh, real_array
from .geometry.mirror import checked_plane
from .options import Kind, Option


def checked_options(mesh: Mesh, given: Mapping[str, Any]) -> dict[str, Any]:
    """Check the options of a curve, each according to its kind.

    Parameters
    ----------
    mesh : Mesh
    given : mapping
        A value for the name of every option in `options.OPTIONS`.

    Returns
    -------
    dict
        The checked values by name, with weights as (V,) float arrays and curves as a tuple. Via
        points and indices are returned unchecked; `path.via_points` and `checked_corners` check
        them.

    Raises
    ------
    ArgumentError
        If a value is invalid, or if an option is set without the option or the method that it
        needs.
    CurveError
        If a curve does not lie on the mesh.
    """
    checked = {each.name: _checked(mesh, each, given[each.name]) for each in options.OPTIONS}
    for each in options.OPTIONS:
        value = checked[each.name]
        # Values of compound kinds may be arrays, which cannot be compared.
        is_set = value is not None if each.default is None else value != each.default
        missing = each.needs and all(checked[name] is None for name in each.needs)
        if missing and is_set:
            raise ArgumentError(
                f"{each.name} has no effect without {' or '.join(each.needs)}; pass both, or "
                f"leave {each.name} out"
            )
        if each.elastic_only and is_set and checked["method"] != "elastic":
            raise ArgumentError(
                f'{each.name} needs the method "elastic", not {checked["method"]!r}; leave one out'
            )
    return checked


def _checked(mesh: Mesh, option: Option, value: Any) -> Any:
    name = option.name
    if option.kind is Kind.SWITCH and not isinstance(value, bool | np.bool_):
        raise ArgumentError(f"{name} is {value!r}; pass True or False")
    if option.kind is Kind.CHOICE and not (isinstance(value, str) and value in option.names):
        words = ", ".join(map(repr, option.names))
        raise ArgumentError(f"{name} is {value!r}; choose one of {words}")
    if option.kind is Kind.WEIGHTS:
        return checked_map(name, value, mesh)
    if option.kind in (Kind.NUMBER, Kind.LENGTH):
        what = "a length" if option.kind is Kind.LENGTH else "a number"
        return number_between(name, value, *option.limits, what)
    if option.kind is Kind.COUNT:
        return _checked_count(option, value)
    if option.kind is Kind.CURVES:
        return _checked_curves(mesh, name, value)
    if option.kind is Kind.PLANE:
        return None if value is None else checked_plane(name, value, mesh)
    return value


def _checked_curves(mesh: Mesh, name: str, value: Any) -> tuple[SurfaceCurve, ...] | None:
    """Check that a list has only curves on the mesh.

    None and an empty list give None.
    """
    if value is None:
        return None
    if not isinstance(value, list | tuple):
        raise ArgumentError(
            f"{name} is a {type(value).__name__}; pass a list of SurfaceCurve or Design, or None"
        )
    found = []
    for number, given in enumerate(value):
        found.append(checked_surface_curve(mesh, f"{name}[{number}]", given))
    return tuple(found) or None


def checked_surface_curve(mesh: Mesh, name: str, given: Any) -> SurfaceCurve:
    """Check that a curve lies on a mesh.

    Raises
    ------
    ArgumentError
        If it is no curve.
    CurveError
        If it lies elsewhere.
    """
    if not isinstance(given, SurfaceCurve):
        raise ArgumentError(
            f"{name} is {given!r}; pass a SurfaceCurve, or a Design with exactly one curve"
        )
    try:
        curve, _ = checked_curve(mesh, given, across_gaps=True)
    except CurveError as error:
        raise CurveError(f"{name} cannot be used: {error}") from error
    away = np.abs(points_of(curve).positions(mesh) - curve.points).max()
    if not away <= tolerances.SAME_CURVE * mesh.diagonal:
        raise CurveError(
            f"{name} lies on another mesh: its points differ by up to {away:g} from the positions "
            "that their faces and barycentric coordinates give on this mesh; pass the mesh that it "
            "was designed on"
        )
    return curve


def checked_number(name: str, value: Any, what: str = "a finite number") -> float:
    """Convert a value to a finite float, or raise an ArgumentError that asks for ``what``."""
    try:
        number = float(value)
    except (TypeError, ValueError, OverflowError) as error:
        raise ArgumentError(f"{name} is {value!r}; pass {what}") from error
    if not np.isfinite(number):
        raise ArgumentError(f"{name} is {value!r}; pass {what}")
    return number


def number_between(name: str, value: Any, low: float, high: float, what: str = "a number") -> float:
    """Convert a value to a finite float within limits, or raise an ArgumentError that names them.

    Parameters
    ----------
    name : str
        Name of the argument.
    value : object
    low, high : float
        Limits, which are allowed values; `high` may be infinite.
    what : str
        What the number is, with an article.
    """
    wanted = what + _limits(low, high)
    number = checked_number(name, value, wanted)
    if not low <= number <= high:
        raise ArgumentError(f"{name} is {value!r}; pass {wanted}")
    return number


def _limits(low: float, high: float) -> str:
    return f" of at least {low:g}" if np.isinf(high) else f" in {low:g} … {high:g}"


def _checked_count(option: Option, value: Any) -> int:
    """Convert a value to an int within the limits of an option."""
    low, high = option.limits
    if not (_is_whole(value) and low <= value <= high):
        raise ArgumentError(
            f"{option.name} is {value!r}; pass a whole number{_limits(*option.limits)}"
        )
    return int(value)


def _is_whole(value: Any) -> bool:
    return isinstance(value, int | np.integer) and not isinstance(value, bool)


def checked_corners(corners: Any, count: int) -> IntArray:
    """Check the indices of corners among `count` control points; each once and ascending."""
    if corners is None:
        return np.zeros(0, dtype=np.int64)
    try:
        given = list(corners)
    except TypeError as error:
        raise ArgumentError(
            f"corners is {corners!r}; pass indices of control points, such as [0, 2]"
        ) from error
    for place, index in enumerate(given):
        if not (_is_whole(index) and 0 <= index < count):
            raise ArgumentError(
                f"corners[{place}] is {index!r}; pass the index of a control point, 0 … {count - 1}"
            )
    return np.unique(np.array(given, dtype=np.int64))


def check_iterations(max_iterations: Any) -> None:
    """Raise ArgumentError unless the limit is a positive whole number or None."""
    if max_iterations is not None and not (_is_whole(max_iterations) and max_iterations >= 1):
        raise ArgumentError(
            f"max_iterations is {max_iterations!r}; pass a positive whole number or None"
        )


def checked_vertex_values(name: str, values: ArrayLike, mesh: Mesh, kind: str) -> FloatArray:
    """Convert values to one float per vertex, shape (V,), or raise ArgumentError.

    The values may be infinite or NaN.
    """
    try:
        checked = real_array(values)
    except (TypeError, ValueError) as error:
        raise ArgumentError(f"{name} cannot be read as numbers ({error})") from error
    if checked.shape != (len(mesh.vertices),):
        raise ArgumentError(
            f"{name} has shape {checked.shape}; pass one {kind} per vertex, ({len(mesh.vertices)},)"
        )
    return checked


def checked_map(name: str, weights: ArrayLike | None, mesh: Mesh) -> FloatArray | None:
    """Convert weights to floats in [0, 1] at the vertices, (V,), or raise ArgumentError."""
    if weights is None:
        return None
    checked = checked_vertex_values(name, weights, mesh, "weight")
    bad = ~((checked >= 0.0) & (checked <= 1.0))
    if bad.any():
        first = int(bad.argmax())
        raise ArgumentError(f"{name}[{first}] is {checked[first]}; weights must lie in 0 … 1")
    return checked
