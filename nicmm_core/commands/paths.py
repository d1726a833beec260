"""Arguments that name files, which several commands have."""

from __future__ import annotations

import argparse
from pathlib import Path


def add_mesh(parser: argparse.ArgumentParser) -> None:
    """Add the mesh file."""
    parser.add_argument("mesh", metavar="MESH", help="OBJ, OFF, PLY or STL")


def add_curve(parser: argparse.ArgumentParser) -> None:
    """Add the file of a designed curve."""
    parser.add_argument("curve", metavar="CURVE.json", help="written by design with -o CURVE.json")


def add_output(parser: argparse.ArgumentParser) -> None:
    """Add the file of the curve to write."""
    parser.add_argument("-o", "--output", required=True, help="curve.obj, .json or .csv")


def numbered(path: str, number: int) -> str:
    """Add the number of a further curve to a path: ``curve.obj`` becomes ``curve-1.obj``.

    The first curve has number 0 and keeps the path.
    """
    plain = Path(path)
    return str(plain.with_stem(f"{plain.stem}-{number}")) if number else path
