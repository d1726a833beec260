"""Draw curves at a distance from a curve along the surface.

Examples
--------
  nicmm design body.obj --points 12,80,41 -o hem.json
  nicmm offset body.obj hem.json --distance 0.05 --distance=-0.05 -o parallel.obj
"""

from __future__ import annotations

import argparse
import sys

from ..designer import Designer
from ..errors import ArgumentError
from ..io.files import check_curve_path, read_curve, read_mesh, write_curve
from .paths import add_curve, add_mesh, add_output, numbered


def add(parser: argparse.ArgumentParser) -> None:
    """Describe the arguments."""
    add_mesh(parser)
    add_curve(parser)
    parser.add_argument(
        "--distance",
        action="append",
        required=True,
        metavar="D|D,D,D",
        help="along the surface, positive to the left, negative to the right; with commas one "
        "distance for each control point; repeatable. Write --distance=-1 for a negative one",
    )
    add_output(parser)


def run(given: argparse.Namespace) -> None:
    """Write the curves at each distance."""
    check_curve_path(given.output)
    designer = Designer(read_mesh(given.mesh))
    distances = [_lengths(text) for text in given.distance]
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


def _lengths(text: str) -> float | list[float]:
    """Parse a length, or several separated by commas."""
    try:
        found = [float(number) for number in text.split(",")]
    except ValueError as error:
        raise ArgumentError(
            f"--distance is {text!r}; give a length, or lengths separated by commas, such as "
            "0.1,0.2"
        ) from error
    return found if len(found) > 1 else found[0]
