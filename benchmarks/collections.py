"""Meshes to measure on: collections beside the project, or generated ones."""

from __future__ import annotations

from collections.abc import Iterator

import igl

from nicmm_core import shapes
from nicmm_core.geometry.mesh import Mesh
from nicmm_core.io.files import read_mesh
from tests.oracles.mesh_files import mesh_files, spread

from .scale import Scale

PAPER_SUBDIVISIONS = 2
"""Loop subdivisions that bring a mesh of SHREC16 to the paper's "about 4,000" vertices."""


def surfaces(scale: Scale, count: int) -> Iterator[tuple[str, Mesh]]:
    """The paper's data set, or generated creatures when only a smoke test is asked for."""
    return creatures(count) if scale is Scale.SMOKE else shrec16(count)


def label(scale: Scale) -> str:
    """What `surfaces` are, in words."""
    return "generated creatures" if scale is Scale.SMOKE else "SHREC16, two Loop subdivisions"


def shrec16(count: int, subdivisions: int = PAPER_SUBDIVISIONS) -> Iterator[tuple[str, Mesh]]:
    """Meshes of SHREC16, spread over its classes, after Loop subdivisions."""
    for path in spread(mesh_files("shrec16"), count):
        mesh = read_mesh(path)
        yield path.stem, Mesh(*igl.loop(mesh.vertices, mesh.faces, subdivisions))


def shrec16_class(name: str) -> Iterator[tuple[str, Mesh]]:
    """Meshes of one class of SHREC16 after the paper's subdivisions."""
    for path in mesh_files(f"shrec16/{name}"):
        mesh = read_mesh(path)
        yield path.stem, Mesh(*igl.loop(mesh.vertices, mesh.faces, PAPER_SUBDIVISIONS))


def clean(count: int) -> Iterator[tuple[str, Mesh]]:
    """Closed manifold meshes, as they are."""
    for path in spread(mesh_files("clean"), count):
        yield path.stem, read_mesh(path)


def bodies(count: int) -> Iterator[tuple[str, Mesh]]:
    """People, animals and a cortex, in the sizes that shape correspondence uses, as they are."""
    for path in spread(mesh_files("shapes"), count):
        yield path.stem, read_mesh(path)


def creatures(count: int) -> Iterator[tuple[str, Mesh]]:
    """Generated shapes with limbs, small."""
    for seed in range(count):
        yield f"creature {seed}", shapes.creature(seed, resolution=32, faces=200)
