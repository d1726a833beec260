"""Tests that generated shapes have the topology that their names promise."""

import numpy as np
import pytest

from nicmm_core import shapes
from nicmm_core.geometry.mesh import unique_edges
from tests.core.checks import euler_characteristic

SHAPES = {
    "sphere": (shapes.sphere(2), 2, 0),
    "torus": (shapes.torus(around=12, across=8), 0, 0),
    "disc": (shapes.disc(4), 1, 1),
    "creature": (shapes.creature(3, resolution=32, faces=200, subdivisions=1), 2, 0),
    "annulus": (shapes.annulus(8), 0, 2),
    "moebius_strip": (shapes.moebius_strip(24, 4), 0, 1),
    "double_torus": (shapes.double_torus(), -2, 0),
}


@pytest.mark.parametrize("name", SHAPES)
def test_euler_characteristic_and_boundaries(name):
    mesh, expected, boundaries = SHAPES[name]
    edges, count = unique_edges(mesh.faces)
    assert count.max() <= 2
    assert euler_characteristic(mesh.faces) == expected
    assert len(np.unique(mesh.face_component)) == 1
    assert mesh.referenced.all()
    rim = edges[count == 1]
    assert _components(rim) == boundaries


def test_moebius_strip_has_one_side():
    """Some inner edge has the same direction in both of its faces."""
    faces = shapes.moebius_strip(24, 4).faces
    directed = faces[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2)
    assert len(np.unique(directed, axis=0)) < len(directed)


def _components(edges):
    parts = []
    for edge in edges.tolist():
        touched = [part for part in parts if part & set(edge)]
        parts = [part for part in parts if part not in touched] + [set(edge).union(*touched)]
    return len(parts)
