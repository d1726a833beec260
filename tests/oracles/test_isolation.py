"""Tests isolated work: every item has an outcome, even after a crash or a hang."""

import pytest

from tests.oracles.isolation import isolated

pytestmark = pytest.mark.slow


def fate(item):
    if item == "dies":
        raise SystemExit(7)
    if item == "hangs":
        while True:
            pass
    print("hello", item)
    return item


def test_crashes_and_hangs_are_results_like_any_other():
    done = list(isolated(fate, ["one", "dies", "two", "hangs", "three"], patience=8.0))
    assert [one.result for one in done] == ["one", None, "two", None, "three"]
    assert [one.output.strip() for one in done] == ["hello one", "", "hello two", "", "hello three"]
    assert "died" in done[1].failure and "no answer" in done[3].failure
