"""Write generated meshes to train on.

Examples
--------
  nicmm shapes training-shapes --count 25
"""

from __future__ import annotations

import argparse
from pathlib import Path

from ..io.files import write_mesh
from ..shapes import creature


def add(parser: argparse.ArgumentParser) -> None:
    """Describe the arguments."""
    parser.add_argument("folder", metavar="FOLDER")
    parser.add_argument("--count", type=int, default=20)


def run(given: argparse.Namespace) -> None:
    """Write the meshes to the folder."""
    folder = Path(given.folder)
    folder.mkdir(parents=True, exist_ok=True)
    for seed in range(given.count):
        write_mesh(folder / f"creature-{seed:03d}.obj", creature(seed))
