"""Tests that vertices are spread evenly, whatever the numbering and the triangulation."""

import numpy as np
import pytest
from scipy.spatial import Delaunay, cKDTree

import nicmm_core as nicmm
from nicmm_core import shapes
from nicmm_core.geometry.normals import unsigned_normals
from nicmm_core.geometry.numbering import principal_frame
from nicmm_core.geometry.sampling import CANDIDATES, NORMAL_WEIGHT, PACKING, spread_vertices
from tests.oracles.same_surface import changed

COUNT = 120


def least_distance(mesh):
    return PACKING * np.sqrt(mesh.face_areas.sum() / COUNT)


def spread(mesh):
    areas = np.bincount(mesh.faces.ravel(), np.repeat(mesh.face_areas / 3.0, 3), len(mesh.vertices))
    frame = principal_frame(mesh.vertices, mesh.faces, mesh.face_areas)
    normals, distance = unsigned_normals(mesh), least_distance(mesh)
    return spread_vertices(mesh, frame, normals, areas, CANDIDATES * COUNT, distance)


@pytest.fixture(scope="module")
def creature():
    return shapes.creature(3, resolution=48, faces=6_000)


def test_no_two_are_close_and_every_vertex_has_one_nearby(creature):
    scaled = creature.vertices / least_distance(creature)
    places = np.concatenate([scaled, NORMAL_WEIGHT * unsigned_normals(creature)], axis=1)
    tree = cKDTree(places[spread(creature)])
    assert not tree.query_pairs(1.0)
    assert tree.query(places)[0].max() < 2.0


def test_the_numbering_makes_no_difference(creature):
    number = np.random.default_rng(0).permutation(len(creature.vertices))
    vertices = np.empty_like(creature.vertices)
    vertices[number] = creature.vertices
    other = nicmm.Mesh(vertices, number[creature.faces])
    np.testing.assert_array_equal(spread(other), np.sort(number[spread(creature)]))


def test_rounding_in_single_precision_makes_no_difference(creature):
    other = nicmm.Mesh(creature.vertices.astype(np.float32).astype(float), creature.faces)
    np.testing.assert_array_equal(spread(other), spread(creature))


def test_other_diagonals_keep_most_of_them(creature):
    other = changed(creature, "other diagonals", 1).mesh
    assert np.isin(spread(other), spread(creature)).mean() > 0.6


def test_small_faces_get_no_more_and_no_fewer():
    """A plate whose right half has 16 times as many vertices as the left one."""
    left, right = np.linspace(-1.0, 0.0, 17), np.linspace(0.0, 1.0, 65)[1:]
    x, y = np.meshgrid(np.concatenate([left, right]), np.linspace(0.0, 1.0, 65), indexing="ij")
    coarse = (x > -1e-9) | (np.arange(65) % 4 == 0)
    vertices = np.stack([x, y, np.zeros_like(x)], axis=-1)[coarse]
    mesh = nicmm.Mesh(vertices, Delaunay(vertices[:, :2]).simplices)
    found = mesh.vertices[spread(mesh), 0]
    assert np.count_nonzero(found > 0.0) == pytest.approx(COUNT / 2, rel=0.25)
    assert np.count_nonzero(found < 0.0) == pytest.approx(COUNT / 2, rel=0.25)


def test_both_sides_of_a_thin_plate_get_their_own():
    mesh = shapes.sphere(4)
    thin = nicmm.Mesh(mesh.vertices * [1.0, 1.0, 1e-3], mesh.faces)
    heights = thin.vertices[spread(thin), 2]
    above, below = np.count_nonzero(heights > 0.0), np.count_nonzero(heights < 0.0)
    assert above == pytest.approx(COUNT / 2, rel=0.3)
    assert below == pytest.approx(COUNT / 2, rel=0.3)
