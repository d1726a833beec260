"""Tests that no energy of the named requests rises; see `tests.oracles.energies`."""

import pytest

from tests.oracles.energies import kept_energies, named_requests

REQUESTS = {request.name: request for request in named_requests()}
KEPT = kept_energies()

HIGHER = 0.01
"""Share by which an energy may exceed the kept one."""


def test_every_request_has_a_kept_energy():
    assert set(REQUESTS) == set(KEPT)
    assert len(REQUESTS) >= 60


@pytest.mark.slow
@pytest.mark.parametrize("name", REQUESTS)
def test_the_energy_does_not_rise(name):
    """After a change that lowers energies, run: python -m tests.oracles.energies."""
    kept = KEPT[name]
    assert REQUESTS[name].energy() <= kept + HIGHER * abs(kept)
