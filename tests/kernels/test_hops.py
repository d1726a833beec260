"""Hops between places of a surface, compared with shortest paths and with straight ways."""

import nicmm_kernels
import numpy as np
import pytest
from scipy import sparse
from scipy.sparse import csgraph

from nicmm_core import shapes
from nicmm_core.geometry.mesh import Mesh
from nicmm_core.relaxation.curve_nodes import curve_surface
from tests.core.checks import grid


def found_hops(mesh, cells, *, faces=(), weights=(), most=8, longest=np.inf, normals=None):
    """Hops from all cells, and from points of faces given by their barycentric coordinates."""
    normals = curve_surface(mesh).vertex_normals if normals is None else normals
    corners = mesh.faces[np.asarray(faces, dtype=np.int64)]
    weights = np.asarray(weights, dtype=float).reshape(-1, 3)
    around = np.concatenate([np.repeat(np.asarray(cells)[:, None], 3, axis=1), corners])
    inside = np.einsum("kj,kjd->kd", weights, mesh.vertices[corners])
    at_points = np.einsum("kj,kjd->kd", weights, normals[corners])
    at_points /= np.linalg.norm(at_points, axis=1, keepdims=True)
    places = nicmm_kernels.HopPlaces(
        len(cells),
        around,
        np.concatenate([mesh.vertices[cells], inside]),
        np.concatenate([normals[cells], at_points]),
    )
    hops = nicmm_kernels.surface_hops(
        mesh.edge_graph, np.ascontiguousarray(normals), places, 0, most, longest, lambda: None
    )
    return places, hops


def angles(one, other):
    """Angles between vectors, (n, 3) and (n, 3), in radians."""
    size = np.linalg.norm(one, axis=1) * np.linalg.norm(other, axis=1)
    return np.arccos(((one * other).sum(axis=1) / size).clip(-1.0, 1.0))


@pytest.mark.parametrize("edges", [2.5, np.inf])
def test_they_lead_to_the_nearest_cells_along_edges(edges):
    mesh = shapes.creature(2, resolution=32, faces=100)
    longest = edges * mesh.mean_edge_length
    cells = np.arange(0, len(mesh.vertices), 3)
    _, hops = found_hops(mesh, cells, most=7, longest=longest)
    start, end = mesh.edges.T
    length = np.linalg.norm(mesh.vertices[start] - mesh.vertices[end], axis=1)
    graph = sparse.csr_array((length, (start, end)), shape=(len(mesh.vertices),) * 2)
    between = csgraph.dijkstra(graph, directed=False)[np.ix_(cells, cells)]
    np.fill_diagonal(between, np.inf)
    between[between > longest] = np.inf
    order = np.argsort(between, axis=1, kind="stable")[:, :7]
    row = np.arange(len(cells)).repeat(7)
    finite = np.isfinite(between[row, order.ravel()])
    np.testing.assert_array_equal(hops.start, row[finite])
    np.testing.assert_array_equal(hops.end, order.ravel()[finite])
    np.testing.assert_allclose(hops.distance, between[hops.start, hops.end], rtol=1e-12)
    assert np.isinf(longest) == finite.all()


def test_equally_near_cells_are_found_in_the_order_of_their_indices():
    """Around the pole of an octahedron four vertices are equally near."""
    vertices = np.array([[0, 0, 1], [1, 0, 0], [0, 1, 0], [-1, 0, 0], [0, -1, 0], [0, 0, -1]])
    faces = np.array([[p, 1 + i, 1 + (i + 1) % 4] for p in (0, 5) for i in range(4)])
    faces[4:] = faces[4:, ::-1]
    _, hops = found_hops(Mesh(vertices.astype(float), faces), np.arange(6), most=3)
    assert hops.end[hops.start == 0].tolist() == [1, 2, 3]
    assert hops.end[hops.start == 5].tolist() == [1, 2, 3]


