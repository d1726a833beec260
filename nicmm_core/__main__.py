"""Command line: ``python -m nicmm_core design | offset | pretrain | shapes``."""

from __future__ import annotations

import argparse
import json
import math
import sys
from pathlib import Path
from typing import Any

from . import Designer, Status, design_curve, options
from .errors import ArgumentError, MissingPackageError, NicmmError
from .geometry.array_types import FloatArray
from .geometry.mesh import Mesh
from .geometry.mirror import parse_plane
from .io.files import check_curve_path, read_curve, read_mesh, write_curve, write_mesh
from .maps.feature_maps import SHARP_ANGLE, curvature_map, sharp_edge_map
from .options import Kind, Option
from .path.via_points import parse_via_points

AUTOMATIC = ("sharp", "curvature")
"""Maps that can be computed from the mesh alone."""


def main(arguments: list[str] | None = None) -> int:
    """Run a command and return the exit status: 0, or 2 after a message on standard error."""
    given = _parser().parse_args(arguments)
    try:
        given.run(given)
    except NicmmError as error:
        print(f"nicmm: {error}", file=sys.stderr)
        return 2
    return 0


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="python -m nicmm_core", description="Smooth curves on triangle meshes."
    )
    commands = parser.add_subparsers(required=True, metavar="COMMAND")

    design = commands.add_parser("design", help="design a curve through vertices of a mesh")
    design.add_argument("mesh", metavar="MESH", help="OBJ, OFF, PLY or STL")
    design.add_argument("--points", required=True, metavar="A,B,C", help="vertex indices, from 0")
    design.add_argument("-o", "--output", required=True, help="curve.obj, .json or .csv")
    for option in options.OPTIONS:
        name = option.flag or option.name
        flags = dict.fromkeys((f"--{name.replace('_', '-')}", f"--{name}"))
        design.add_argument(*flags, dest=option.name, **_flag(option))
    design.add_argument(
        "--angle",
        type=float,
        help="least angle between face normals at a sharp edge, in degrees (default: 30)",
    )
    design.add_argument(
        "--measures",
        action="store_true",
        help="print lengths, enclosed area, least radius, greatest slope and distance from "
        "obstacles as JSON on standard output, one line for each curve",
    )
    design.set_defaults(run=_design)

    offset = commands.add_parser("offset", help="curves at a distance from a curve")
    offset.add_argument("mesh", metavar="MESH", help="OBJ, OFF, PLY or STL")
    offset.add_argument("curve", metavar="CURVE.json", help="written by design with -o CURVE.json")
    offset.add_argument(
        "--distance",
        action="append",
        required=True,
        metavar="D|D,D,D",
        help="along the surface, positive to the left, negative to the right; with commas one "
        "distance for each control point; repeatable. Write --distance=-1 for a negative one",
    )
    offset.add_argument("-o", "--output", required=True, help="curve.obj, .json or .csv")
    offset.set_defaults(run=_offset)

    pretrain = commands.add_parser("pretrain", help="train the network (stage 1 of the paper)")
    pretrain.add_argument("meshes", nargs="+", metavar="MESH")
    pretrain.add_argument("-o", "--output", required=True, metavar="WEIGHTS.npz")
    pretrain.add_argument("--sets", type=int, default=1000, help="sets of control points in all")
    pretrain.add_argument("--epochs", type=int, default=10)
    pretrain.add_argument("--seed", type=int, default=0)
    pretrain.add_argument(
        "--maps", type=float, default=0.0, metavar="SHARE", help="share of sets with maps"
    )
    pretrain.add_argument("--no-attention", action="store_true", help="ablation: without ECA")
    pretrain.add_argument("--no-gating", action="store_true", help="ablation: without Light GLU")
    pretrain.set_defaults(run=_pretrain)

    shapes = commands.add_parser("shapes", help="write generated meshes to train on")
    shapes.add_argument("folder", metavar="FOLDER")
    shapes.add_argument("--count", type=int, default=20)
    shapes.set_defaults(run=_shapes)
    return parser


