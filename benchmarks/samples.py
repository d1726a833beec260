"""Random control points, reproducible by their seed."""

from __future__ import annotations

from collections.abc import Iterable, Iterator

import numpy as np

from nicmm_core.geometry.array_types import IntArray
from nicmm_core.geometry.mesh import Mesh

FEWEST_POINTS, MOST_POINTS = 3, 5
"""Bounds on the number of points in a set, as in section 4.1 of the paper."""


def random_sets(
    meshes: Iterable[tuple[str, Mesh]], per_mesh: int, seed: int
) -> Iterator[tuple[str, Mesh, IntArray]]:
    """Name, mesh and vertices of each set of control points, ``per_mesh`` sets on every mesh.

    The points depend only on the seed and on the position of the mesh in the list.
    """
    for number, (name, mesh) in enumerate(meshes):
        for points in point_sets(mesh, per_mesh, np.random.default_rng([seed, number])):
            yield name, mesh, points


def point_sets(mesh: Mesh, count: int, generator: np.random.Generator) -> Iterator[IntArray]:
    """Sets of random vertices, all from the connected component with the largest area."""
    component = np.bincount(mesh.face_component, weights=mesh.face_areas).argmax()
    vertices = np.unique(mesh.faces[mesh.face_component == component])
    for _ in range(count):
        size = generator.integers(FEWEST_POINTS, MOST_POINTS + 1)
        yield generator.choice(vertices, size=size, replace=False)
