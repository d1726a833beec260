"""Random control points, the same for the same seed."""

from __future__ import annotations

from collections.abc import Iterable, Iterator

import numpy as np

from nicmm_core.array_types import IntArray
from nicmm_core.mesh import Mesh

FEWEST_POINTS, MOST_POINTS = 3, 5
"""Of a set, as in the paper's section 4.1."""


def random_sets(
    meshes: Iterable[tuple[str, Mesh]], per_mesh: int, seed: int
) -> Iterator[tuple[str, Mesh, IntArray]]:
    """Name, mesh and the vertices of one set of control points, ``per_mesh`` times each mesh.

    The points of a mesh depend on the seed and its place in the list alone.
    """
    for number, (name, mesh) in enumerate(meshes):
        generator = np.random.default_rng([seed, number])
        component = np.bincount(mesh.face_component, weights=mesh.face_areas).argmax()
        vertices = np.unique(mesh.faces[mesh.face_component == component])
        for _ in range(per_mesh):
            count = generator.integers(FEWEST_POINTS, MOST_POINTS + 1)
            yield name, mesh, generator.choice(vertices, size=count, replace=False)
