"""Meshes to measure on: collections beside the project, where there are any."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import igl

from nicmm_core.files import MESH_FORMATS, read_mesh
from nicmm_core.mesh import Mesh

COLLECTIONS = Path(__file__).resolve().parents[2] / "shared" / "meshes"
"""Third-party meshes are no part of the project; each has its own licence."""


def mesh_files(folder: str) -> list[Path]:
    """Mesh files of a collection, sorted; stops with a word where there is none."""
    root = COLLECTIONS / folder
    files = sorted(path for path in root.rglob("*") if path.suffix.lower() in MESH_FORMATS)
    if not files:
        raise SystemExit(f"There are no meshes in {root}; put the collection there")
    return files


def shrec16(count: int, subdivisions: int = 2) -> Iterator[tuple[str, Mesh]]:
    """Meshes of SHREC16, spread over its classes, after Loop subdivisions."""
    files = mesh_files("shrec16")
    for path in files[:: max(1, len(files) // count)][:count]:
        mesh = read_mesh(path)
        yield path.stem, Mesh(*igl.loop(mesh.vertices, mesh.faces, subdivisions))


def clean(count: int) -> Iterator[tuple[str, Mesh]]:
    """Closed manifold meshes, as they are."""
    files = mesh_files("clean")
    for path in files[:: max(1, len(files) // count)][:count]:
        yield path.stem, read_mesh(path)
