"""Finds the third-party meshes, which are kept in collections outside the project."""

from __future__ import annotations

from pathlib import Path

from nicmm_core.io.files import MESH_FORMATS

COLLECTIONS = Path(__file__).resolve().parents[3] / "shared" / "meshes"
"""Folder of the third-party meshes, which are not part of the project; each has its licence."""

INDEX = COLLECTIONS / "index.csv"
"""List of the third-party meshes."""


def mesh_files(folder: str) -> list[Path]:
    """Sorted mesh files of a collection; raises SystemExit with a message if there are none."""
    root = COLLECTIONS / folder
    files = sorted(path for path in root.rglob("*") if path.suffix.lower() in MESH_FORMATS)
    if not files:
        raise SystemExit(f"There are no meshes in {root}; put the collection there")
    return files


def spread(files: list[Path], count: int) -> list[Path]:
    """About ``count`` of the files, evenly spread over the list; never more."""
    return files[:: max(1, len(files) // count)][:count]
