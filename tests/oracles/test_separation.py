"""Tests the proofs of separation where it is known whether curves separate points."""

import numpy as np
import pytest

import nicmm_core as nicmm
from nicmm_core import shapes
from tests.oracles.named_curves import nearest_vertices
from tests.oracles.separation import proven_apart

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def plate():
    return shapes.disc(8)


@pytest.fixture(scope="module")
def line(plate):
    """A straight line across the middle, which ends 0.2 before the border."""
    ends = np.array([[-0.8, 0.0, 0.0], [0.8, 0.0, 0.0]])
    return nicmm.design_curve(plate, ends, closed=False).curves[0]


def both_sides(plate):
    return nearest_vertices(plate, np.array([[0.0, 0.5, 0.0], [0.0, -0.5, 0.0]]))


def test_a_line_with_open_ends_separates_nothing(plate, line):
    assert not proven_apart(plate, [line], 0.0, both_sides(plate))


@pytest.mark.parametrize(("clearance", "apart"), [(0.15, False), (0.19, False), (0.22, True)])
def test_a_band_separates_once_it_reaches_the_border(plate, line, clearance, apart):
    assert proven_apart(plate, [line], clearance, both_sides(plate)) is apart


def test_points_on_the_same_side(plate, line):
    above = nearest_vertices(plate, np.array([[0.5, 0.5, 0.0], [-0.5, 0.5, 0.0]]))
    assert not proven_apart(plate, [line], 0.22, above)


def test_a_point_within_the_band(plate, line):
    points = nearest_vertices(plate, np.array([[0.0, 0.5, 0.0], [0.0, 0.16, 0.0]]))
    height = plate.vertices[points[1], 1]
    assert not proven_apart(plate, [line], 0.9 * height, points)
    assert proven_apart(plate, [line], 1.1 * height, points)


def test_a_torus_is_separated_by_two_meridians_only():
    mesh = shapes.torus(around=24, across=12)

    def meridian(degrees):
        u, v = np.radians(degrees), np.radians([0.0, 120.0, 240.0])
        radius = 1.0 + 0.4 * np.cos(v)
        places = np.stack([radius * np.cos(u), radius * np.sin(u), 0.4 * np.sin(v)], axis=1)
        return nicmm.design_curve(mesh, nearest_vertices(mesh, places)).curves[0]

    one, other = meridian(0.0), meridian(180.0)
    points = nearest_vertices(mesh, np.array([[0.0, 1.4, 0.0], [0.0, -1.4, 0.0]]))
    assert not proven_apart(mesh, [one], 0.0, points)
    assert proven_apart(mesh, [one, other], 0.0, points)
