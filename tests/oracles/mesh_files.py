"""Third-party meshes in collections beside the project."""

from __future__ import annotations

from pathlib import Path

from nicmm_core.io.files import MESH_FORMATS

COLLECTIONS = Path(__file__).resolve().parents[3] / "shared" / "meshes"
"""Third-party meshes are no part of the project; each has its own licence."""

INDEX = COLLECTIONS / "index.csv"
"""The list of them."""


def mesh_files(folder: str) -> list[Path]:
    """Mesh files of a collection, sorted; stops with a message if it has no such file."""
    root = COLLECTIONS / folder
    files = sorted(path for path in root.rglob("*") if path.suffix.lower() in MESH_FORMATS)
    if not files:
        raise SystemExit(f"There are no meshes in {root}; put the collection there")
    return files


def spread(files: list[Path], count: int) -> list[Path]:
    """About as many of the files, evenly spread."""
    return files[:: max(1, len(files) // count)][:count]
