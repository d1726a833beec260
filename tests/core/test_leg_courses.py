"""Other courses of one leg of a curve: the other legs keep theirs."""

import numpy as np
import pytest

import nicmm_core as nicmm
from nicmm_core import shapes
from nicmm_core.courses.comparison import SAME_COURSE, farthest_between
from nicmm_core.geometry.curve import points_of_leg, resample, with_other_leg
from nicmm_core.geometry.surface_points import locate_points
from nicmm_core.leg_courses import leg_courses
from tests.oracles.checker import judge

ANGLES = (0.1, 1.5, 2.8, 4.4)


def ignored(_fraction, _line):
    """A progress function may return nothing."""


@pytest.fixture(scope="module")
def torus():
    return shapes.torus()


@pytest.fixture(scope="module")
def designer(torus):
    return nicmm.Designer(torus)


@pytest.fixture(scope="module")
def points(torus):
    """Points around the torus, in turn on its top and its bottom."""
    wide, high = torus.vertices[:, 0].max(), torus.vertices[:, 2].max()
    places = [
        (0.8 * wide * np.cos(angle), 0.8 * wide * np.sin(angle), 0.8 * high * (-1) ** (number + 1))
        for number, angle in enumerate(ANGLES)
    ]
    vertices = [int(np.linalg.norm(torus.vertices - place, axis=1).argmin()) for place in places]
    return locate_points(torus, np.array(vertices), "points")


def legs(curve):
    count = len(curve.control_index) - (not curve.closed)
    return [
        resample(curve.points[points_of_leg(curve, leg)], 200, False)[0] for leg in range(count)
    ]


def changes(one, other):
    return [farthest_between(*pair) for pair in zip(legs(one), legs(other), strict=True)]


@pytest.mark.slow
@pytest.mark.parametrize("closed", [True, False])
def test_only_one_leg_takes_other_courses(torus, designer, points, closed):
    curve = designer.design(points, closed=closed).curves[0]
    found = 0
    for leg in range(len(points) - (not closed)):
        design = leg_courses(
            designer, points, curve, leg, alternatives=4, progress=ignored, closed=closed
        )
        designs = [design, *design.alternatives]
        energies = [each.relative_energy for each in designs]
        assert energies[0] == 1.0 and energies == sorted(energies)
        moved = [changes(curve, each.curves[0]) for each in designs]
        unchanged = [row for row in moved if max(row) < 0.5 * SAME_COURSE * torus.diagonal]
        assert len(unchanged) == 1
        for row in moved:
            if row is not unchanged[0]:
                assert row[leg] == max(row) > SAME_COURSE * torus.diagonal
                found += 1
        for each in designs:
            assert not judge(torus, each, points, closed).faults
    assert found > 0


@pytest.mark.slow
@pytest.mark.parametrize("after", [0.0, 0.8, 0.9])
def test_a_cancelled_search_has_no_curve(designer, points, after):
    curve = designer.design(points).curves[0]

    def until(fraction, _line):
        return fraction < after

    design = leg_courses(designer, points, curve, 0, alternatives=4, progress=until)
    assert design.status is nicmm.Status.CANCELLED and not design.curves


@pytest.mark.slow
@pytest.mark.parametrize("closed", [True, False])
def test_a_replaced_leg_leaves_the_rest(torus, designer, points, closed):
    curve = designer.design(points, closed=closed).curves[0]
    for leg in range(len(points) - (not closed)):
        ends = points[np.array([leg, (leg + 1) % len(points)])]
        part = designer.design(ends, closed=False, smoothness=0.3).curves[0]
        joined = with_other_leg(torus, curve, leg, part)
        assert joined.closed == closed
        np.testing.assert_allclose(
            joined.points[joined.control_index], points.positions(torus), atol=1e-9
        )
        for number, (before, after) in enumerate(zip(legs(curve), legs(joined), strict=True)):
            expected = resample(part.points, 200, False)[0] if number == leg else before
            np.testing.assert_allclose(after, expected, atol=1e-9)


@pytest.mark.slow
def test_other_courses_of_a_leg_keep_the_corners_of_the_curve(torus, designer, points):
    curve = designer.design(points, corners=[1, 3]).curves[0]
    design = leg_courses(
        designer, points, curve, 0, alternatives=2, progress=ignored, corners=[1, 3]
    )
    for each in (design, *design.alternatives):
        assert not judge(torus, each, points, True).faults
        assert len(each.resumable.curve.corner_nodes) == 2
