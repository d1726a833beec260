"""A curve is recognised as one of several courses by its distance to them."""

from dataclasses import replace

import numpy as np
import pytest

import nicmm_core as nicmm
from nicmm_core.courses.comparison import current_course


@pytest.fixture(scope="module")
def torus():
    return nicmm.shapes.torus(around=48, across=24)


@pytest.fixture(scope="module")
def courses(torus):
    """Curves from one side of a torus to the opposite one."""
    ends = [torus.vertices[:, 0].argmax(), torus.vertices[:, 0].argmin()]
    design = nicmm.design_curve(torus, ends, closed=False, alternatives=3)
    return [design.curves[0], *(each.curves[0] for each in design.alternatives)]


def as_polyline(curve, every):
    """The curve with only some of its points."""
    kept = np.arange(len(curve.points)) % every == 0
    kept[-1] = True
    return replace(
        curve,
        faces=curve.faces[kept],
        barycentric=curve.barycentric[kept],
        points=curve.points[kept],
    )


@pytest.mark.slow
def test_each_course_is_recognised_also_with_fewer_points(torus, courses):
    assert len(courses) >= 3
    for number, curve in enumerate(courses):
        assert current_course(torus, curve, courses) == number
        assert current_course(torus, as_polyline(curve, 2), courses) == number


@pytest.mark.slow
def test_another_course_is_not(torus, courses):
    assert current_course(torus, courses[0], courses[1:]) is None
