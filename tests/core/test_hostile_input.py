"""Regression tests of findings with hostile input; `benchmarks fuzz` searches for more."""

import warnings

import numpy as np
import pytest

import nicmm_core as nicmm
from nicmm_core import progress, shapes
from tests.oracles import hostile_input
from tests.oracles.checker import judge

HUGE = 10**400
BALL = shapes.sphere(1)
POINTS = [0, 9, 30]

PARTS = 10
"""Number of parts of the seeded cases, so that several processes can share them."""

EACH = 35


@pytest.mark.parametrize(
    "arguments",
    [
        {"method": np.array(["elastic", "elastic"])},
        {"order": np.array([1, 2, 3])},
        {"order": []},
        {"closed": np.array([1, 2, 3])},
        {"closed": "no"},
        {"closed": None},
        {"smoothness": HUGE},
        {"smoothness": np.array([1.0, 2.0])},
        {"obstacles": [HUGE] * 42},
        {"progress": 3},
    ],
    ids=str,
)
def test_arguments_of_no_sense_are_refused(arguments):
    with pytest.raises(nicmm.ArgumentError, match=next(iter(arguments))):
        nicmm.design_curve(BALL, POINTS, **arguments)


@pytest.mark.parametrize(
    ("vertices", "faces"),
    [
        ([[HUGE, 0, 0]] * 3, [[0, 1, 2]]),
        (BALL.vertices, [[0, 1, HUGE]]),
        ([[1e300, 0, 0], [0, 1e300, 0], [0, 0, 1]], [[0, 1, 2]]),
        (np.ones((3, 3)), [[0, 1, 2]]),
    ],
    ids=["huge position", "huge index", "positions whose squares overflow", "one place"],
)
def test_arrays_of_no_sense_are_refused(vertices, faces):
    with pytest.raises(nicmm.MeshError):
        nicmm.Mesh(vertices, faces)


@pytest.mark.parametrize("far", [1e3, 1e150, 1e200, 1e308])
def test_positions_at_the_end_of_the_numbers_are_off_the_surface(far):
    with pytest.raises(nicmm.ControlPointError, match=r"control_points\[1\] is off the surface"):
        nicmm.design_curve(BALL, [[1.0, 0, 0], [0, -far, 0], [0, 0, 1.0]])


def test_ten_thousand_points_are_refused_at_once():
    with pytest.raises(nicmm.ControlPointError, match="same point"):
        nicmm.design_curve(BALL, np.arange(10_000) % 42)


def test_the_progress_function_gets_points_of_its_own():
    def spoil(fraction, points):
        points *= np.nan

    design = nicmm.design_curve(BALL, POINTS, progress=spoil)
    assert not judge(BALL, design, POINTS).faults


def test_the_callers_own_error_passes_and_the_designer_goes_on(monkeypatch):
    monkeypatch.setattr(progress, "INTERVAL", 0.0)  # a design may take less than the interval

    def fail(fraction, points):
        raise ZeroDivisionError("the caller's")

    designer = nicmm.Designer(BALL)
    with pytest.raises(ZeroDivisionError, match="the caller's"):
        designer.design(POINTS, progress=fail)
    assert not judge(BALL, designer.design(POINTS), POINTS).faults


@pytest.mark.slow
@pytest.mark.parametrize("part", range(PARTS))
def test_a_seeded_part_of_the_fuzzing(part, request):
    if part % 10:
        request.getfixturevalue("one_attempt")
    for number in range(EACH * part, EACH * (part + 1)):
        assert hostile_input.answer(number).faults == [], number


@pytest.mark.slow
@pytest.mark.parametrize("number", [1360, 1746, 3496, 5274, 5864, 6448, 6921, 7180, 7294, 8976])
def test_what_a_whole_run_has_found(number):
    """Cases in which the answer was a faulty curve, an error without a type, or a warning."""
    with warnings.catch_warnings(record=True) as printed:
        assert hostile_input.answer(number).faults == []
    assert not printed
