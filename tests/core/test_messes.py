"""Tests requests on random non-manifold meshes; `benchmarks messes` makes more of them."""

import warnings

import pytest

from tests.oracles import messes

pytestmark = pytest.mark.slow

COUNT = 40


@pytest.mark.parametrize("number", range(COUNT))
def test_a_seeded_mess(number, request):
    if number % 10:
        request.getfixturevalue("one_attempt")
    answer = messes.answer(number)
    assert answer.faults == [], answer.kind


@pytest.mark.parametrize("number", [163, 172, 330, 5313, 8312])
def test_what_a_whole_run_has_found(number):
    """Two curves; false separation by obstacles; strands on copies of an edge; only twin faces."""
    with warnings.catch_warnings(record=True) as printed:
        assert messes.answer(number).faults == []
    assert not printed
