"""Design a curve through vertices of a mesh.

Examples
--------
  nicmm design body.obj --points 12,80,41 -o collar.obj
  nicmm design body.obj --points 12,80,41 --open --alternatives 2 -o seam.json
  nicmm design part.stl --points 5,9,300 --alignment sharp --measures -o rim.csv
"""

from __future__ import annotations

import argparse
import json
import math
import sys

from ..design import design_curve
from ..errors import NicmmError
from ..io.files import check_curve_path, read_mesh, write_curve
from ..status import Status
from .option_flags import add_options, indices, option_values
from .paths import add_mesh, add_output, numbered


def add(parser: argparse.ArgumentParser) -> None:
    """Describe the arguments."""
    add_mesh(parser)
    parser.add_argument("--points", required=True, metavar="A,B,C", help="vertex indices, from 0")
    add_output(parser)
    add_options(parser)
    parser.add_argument(
        "--measures",
        action="store_true",
        help="print lengths, enclosed area, least radius, greatest slope and distance from "
        "obstacles as JSON on standard output, one line for each curve",
    )


def run(given: argparse.Namespace) -> None:
    """Design the curves, write them, and print a line on standard error for each."""
    check_curve_path(given.output)
    mesh = read_mesh(given.mesh)
    points = indices("points", given.points, "vertex indices", "12,80,41")
    values = option_values(given, mesh)
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