def test_in_the_plane_they_are_straight_although_edges_are_not():
    mesh = grid(16)
    weights = [[0.2, 0.3, 0.5], [0.6, 0.3, 0.1], [0.1, 0.1, 0.8]]
    places, hops = found_hops(
        mesh, np.arange(0, len(mesh.vertices), 5), faces=[40, 41, 300], weights=weights
    )
    straight = places.positions[hops.end] - places.positions[hops.start]
    np.testing.assert_allclose(hops.leaving, straight, atol=1e-12)
    np.testing.assert_allclose(hops.arriving, straight, atol=1e-12)
    assert (hops.distance >= np.linalg.norm(straight, axis=1) - 1e-12).all()
    # A point has hops to a point nearby, and to cells.
    near = hops.end[hops.start == places.cells]
    assert (near == places.cells + 1).any() and (near < places.cells).any()


def test_on_a_sphere_they_are_great_circles():
    mesh = shapes.sphere(5)
    places, hops = found_hops(mesh, np.arange(0, len(mesh.vertices), 40))
    one, other = places.positions[hops.start], places.positions[hops.end]
    np.testing.assert_allclose(np.linalg.norm(hops.leaving, axis=1), angles(one, other), rtol=3e-3)
    for vectors, here in ((hops.leaving, one), (hops.arriving, other)):
        straight = other - one
        straight -= (straight * here).sum(axis=1, keepdims=True) * here
        assert angles(vectors, straight).max() < np.radians(1.0)


def test_around_a_tube_they_are_straight_once_it_is_unrolled():
    """Some of these ways lead halfway around, where the line in space is across the tube."""
    radius, around = 0.1, 48
    flat = grid(around)
    along = np.pi * radius  # of a strip with square cells
    angle = 2.0 * np.pi * flat.vertices[:, 0]
    vertices = np.column_stack(
        [radius * np.cos(angle), radius * np.sin(angle), 2.0 * along * flat.vertices[:, 1]]
    )
    tube, cells = Mesh(vertices, flat.faces), np.flatnonzero(flat.vertices[:, 0] < 0.49)[::7]
    normals = vertices * [1.0, 1.0, 0.0] / radius
    _, hops = found_hops(tube, cells, most=60, normals=normals)
    unrolled = 2.0 * along * flat.vertices[cells]
    straight = unrolled[hops.end] - unrolled[hops.start]
    for vectors, place in ((hops.leaving, hops.start), (hops.arriving, hops.end)):
        turn = angle[cells][place]
        east = np.column_stack([-np.sin(turn), np.cos(turn), 0.0 * turn])
        found = np.column_stack([(vectors * east).sum(axis=1), vectors[:, 2]])
        np.testing.assert_allclose(found, straight[:, :2], atol=2e-3 * along)
    assert np.abs(straight[:, 0]).max() > 0.8 * np.pi * radius


def test_signs_of_normals_make_no_difference():
    mesh = shapes.creature(2, resolution=32, faces=300)
    normals = curve_surface(mesh).vertex_normals
    signs = np.random.default_rng(0).choice([-1.0, 1.0], (len(normals), 1))
    cells = np.arange(0, len(mesh.vertices), 4)
    _, hops = found_hops(mesh, cells, normals=normals)
    _, others = found_hops(mesh, cells, normals=np.ascontiguousarray(signs * normals))
    np.testing.assert_array_equal(hops.end, others.end)
    np.testing.assert_allclose(hops.leaving, others.leaving, atol=1e-12)
    np.testing.assert_allclose(hops.arriving, others.arriving, atol=1e-12)


def test_their_directions_are_in_the_tangent_planes_and_lengths_the_same_at_both_ends():
    mesh = shapes.creature(2, resolution=32, faces=300)
    places, hops = found_hops(mesh, np.arange(0, len(mesh.vertices), 4))
    for vectors, place in ((hops.leaving, hops.start), (hops.arriving, hops.end)):
        np.testing.assert_allclose((vectors * places.normals[place]).sum(axis=1), 0.0, atol=1e-12)
    ends = (np.linalg.norm(each, axis=1) for each in (hops.leaving, hops.arriving))
    np.testing.assert_allclose(*ends, rtol=1e-9)
