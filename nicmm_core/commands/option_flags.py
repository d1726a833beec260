"""The options of a curve as flags of a command, derived from the table of options."""

from __future__ import annotations

import argparse
import math
from collections.abc import Sequence
from typing import Any

from .. import options
from ..errors import ArgumentError
from ..geometry.array_types import FloatArray
from ..geometry.mesh import Mesh
from ..geometry.mirror import parse_plane
from ..io.files import read_curve
from ..maps.feature_maps import SHARP_ANGLE, curvature_map, sharp_edge_map
from ..options import Kind, Option
from ..path.via_points import parse_via_points

AUTOMATIC = ("sharp", "curvature")
"""Maps that can be computed from the mesh alone."""


def add_options(parser: argparse.ArgumentParser, without: Sequence[str] = ()) -> None:
    """Add a flag for every option of `design_curve`, except for some names of options."""
    for option in options.OPTIONS:
        if option.name in without:
            continue
        name = option.flag or option.name
        flags = dict.fromkeys((f"--{name.replace('_', '-')}", f"--{name}"))
        parser.add_argument(*flags, dest=option.name, **_flag(option))
    parser.add_argument(
        "--angle",
        type=float,
        help="least angle between face normals at a sharp edge, in degrees (default: 30)",
    )


def option_values(given: argparse.Namespace, mesh: Mesh) -> dict[str, Any]:
    """The values of all options, in the form that `design_curve` accepts."""
    return {
        option.name: _value(option, given, mesh)
        for option in options.OPTIONS
        if hasattr(given, option.name)
    }


def indices(flag: str, text: str, what: str, example: str) -> list[int]:
    """Parse indices separated by commas."""
    try:
        return [int(index) for index in text.split(",")]
    except ValueError as error:
        raise ArgumentError(
            f"--{flag} is {text!r}; give {what} separated by commas, such as {example}"
        ) from error


def _flag(option: Option) -> dict[str, Any]:
    """Keyword arguments of ``add_argument`` for an option."""
    words = f"{option.description[:1].lower()}{option.description[1:]}"
    if option.kind is Kind.SWITCH:
        return {"action": f"store_{str(not option.default).lower()}", "help": f"do not {words}"}
    if option.kind is Kind.CHOICE:
        return {"choices": option.names, "default": option.default, "help": words}
    if option.kind is Kind.WEIGHTS:
        source = "computed from sharp edges or from curvature"
        return {"choices": AUTOMATIC, "help": f"{source}. {option.description}"}
    if option.kind is Kind.POINTS:
        return {
            "action": "append",
            "default": [],
            "metavar": "I:A,B",
            "help": "vertices near which the curve runs after the I-th of the points, from 0; "
            "repeatable",
        }
    if option.kind is Kind.CURVES:
        return {
            "action": "append",
            "default": [],
            "metavar": "CURVE.json",
            "help": f"{words}; written with -o CURVE.json; repeatable",
        }
    if option.kind is Kind.INDICES:
        return {"metavar": "I,J", "help": f"{words}, by their places in --points, from 0"}
    if option.kind is Kind.PLANE:
        return {
            "metavar": "X|Y|Z|PLANE",
            "help": f"{words}. An axis, for the plane through the origin at right angles to it, or "
            "a point of the plane and its normal, such as 0,0,0,1,0,0",
        }
    number = int if option.kind is Kind.COUNT else float
    return {"type": number, "default": option.default, "help": words}


def _value(option: Option, given: argparse.Namespace, mesh: Mesh) -> Any:
    """The parsed value of an option in the form that `design_curve` accepts."""
    value = getattr(given, option.name)
    if option.kind is Kind.POINTS:
        return parse_via_points(value) or None
    if option.kind is Kind.CURVES:
        return [read_curve(path) for path in value] or None
    if option.kind is Kind.INDICES:
        what = "indices of control points"
        return None if value is None else indices(option.name, value, what, "0,2")
    if option.kind is Kind.WEIGHTS:
        return _automatic_map(mesh, value, given.angle)
    if option.kind is Kind.PLANE:
        return parse_plane(value)
    return value


def _automatic_map(mesh: Mesh, kind: str | None, degrees: float | None) -> FloatArray | None:
    if kind == "sharp":
        return sharp_edge_map(mesh, SHARP_ANGLE if degrees is None else math.radians(degrees))
    return None if kind is None else curvature_map(mesh)
