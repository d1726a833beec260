"""Tests that nodes are joined to a simple curve, whatever their order and the surface between."""

import numpy as np
import pytest

import nicmm_core as nicmm
from nicmm_core import shapes
from nicmm_core.geometry.surface_points import locate_control_points, nearest_points
from nicmm_core.relaxation.curve_nodes import curve_surface
from nicmm_core.relaxation.discrete_curve import is_simple
from nicmm_core.relaxation.simple_curve import simple_curve
from tests.core.checks import assert_valid_curve

CONTROLS = np.array([0, 20, 40])


def on_sphere(angles, heights):
    """A sphere, and its points nearest to the given longitudes and heights."""
    mesh = shapes.sphere(4)
    directions = np.stack([np.cos(angles), np.sin(angles), heights], axis=1)
    places, _ = nearest_points(mesh, directions / np.linalg.norm(directions, axis=1)[:, None])
    return mesh, places


def joined_simply(mesh, places, controls=CONTROLS, closed=True):
    return simple_curve(curve_surface(mesh), places, controls, places[controls], closed)


@pytest.mark.parametrize("closed", [True, False])
def test_all_nodes_of_a_simple_curve_are_kept(closed):
    angles = np.linspace(0.0, 2.0 * np.pi if closed else 4.0, 60, endpoint=False)
    mesh, places = on_sphere(angles, 0.1 * np.sin(3.0 * angles))
    curve = joined_simply(mesh, places, closed=closed)
    assert len(curve.node_index) == 60
    np.testing.assert_array_equal(curve.control_nodes, CONTROLS)
    assert_valid_curve(mesh, curve.surface_curve(mesh), closed=closed)


@pytest.mark.parametrize("size", [4, 8, 16])
def test_nodes_of_a_loop_are_removed(size):
    """Some of the nodes between two control points go once around a small circle."""
    angles = np.linspace(0.0, 2.0 * np.pi, 60, endpoint=False)
    heights = np.zeros(60)
    around = np.linspace(-0.8 * np.pi, 0.8 * np.pi, size)
    angles[22 : 22 + size] = angles[22:38].mean() - 0.1 * np.sin(around)
    heights[22 : 22 + size] = 0.1 + 0.1 * np.cos(around)
    mesh, places = on_sphere(angles, heights)
    curve = joined_simply(mesh, places)
    assert is_simple(curve_surface(mesh), curve)
    assert 60 - size - 2 <= len(curve.node_index) < 60
    assert_valid_curve(mesh, curve.surface_curve(mesh), closed=True)
    at_controls = curve.nodes.positions[curve.control_nodes]
    np.testing.assert_array_equal(at_controls, places[CONTROLS].positions(mesh))


def test_no_curve_through_control_points_in_an_order_that_crosses():
    """On a disc, four points on its rim in the order of a bow tie."""
    angles = np.linspace(0.0, 2.0 * np.pi, 5)[:4]
    mesh = shapes.disc()
    corners = 0.8 * np.stack([np.cos(angles), np.sin(angles), 0.0 * angles], axis=1)[[0, 1, 3, 2]]
    share = np.linspace(0.0, 1.0, 10, endpoint=False)[:, None]
    legs = [
        (1.0 - share) * one + share * other
        for one, other in zip(corners, np.roll(corners, -1, axis=0), strict=True)
    ]
    places, _ = nearest_points(mesh, np.concatenate(legs))
    assert joined_simply(mesh, places, np.array([0, 10, 20, 30])) is None


def test_path_along_edges_replaces_a_failed_trace():
    """Needles of a rough surface, over which straight traces fail."""
    generator = np.random.default_rng(4)
    smooth = shapes.sphere(4)
    mesh = nicmm.Mesh(
        smooth.vertices + generator.normal(scale=0.05, size=smooth.vertices.shape), smooth.faces
    )
    angles = np.linspace(0.0, 2.0 * np.pi, 60, endpoint=False)
    _, places = on_sphere(angles, np.zeros(60))
    curve = joined_simply(mesh, places)
    assert curve is not None
    at_vertices = (curve.polyline.barycentric == 1.0).any(axis=1)
    assert at_vertices.any()
    assert_valid_curve(mesh, curve.surface_curve(mesh), closed=True)


@pytest.mark.parametrize("seed", range(20))
def test_control_points_at_vertices_without_nodes_between_them(seed):
    """No trace can start at a vertex, so the control points are joined along edges."""
    mesh = shapes.moebius_strip(around=15, across=1)
    generator = np.random.default_rng(seed)
    vertex = generator.integers(len(mesh.vertices))
    chosen = [vertex]
    for _ in range(2):
        around = np.setdiff1d(mesh.faces[(mesh.faces == vertex).any(axis=1)], chosen)
        vertex = generator.choice(around)
        chosen.append(vertex)
    places = locate_control_points(mesh, chosen, closed=False)
    curve = joined_simply(mesh, places, np.arange(3), closed=False)
    assert curve is not None
    points = curve.surface_curve(mesh).points
    assert len(np.unique(points, axis=0)) == len(points)
