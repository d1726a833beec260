"""Tests which control points stay when a stroke replaces a stretch of a curve."""

import numpy as np
import pytest

import nicmm_core as nicmm
from nicmm_core.strokes.stretch import stretch_between

ANGLES = 2.0 * np.pi * np.arange(6) / 6.0


def on_circle(angle):
    return np.array([0.5 * np.cos(angle), 0.5 * np.sin(angle), 0.0])


@pytest.fixture
def loop(flat_disc):
    return nicmm.design_curve(flat_disc, [on_circle(each) for each in ANGLES]).curves[0]


@pytest.mark.parametrize(
    ("start", "end", "kept", "is_reversed"),
    [
        (0.5, 1.6, [2, 3, 4, 5, 0], False),  # beyond points 1
        (0.3, 0.7, [1, 2, 3, 4, 5, 0], False),  # between points 0 and 1
        (1.6, 0.5, [2, 3, 4, 5, 0], True),
        (5.9, 0.5, [1, 2, 3, 4, 5], False),  # beyond point 0
        (0.5, 5.9, [1, 2, 3, 4, 5], True),
    ],
)
def test_a_closed_curve_loses_the_shorter_stretch(flat_disc, loop, start, end, kept, is_reversed):
    found = stretch_between(flat_disc, loop, on_circle(start), on_circle(end))
    assert found.before.tolist() == kept and not len(found.after)
    assert found.reversed == is_reversed


@pytest.mark.parametrize("is_reversed", [False, True])
def test_an_open_curve_keeps_both_ends(flat_disc, is_reversed):
    places = [on_circle(each) for each in ANGLES[:5]]
    curve = nicmm.design_curve(flat_disc, places, closed=False).curves[0]
    ends = [on_circle(0.5), on_circle(2.5)]
    found = stretch_between(flat_disc, curve, *(ends[::-1] if is_reversed else ends))
    assert found.before.tolist() == [0] and found.after.tolist() == [3, 4]
    assert found.reversed == is_reversed
