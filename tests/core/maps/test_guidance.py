"""Tests of φ_fea, computed from the weights of obstacles and alignment."""

import igl
import numpy as np
import pytest

import nicmm_core as nicmm
from nicmm_core import shapes
from nicmm_core.maps.guidance import ALIGNMENT_WIDTH, BASELINE, OBSTACLE, feature_map

UNIT = 4.0
KINDS = {"obstacles": 1.0, "alignment": -1.0}


def painted(mesh, vertex, weight=1.0):
    """A map with one painted vertex."""
    weights = np.zeros(len(mesh.vertices))
    weights[vertex] = weight
    return weights


def map_of(mesh, obstacles=None, alignment=None, unit=UNIT):
    return feature_map(mesh, obstacles, alignment, unit)


@pytest.fixture(scope="module")
def sheet():
    """A fine flat disc."""
    return shapes.disc(40)


def test_neutral_value_where_nothing_is_painted(ball):
    value = map_of(ball, painted(ball, 100), painted(ball, 500))
    offset = ball.vertices[:, None] - ball.vertices[[100, 500]]
    far = np.linalg.norm(offset, axis=2).min(axis=1) > 4 * ALIGNMENT_WIDTH * UNIT
    assert 0.5 < far.mean() < 1.0
    np.testing.assert_array_equal(value[far], BASELINE)
    np.testing.assert_array_equal(map_of(ball), BASELINE)
    zeros = np.zeros(len(ball.vertices))
    np.testing.assert_array_equal(map_of(ball, zeros, zeros), BASELINE)


def test_the_square_is_what_is_painted_and_never_below_zero(ball):
    raised = map_of(ball, obstacles=painted(ball, 100))
    lowered = map_of(ball, alignment=painted(ball, 100))
    assert raised.argmax() == 100 and raised[100] ** 2 == pytest.approx(1.0 + OBSTACLE)
    assert lowered.argmin() == 100 and lowered[100] == 0.0
    assert (raised >= BASELINE).all()
    assert (lowered <= BASELINE).all()
    both = map_of(ball, painted(ball, 100, 0.01), np.ones(len(ball.vertices)))
    assert (both >= 0.0).all()


@pytest.mark.parametrize("kind", KINDS)
def test_the_gaussian_falls_along_the_surface(sheet, kind):
    """For one painted vertex, φ_fea² is 1 + height · exp(-d² / 2σ²)."""
    middle = int(np.linalg.norm(sheet.vertices, axis=1).argmin())
    distance = np.linalg.norm(sheet.vertices, axis=1)
    squared = map_of(sheet, **{kind: painted(sheet, middle)}) ** 2
    share = (squared - 1.0) / (squared[middle] - 1.0)
    sigma = np.sqrt(-0.5 * distance**2 / np.log(np.clip(share, 1e-2, 1.0 - 1e-9)))
    near = (share > 0.02) & (distance > 0.0)
    assert near.sum() > 30
    # Paths along edges are up to 16 % longer than straight ones.
    assert sigma[near].max() / sigma[near].min() < 1.2


def test_two_sides_of_a_plate_are_apart():
    """They are close in space, but not along the surface."""
    cube = shapes.cube(16)
    plate = nicmm.Mesh(cube.vertices * [1.0, 1.0, 0.01], cube.faces)
    top = np.flatnonzero((plate.vertices[:, 2] > 0) & (np.abs(plate.vertices[:, :2]) < 0.3).all(1))
    value = map_of(plate, alignment=painted(plate, top), unit=2.8)
    below = (plate.vertices[:, 2] < 0) & (np.abs(plate.vertices[:, :2]) < 0.6).all(axis=1)
    assert value[top].min() == 0.0
    np.testing.assert_array_equal(value[below], BASELINE)


