"""Curves are mapped from the Delaunay triangulation to the triangulation that is given."""

import numpy as np
import pytest

import nicmm_core as nicmm
from nicmm_core import shapes
from nicmm_core.coarsening.retriangulated import retriangulated
from nicmm_core.geometry.delaunay import delaunay_faces
from nicmm_core.geometry.mesh import Mesh
from nicmm_core.geometry.numbering import renumbered
from nicmm_core.geometry.surface_points import SurfacePoints, locate_control_points
from nicmm_core.relaxation.curve_nodes import curve_surface, nodes_at
from nicmm_core.relaxation.discrete_curve import place_nodes
from tests.core.checks import apart, assert_valid_curve
from tests.oracles import same_surface

BODY = shapes.creature(3, faces=500, subdivisions=1)
COPY = renumbered(same_surface.changed(BODY, "other diagonals", 4).mesh).mesh
POINTS = np.array([3, 200, 500, 800])


def test_a_delaunay_triangulation_is_not_changed():
    assert retriangulated(Mesh(COPY.vertices, delaunay_faces(COPY))) is None


@pytest.mark.parametrize("closed", [True, False])
def test_curves_come_back_through_their_points(closed):
    there = retriangulated(COPY)
    assert there is not None
    controls = locate_control_points(COPY, POINTS, closed)
    curve = nicmm.design_curve(there.mesh, POINTS, closed=closed).curves[0]
    placed = place_nodes(curve_surface(there.mesh), curve, 512)
    back = there.curve_back(curve_surface(COPY), placed, controls)
    assert back is not None
    found = back.surface_curve(COPY)
    assert_valid_curve(COPY, found, closed=closed)
    np.testing.assert_allclose(found.points[found.control_index], COPY.vertices[POINTS], atol=1e-12)
    assert apart(found.points, curve.points) <= 0.2 * COPY.mean_edge_length
    assert len(back.nodes.positions) >= 0.98 * len(placed.nodes.positions)


def test_nodes_move_along_their_normals():
    there = retriangulated(COPY)
    assert there is not None
    generator = np.random.default_rng(3)
    faces = generator.integers(len(there.mesh.faces), size=200)
    places = SurfacePoints(faces, generator.dirichlet(np.ones(3), 200))
    nodes = nodes_at(curve_surface(there.mesh), places, closed=False)
    kept, moved = there.along_normals(nodes)
    move = moved.positions(COPY) - nodes.positions[kept]
    along = (move * nodes.normals[kept]).sum(axis=1, keepdims=True) * nodes.normals[kept]
    np.testing.assert_allclose(move, along, atol=1e-12)
    assert len(kept) >= 196
    assert 1e-4 * COPY.mean_edge_length < np.linalg.norm(move, axis=1).max()
    assert np.linalg.norm(move, axis=1).max() < 0.5 * COPY.mean_edge_length
