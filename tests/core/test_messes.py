"""Non-manifold messes: a good curve, or an error that is due; `benchmarks messes` asks for more."""

import warnings

import pytest

from tests.oracles import messes

pytestmark = pytest.mark.slow

PARTS = 10
"""Of the seeded messes, so that several processes may share them."""

EACH = 15


@pytest.mark.parametrize("part", range(PARTS))
def test_a_seeded_part_of_the_messes(part):
    for number in range(EACH * part, EACH * (part + 1)):
        answer = messes.answer(number)
        assert answer.faults == [], (number, answer.kind)


@pytest.mark.parametrize("number", [163, 172, 330, 5313, 8312])
def test_what_a_whole_run_has_found(number):
    """Two curves; obstacles that seemed to separate; strands on copies of one edge; twins alone."""
    with warnings.catch_warnings(record=True) as printed:
        assert messes.answer(number).faults == []
    assert not printed
