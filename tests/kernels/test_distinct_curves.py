"""Distinct curves are those of brute force."""

import nicmm_kernels
import numpy as np
import pytest


@pytest.mark.parametrize("limit", [0.1, 0.3, 0.6])
def test_chosen_curves_are_those_of_brute_force(limit):
    rng = np.random.default_rng(4)
    base = rng.random((4, 1, 3)) + np.cumsum(0.2 * rng.random((4, 20, 3)), axis=1)
    positions = np.repeat(base, 5, axis=0) + 0.1 * rng.random((20, 1, 3))
    positions[::2] = positions[::2, ::-1]  # the direction does not count
    order = rng.permutation(20)

    def is_near(one, other):
        away = np.linalg.norm(positions[one][:, None] - positions[other], axis=2)
        return max(away.min(axis=0).max(), away.min(axis=1).max()) <= limit

    expected = []
    for number in order:
        if not any(is_near(number, chosen) for chosen in expected):
            expected.append(number)
    found = nicmm_kernels.distinct_curves(positions, order, limit, lambda: None)
    assert found.tolist() == expected
    assert 1 < len(expected) < 20
