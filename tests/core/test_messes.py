"""Tests requests on random non-manifold meshes; `benchmarks messes` makes more of them."""

import warnings

import pytest

from tests.oracles import messes

pytestmark = pytest.mark.slow

PARTS = 10
"""Number of parts of the seeded messes, so that several processes can share them."""

EACH = 15


@pytest.mark.parametrize("part", range(PARTS))
def test_a_seeded_part_of_the_messes(part):
    for number in range(EACH * part, EACH * (part + 1)):
        answer = messes.answer(number)
        assert answer.faults == [], (number, answer.kind)


@pytest.mark.parametrize("number", [163, 172, 330, 5313, 8312])
def test_what_a_whole_run_has_found(number):
    """Two curves; false separation by obstacles; strands on copies of an edge; only twin faces."""
    with warnings.catch_warnings(record=True) as printed:
        assert messes.answer(number).faults == []
    assert not printed
