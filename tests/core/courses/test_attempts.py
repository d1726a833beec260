"""Tests that further attempts at a curve never make it worse."""

import pytest

import nicmm_core as nicmm
from nicmm_core.courses import attempts
from nicmm_core.relaxation.curve_energies import energies_of
from nicmm_core.relaxation.curve_nodes import curve_surface
from tests.oracles.energies import named_requests

REQUESTS = {request.name: request for request in named_requests()}
BENT = [name for name in REQUESTS if name.startswith("creature") and "closed" in name]


@pytest.mark.slow
@pytest.mark.parametrize("name", BENT)
def test_more_attempts_do_not_raise_the_energy(monkeypatch, name):
    """On the length scale of the first attempt."""
    asked = REQUESTS[name]
    designer = nicmm.Designer(asked.mesh)
    every = designer.design(asked.points, **asked.options).resumable
    monkeypatch.setattr(attempts, "MOST_WORK", 0)
    first = designer.design(asked.points, **asked.options).resumable
    surface = curve_surface(first.mesh)
    one, all_of_them = energies_of(surface, [first.curve, every.curve], 1.0, first.curve.length)
    assert all_of_them <= one * (1.0 + 1e-9)


def test_the_order_of_two_curves_does_not_depend_on_a_third(ball):
    """Although the third is shorter than both."""
    points = [[3, 200, 400], [10, 300, 500, 610], [7, 8, 9]]
    designer = nicmm.Designer(ball)
    curves = [designer.design(each).resumable for each in points]
    surface = curve_surface(curves[0].mesh)

    class Result:
        def __init__(self, curve):
            self.discrete_curve = curve

    results = [Result(each.curve) for each in curves]
    before = attempts.Attempts(surface, 1.0, 3, lambda: 0, relaxed=results[:2]).energies
    after = attempts.Attempts(surface, 1.0, 3, lambda: 0, relaxed=results).energies
    assert after[:2] == before