def _design(given: argparse.Namespace) -> None:
    check_curve_path(given.output)
    mesh = read_mesh(given.mesh)
    points = _indices("points", given.points, "vertex indices", "12,80,41")
    values = {option.name: _value(option, given, mesh) for option in options.OPTIONS}
    design = design_curve(mesh, points, **values)
    if design.status is Status.NOT_ONE_CURVE:
        raise NicmmError(str(design.status))
    for number, each in enumerate([design, *design.alternatives]):
        (curve,) = each.curves
        path = numbered(given.output, number)
        write_curve(path, curve)
        print(
            f"{len(points)} points, length {curve.length:g}, {each.status.name.lower()}: {path}",
            file=sys.stderr,
        )
        if given.measures:
            found = curve.measures(mesh, values["obstacles"], corners=values["corners"])
            if math.isinf(found["least_radius"]):
                found["least_radius"] = None  # JSON has no infinity
            print(json.dumps({"file": path, **found}))


def _offset(given: argparse.Namespace) -> None:
    check_curve_path(given.output)
    designer = Designer(read_mesh(given.mesh))
    distances = [_lengths("distance", text) for text in given.distance]
    found = designer.offset_curves(read_curve(given.curve), distances)
    number = 0
    for text, curves in zip(given.distance, found, strict=True):
        if not curves:
            print(f"distance {text}: no place on that side is so far away", file=sys.stderr)
        for curve in curves:
            path = numbered(given.output, number)
            write_curve(path, curve)
            print(f"distance {text}, length {curve.length:g}: {path}", file=sys.stderr)
            number += 1


def numbered(path: str, number: int) -> str:
    """Add the number of a further curve to a path: ``curve.obj`` becomes ``curve-1.obj``.

    The first curve has number 0 and keeps the path.
    """
    plain = Path(path)
    return str(plain.with_stem(f"{plain.stem}-{number}")) if number else path


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
        return None if value is None else _indices(option.name, value, what, "0,2")
    if option.kind is Kind.WEIGHTS:
        return _automatic_map(mesh, value, given.angle)
    if option.kind is Kind.PLANE:
        return parse_plane(value)
    return value


def _indices(flag: str, text: str, what: str, example: str) -> list[int]:
    """Parse indices separated by commas."""
    try:
        return [int(index) for index in text.split(",")]
    except ValueError as error:
        raise ArgumentError(
            f"--{flag} is {text!r}; give {what} separated by commas, such as {example}"
        ) from error


def _lengths(flag: str, text: str) -> float | list[float]:
    """Parse a length, or several separated by commas."""
    try:
        found = [float(number) for number in text.split(",")]
    except ValueError as error:
        raise ArgumentError(
            f"--{flag} is {text!r}; give a length, or lengths separated by commas, such as 0.1,0.2"
        ) from error
    return found if len(found) > 1 else found[0]


def _automatic_map(mesh: Mesh, kind: str | None, degrees: float | None) -> FloatArray | None:
    if kind == "sharp":
        return sharp_edge_map(mesh, SHARP_ANGLE if degrees is None else math.radians(degrees))
    return None if kind is None else curvature_map(mesh)


def _pretrain(given: argparse.Namespace) -> None:
    try:
        import torch  # noqa: F401
        from tqdm import tqdm
    except ImportError as error:
        raise MissingPackageError(
            f"pretrain needs PyTorch and tqdm, which cannot be imported ({error}); install them "
            "into this Python with 'pip install torch tqdm'"
        ) from error

    from .paper.network import NetworkConfig
    from .paper.pretraining import PretrainingConfig, pretrain

    bars: dict[str, tqdm] = {}

    def report(stage: str, done: int, total: int, loss: float) -> None:
        if stage not in bars:
            bars[stage] = tqdm(total=total, desc=stage, unit="set")
        bar = bars[stage]
        if loss:
            bar.set_postfix(loss=f"{loss:.4f}", refresh=False)
        bar.update(done - bar.n)
        if done == total:
            bar.close()

    pretrain(
        [read_mesh(path) for path in given.meshes],
        given.output,
        NetworkConfig(attention=not given.no_attention, gating=not given.no_gating),
        PretrainingConfig(
            sets=given.sets, epochs=given.epochs, map_share=given.maps, seed=given.seed
        ),
        progress=report,
    )


def _shapes(given: argparse.Namespace) -> None:
    from .shapes import creature

    folder = Path(given.folder)
    folder.mkdir(parents=True, exist_ok=True)
    for seed in range(given.count):
        write_mesh(folder / f"creature-{seed:03d}.obj", creature(seed))


if __name__ == "__main__":
    sys.exit(main())
