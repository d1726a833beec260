"""Tests loops along features, on bodies whose rims are known in closed form."""

import numpy as np
import pytest

import nicmm_core as nicmm
from nicmm_core import shapes
from nicmm_core.geometry.surface_points import nearest_points
from tests.oracles import rims


def clicked(rim, seed, away):
    """A point of the surface beside a random place of the rim, at so many edges at most."""
    generator = np.random.default_rng(seed)
    direction = generator.normal(size=3)
    direction *= away * rim.edge / np.linalg.norm(direction)
    place = rim.points[generator.integers(len(rim.points))] + direction
    return nearest_points(rim.mesh, place[None])[0]


def assert_on_rim(rim, seed, away):
    """The plain curve through the points found is closed, and within half an edge of the rim."""
    point = clicked(rim, seed, away)
    found = nicmm.feature_loop(rim.mesh, point)
    curve = nicmm.design_curve(rim.mesh, found).curves[0]
    assert rim.distance(curve) < 0.5 * rim.edge
    assert len(found) <= 30


@pytest.mark.slow
@pytest.mark.parametrize(
    "seed", [0, 3, *(pytest.param(seed, marks=pytest.mark.slow) for seed in (1, 2, *range(4, 10)))]
)
def test_the_margin_of_a_tooth_is_found(seed):
    noise, vertices = (0.0, 0.05, 0.1)[seed % 3], (1500, 3000, 8000)[seed % 3]
    assert_on_rim(rims.tooth(seed, vertices, noise), seed, away=1.5)


@pytest.mark.slow
@pytest.mark.parametrize(
    "seed", [0, 8, *(pytest.param(seed, marks=pytest.mark.slow) for seed in (*range(1, 8), 9))]
)
def test_the_edge_of_a_shaft_is_found(seed):
    assert_on_rim(rims.shaft(seed, 24 + 8 * (seed % 4)), seed, away=0.4)


def test_the_line_at_an_open_end_is_open():
    """A ridge that runs from one side of a sheet to the other."""
    line = np.linspace(-1.0, 1.0, 31)
    x, y = np.meshgrid(line, line)
    index = np.arange(x.size).reshape(x.shape)
    a, b, c, d = index[:-1, :-1], index[:-1, 1:], index[1:, 1:], index[1:, :-1]
    faces = np.concatenate([np.stack([a, b, c], -1), np.stack([a, c, d], -1)]).reshape(-1, 3)
    sheet = np.stack([x, y, -np.abs(x)], axis=-1).reshape(-1, 3)
    designer = nicmm.Designer(nicmm.Mesh(sheet, faces))
    points, closed = designer.feature_loop([0.05, 0.1, -0.05])
    assert not closed and len(points) <= 8
    ends = points.positions(designer.mesh)
    np.testing.assert_allclose([ends[:, 1].min(), ends[:, 1].max()], [-1.0, 1.0], atol=0.03)
    np.testing.assert_allclose(ends[:, 0], 0.0, atol=0.03)


@pytest.mark.slow
def test_a_boundary_is_a_feature():
    mesh = shapes.annulus()
    found = nicmm.feature_loop(mesh, [0.32, 0.0, 0.0])
    np.testing.assert_allclose(np.linalg.norm(found, axis=1), 0.3, atol=0.03)


def test_marked_edges_are_followed_first():
    mesh = shapes.sphere(3)
    equator = np.abs(mesh.vertices[:, 2]) < 1e-9
    sides = mesh.faces[:, [[1, 2], [2, 0], [0, 1]]].reshape(-1, 2)
    marked = sides[equator[sides].all(axis=1)]
    if not len(marked):
        pytest.skip("this sphere has no edges along the equator")
    found = nicmm.feature_loop(mesh, mesh.vertices[marked[0, 0]], edges=marked)
    np.testing.assert_allclose(found[:, 2], 0.0, atol=0.03)


@pytest.mark.slow
def test_the_rim_of_painted_weights_is_followed():
    mesh = shapes.sphere(4)
    weights = (mesh.vertices[:, 2] > 0.5).astype(float)
    start = int(np.abs(mesh.vertices[:, 2] - 0.5).argmin())
    found = nicmm.feature_loop(mesh, start, weights=weights)
    np.testing.assert_allclose(found[:, 2], 0.5, atol=0.1)


@pytest.mark.slow
def test_a_painted_region_without_a_whole_face_has_no_rim():
    """The sharp edge next to the point is followed as if nothing were painted."""
    mesh = shapes.cube(6)
    edge = np.flatnonzero((mesh.vertices[:, :2] == mesh.vertices.max()).all(axis=1))[3]
    weights = np.zeros(len(mesh.vertices))
    weights[edge] = 1.0
    painted = nicmm.feature_loop(mesh, [edge], weights=weights)
    np.testing.assert_array_equal(painted, nicmm.feature_loop(mesh, [edge]))


def test_without_a_feature_there_is_an_error():
    mesh = shapes.sphere(3)
    with pytest.raises(nicmm.UnreachableError, match="no sharp edge"):
        nicmm.feature_loop(mesh, 5)


@pytest.mark.parametrize(
    ("point", "given", "error", "words"),
    [
        ([5, 6], {}, nicmm.ControlPointError, "2 points"),
        (10_000, {}, nicmm.ControlPointError, "out of range"),
        ([9.0, 0.0, 0.0], {}, nicmm.ControlPointError, "off the surface"),
        (5, {"reach": -1.0}, nicmm.ArgumentError, "reach is -1.0"),
        (5, {"edges": [[0, 9999]]}, nicmm.ArgumentError, "edges"),
        (5, {"weights": [1.0]}, nicmm.ArgumentError, "weights"),
    ],
)
def test_what_cannot_be_used_is_refused(point, given, error, words):
    with pytest.raises(error, match=words):
        nicmm.feature_loop(shapes.cube(4), point, **given)
