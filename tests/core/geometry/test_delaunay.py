"""The Delaunay triangulation of a surface does not depend on the given diagonals."""

import numpy as np
import pytest

import nicmm_core as nicmm
from nicmm_core import shapes
from nicmm_core.geometry.delaunay import delaunay_faces, sorted_faces
from nicmm_core.geometry.mesh import Mesh
from nicmm_core.geometry.numbering import renumbered
from tests.oracles import same_surface

BODIES = {
    "creature": shapes.creature(3, faces=500, subdivisions=1),
    "torus": shapes.torus(around=24, across=12),
    "cube": shapes.cube(5),
}


@pytest.mark.parametrize("name", BODIES)
def test_other_diagonals_give_the_same_faces(name):
    body = BODIES[name]
    changed = same_surface.changed(body, "other diagonals", 5)
    assert not np.array_equal(sorted_faces(changed.faces), sorted_faces(body.faces))
    one, other = renumbered(body).mesh, renumbered(changed.mesh).mesh
    np.testing.assert_array_equal(one.vertices, other.vertices)
    np.testing.assert_array_equal(delaunay_faces(one), delaunay_faces(other))


def test_a_delaunay_triangulation_stays():
    mesh = renumbered(BODIES["creature"]).mesh
    faces = delaunay_faces(mesh)
    np.testing.assert_array_equal(delaunay_faces(Mesh(mesh.vertices, faces)), faces)


@pytest.mark.parametrize("closed", [True, False])
def test_curves_on_other_diagonals_bend_as_much(closed):
    body = BODIES["creature"]
    changed = same_surface.changed(body, "other diagonals", 5)
    points = np.array([3, 200, 500, 800])
    one = nicmm.design_curve(body, points, closed=closed)
    other = nicmm.design_curve(changed.mesh, changed.number[points], closed=closed)
    assert other.energy["smooth"] == pytest.approx(one.energy["smooth"], rel=0.15)
