"""Tests the sides of a curve by the parity of its crossings, on rings."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from nicmm_core.geometry.sides import two_sides


def ring(count):
    return np.stack([np.arange(count), np.roll(np.arange(count), -1)], axis=1)


@given(st.lists(st.booleans(), min_size=3, max_size=30))
def test_a_ring_has_two_sides_where_it_is_crossed_an_even_number_of_times(crossed):
    crossed = np.array(crossed)
    part, side = two_sides(len(crossed), ring(len(crossed)), crossed)
    assert len(np.unique(part)) == 1
    if crossed.sum() % 2:
        assert (side == 0).all()
    else:
        changes = side != np.roll(side, -1)
        np.testing.assert_array_equal(changes, crossed)


def test_parts_have_sides_of_their_own():
    neighbours = np.concatenate([ring(3), ring(4) + 3])
    crossed = np.array([True, False, False, True, False, True, False])
    part, side = two_sides(8, neighbours, crossed)
    assert len(np.unique(part)) == 3
    assert (side[:3] == 0).all()
    assert side[3] == side[6] == -side[4] == -side[5]
    assert side[7] == 1
