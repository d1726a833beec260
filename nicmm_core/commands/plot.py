"""Draw a mesh and curves on it as a picture; needs Matplotlib.

Examples
--------
  nicmm design body.obj --points 12,80,41 -o collar.json
  nicmm plot body.obj collar.json -o collar.png
"""

from __future__ import annotations

import argparse
import sys

from .. import plotting
from ..io.files import read_curve, read_mesh
from .paths import add_mesh


def add(parser: argparse.ArgumentParser) -> None:
    """Describe the arguments."""
    add_mesh(parser)
    parser.add_argument(
        "curves", nargs="*", metavar="CURVE.json", help="written by design with -o CURVE.json"
    )
    parser.add_argument("-o", "--output", required=True, help="curve.png, .svg or .pdf")


def run(given: argparse.Namespace) -> None:
    """Draw the picture."""
    curves = [read_curve(path) for path in given.curves]
    plotting.plot(read_mesh(given.mesh), curves, given.output)
    print(f"{len(curves)} curves: {given.output}", file=sys.stderr)
