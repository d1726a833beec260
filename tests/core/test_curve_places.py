"""Places on curves: they stay on the curve, and are found again by leg and fraction."""

from dataclasses import replace

import numpy as np
import pytest

import nicmm_core as nicmm
from nicmm_core import shapes
from nicmm_core.geometry.curve import points_of_leg
from nicmm_core.geometry.curve_places import (
    CurvePlace,
    nearest_control_point,
    nearest_place,
    nearest_point,
    number_of_legs,
    point_at,
)


@pytest.fixture(scope="module")
def mesh():
    return shapes.sphere(3)


@pytest.fixture(scope="module", params=[True, False])
def curve(mesh, request):
    vertices = [12, 80, 41, 200]
    return nicmm.design_curve(mesh, vertices, closed=request.param).curves[0]


def away_from(curve, position):
    """Least distance of a position from the segments of a curve."""
    start, step = curve.points[: len(curve.steps)], curve.steps
    share = (((position - start) * step).sum(1) / np.maximum((step**2).sum(1), 1e-300)).clip(0, 1)
    return np.linalg.norm(start + share[:, None] * step - position, axis=1).min()


@pytest.mark.parametrize("share", [0.0, 1e-9, 0.1, 0.5, 0.7391, 1.0 - 1e-9, 1.0])
def test_a_place_is_on_the_curve_and_is_found_again(mesh, curve, share):
    for leg in range(number_of_legs(curve)):
        position = point_at(mesh, curve, CurvePlace(leg, share)).positions(mesh)[0]
        assert away_from(curve, position) < 1e-12
        found = nearest_place(mesh, curve, position)
        again = point_at(mesh, curve, found).positions(mesh)[0]
        np.testing.assert_allclose(again, position, atol=1e-9)
        if 0.0 < share < 1.0 and share not in (1e-9, 1.0 - 1e-9):
            assert found.leg == leg and found.share == pytest.approx(share, abs=1e-6)


def test_a_share_is_a_fraction_of_the_length(mesh, curve):
    for leg in range(number_of_legs(curve)):
        line = curve.points[points_of_leg(curve, leg)]
        lengths = np.linalg.norm(np.diff(line, axis=0), axis=1)
        position = point_at(mesh, curve, CurvePlace(leg, 0.3)).positions(mesh)[0]
        nearest = np.linalg.norm(line - position, axis=1).argmin()
        assert lengths[:nearest].sum() / lengths.sum() == pytest.approx(0.3, abs=0.1)


def test_control_points_are_ends_of_legs(mesh, curve):
    count = len(curve.control_index)
    for number, index in enumerate(curve.control_index.tolist()):
        found = nearest_place(mesh, curve, curve.points[index])
        last = number == count - 1 and not curve.closed
        assert found == (CurvePlace(number - 1, 1.0) if last else CurvePlace(number, 0.0))
        point = point_at(mesh, curve, found)
        np.testing.assert_array_equal(point.positions(mesh)[0], curve.points[index])


def test_the_nearest_point_and_its_distance(mesh, curve):
    for position in mesh.vertices[::37]:
        point, away = nearest_point(mesh, curve, position)
        assert away == pytest.approx(away_from(curve, position), abs=1e-6)
        assert away_from(curve, point.positions(mesh)[0]) < 1e-12


def test_points_beside_an_edge_stay_on_the_curve_when_located(mesh, curve):
    """Locating a point sets tiny coordinates to zero, which moves it."""
    for segment in range(0, len(curve.steps), 7):
        one, other = curve.points[segment], curve.points[(segment + 1) % len(curve.points)]
        for share in (1e-7, 1e-5, 1.0 - 1e-7):
            point, _ = nearest_point(mesh, curve, (1.0 - share) * one + share * other)
            design_point = nicmm.SurfacePoints(point.faces, point.barycentric)
            located = nicmm.geometry.surface_points.locate_points(mesh, design_point, "points")
            assert away_from(curve, located.positions(mesh)[0]) < 1e-9 * mesh.diagonal


def test_the_nearest_control_point_is_found(mesh, curve):
    for control in curve.control_index:
        position = curve.points[control]
        point, away = nearest_control_point(curve, position + 1e-7)
        np.testing.assert_allclose(point.positions(mesh)[0], position, atol=1e-15)
        assert away == pytest.approx(np.sqrt(3.0) * 1e-7)


def test_a_curve_without_control_points_has_no_nearest_one(curve):
    point, away = nearest_control_point(replace(curve, control_index=np.array([-1])), np.zeros(3))
    assert len(point) == 0 and away == np.inf
