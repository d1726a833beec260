"""The meshes of the benchmarks: third-party collections outside the project, or generated ones."""

from __future__ import annotations

from collections.abc import Iterator

import igl

from nicmm_core import shapes
from nicmm_core.geometry.mesh import Mesh
from nicmm_core.io.files import read_mesh
from tests.oracles.mesh_files import mesh_files, spread

from .scale import Scale

PAPER_SUBDIVISIONS = 2
"""Loop subdivisions that give a SHREC16 mesh the "about 4000 vertices" of the paper."""


def surfaces(scale: Scale, count: int) -> Iterator[tuple[str, Mesh]]:
    """Meshes of the paper's data set, or generated creatures at the scale of a smoke test."""
    return creatures(count) if scale is Scale.SMOKE else shrec16(count)


def label(scale: Scale) -> str:
    """Description of the meshes that `surfaces` yields."""
    return "generated creatures" if scale is Scale.SMOKE else "SHREC16, two Loop subdivisions"


def shrec16(count: int, subdivisions: int = PAPER_SUBDIVISIONS) -> Iterator[tuple[str, Mesh]]:
    """Loop-subdivided meshes of SHREC16, spread over its classes."""
    for path in spread(mesh_files("shrec16"), count):
        mesh = read_mesh(path)
        yield path.stem, Mesh(*igl.loop(mesh.vertices, mesh.faces, subdivisions))


def shrec16_class(name: str) -> Iterator[tuple[str, Mesh]]:
    """Meshes of one class of SHREC16, with as many subdivisions as in the paper."""
    for path in mesh_files(f"shrec16/{name}"):
        mesh = read_mesh(path)
        yield path.stem, Mesh(*igl.loop(mesh.vertices, mesh.faces, PAPER_SUBDIVISIONS))


def clean(count: int) -> Iterator[tuple[str, Mesh]]:
    """Closed manifold meshes, unchanged."""
    for path in spread(mesh_files("clean"), count):
        yield path.stem, read_mesh(path)


def bodies(count: int) -> Iterator[tuple[str, Mesh]]:
    """Unchanged meshes of people, animals and a cortex, at resolutions used in shape matching."""
    for path in spread(mesh_files("shapes"), count):
        yield path.stem, read_mesh(path)


def creatures(count: int) -> Iterator[tuple[str, Mesh]]:
    """Small generated shapes with limbs."""
    for seed in range(count):
        yield f"creature {seed}", shapes.creature(seed, resolution=32, faces=200)