@pytest.mark.parametrize(("kind", "sign"), KINDS.items())
def test_effect_grows_with_the_weight(ball, kind, sign):
    effects = [
        sign * (map_of(ball, **{kind: painted(ball, 100, weight)}) - BASELINE)
        for weight in (0.0, 0.2, 0.5, 0.8, 1.0)
    ]
    for weaker, stronger in zip(effects, effects[1:], strict=False):
        assert (stronger >= weaker - 1e-12).all()
        assert stronger[100] > weaker[100]


def test_more_painted_vertices_do_not_make_an_obstacle_stronger(ball):
    one = map_of(ball, obstacles=painted(ball, 100))
    near = np.linalg.norm(ball.vertices - ball.vertices[100], axis=1) < 0.3
    many = map_of(ball, obstacles=near.astype(float))
    assert many.max() == pytest.approx(one.max())
    assert (many >= one - 1e-12).all()


@pytest.mark.parametrize("width", [0.06, 0.15, 0.3])
def test_a_broad_strip_is_lowest_along_its_middle(sheet, width):
    """It is not lowest along its rim, and it attracts everywhere."""
    x, y, _ = sheet.vertices.T
    strip = np.abs(y) < width
    value = map_of(sheet, alignment=strip.astype(float))
    away_from_ends = np.abs(x) < 0.5
    middle = away_from_ends & (np.abs(y) < 0.3 * width)
    rim = away_from_ends & strip & (np.abs(y) > 0.8 * width)
    assert value[middle].mean() < 0.5 * value[rim].mean()
    assert value[away_from_ends & strip].max() < 0.8
    outside = away_from_ends & (np.abs(y) > width + 3 * ALIGNMENT_WIDTH * UNIT)
    assert (value[outside] > 0.97).all()


def test_of_graded_paint_the_strongest_attracts_most(sheet):
    x, y, _ = sheet.vertices.T
    value = map_of(sheet, alignment=np.clip(1.0 - np.abs(y - 0.05) / 0.3, 0.0, 1.0))
    column = (np.abs(x) < 0.3) & (np.abs(y) < 0.4)
    ridge = column & (np.abs(y - 0.05) < 0.04)
    assert value[ridge].max() < 0.35
    assert value[column & (np.abs(y - 0.05) > 0.2)].min() > 0.6


def test_a_painted_plain_is_as_good_everywhere(ball):
    """Where everything is painted, there is neither a rim nor a ridge."""
    np.testing.assert_array_equal(map_of(ball, alignment=np.ones(len(ball.vertices))), 0.0)
    half = (ball.vertices[:, 2] > 0).astype(float)
    assert map_of(ball, alignment=half)[ball.vertices[:, 2] > 0.6].max() == 0.0


@pytest.mark.parametrize("factor", [1e-3, 1e3])
def test_the_map_knows_no_unit_and_no_numbers(body, factor):
    generator = np.random.default_rng(0)
    weights = np.round(generator.random(len(body.vertices)), 1) * (body.vertices[:, 0] > 0)
    plain = map_of(body, weights, weights[::-1], unit=1.0)
    assert plain.min() < 0.7 and plain.max() > 3.0
    order = generator.permutation(len(body.vertices))
    there = np.argsort(order)
    other = nicmm.Mesh(factor * body.vertices[order], there[body.faces])
    scaled = map_of(other, weights[order], weights[::-1][order], unit=factor)
    np.testing.assert_allclose(scaled[there], plain, rtol=0, atol=1e-6)


def test_a_finer_mesh_has_the_same_map():
    """For a strip, at common vertices, up to the error of distances along edges."""
    coarse = shapes.torus(around=48, across=20)
    fine = nicmm.Mesh(*igl.upsample(coarse.vertices, coarse.faces))
    maps = []
    for mesh in (coarse, fine):
        strip = (np.abs(mesh.vertices[:, 0]) < 0.11) & (mesh.vertices[:, 1] > 0)
        maps.append(map_of(mesh, alignment=strip.astype(float)))
    difference = np.abs(maps[1][: len(coarse.vertices)] - maps[0])
    assert maps[0].min() == 0.0
    assert difference.mean() < 0.01
    assert np.quantile(difference, 0.99) < 0.25
