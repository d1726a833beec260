"""Tests that an interrupted measurement continues where it stopped."""

import pytest

from benchmarks import progress
from benchmarks.scale import Scale

NAME = "messes"


@pytest.fixture(autouse=True)
def folder(tmp_path, monkeypatch):
    monkeypatch.setattr(progress, "FOLDER", tmp_path / "unfinished")
    return progress.FOLDER


def squares(asked, until=None):
    """Function that squares numbers, keeps what it was asked, and fails at one number."""

    def measured(numbers):
        for number in numbers:
            if number == until:
                raise KeyboardInterrupt
            asked.append(number)
            yield number**2

    return measured


def interrupted(until, scale=Scale.FULL):
    """Results of a run through 0, …, 9 that is interrupted at a number."""
    results = []
    with pytest.raises(KeyboardInterrupt):
        results.extend(progress.resumed(NAME, scale, range(10), squares([], until)))
    return results


def repeated(scale=Scale.FULL):
    """Results of a whole run through 0, …, 9, and the numbers that it measured."""
    asked = []
    return list(progress.resumed(NAME, scale, range(10), squares(asked))), asked


@pytest.mark.slow
def test_a_second_run_measures_only_the_rest():
    interrupted(4)
    interrupted(7)
    results, asked = repeated()
    assert results == [number**2 for number in range(10)]
    assert asked == [7, 8, 9]


@pytest.mark.slow
def test_the_durations_add_up():
    assert progress.seconds_before(NAME, Scale.FULL) == 0.0
    interrupted(4)
    first = progress.seconds_before(NAME, Scale.FULL)
    interrupted(7)
    assert progress.seconds_before(NAME, Scale.FULL) > first > 0.0


@pytest.mark.slow
def test_an_incomplete_record_is_measured_again(folder):
    interrupted(4)
    (file,) = folder.iterdir()
    file.write_bytes(file.read_bytes()[:-3])
    assert repeated() == ([number**2 for number in range(10)], list(range(3, 10)))


def test_results_of_other_code_are_not_used(monkeypatch):
    interrupted(4)
    monkeypatch.setattr(progress.evidence, "code_behind", lambda name: "0" * 16)
    assert repeated()[1] == list(range(10))


@pytest.mark.slow
def test_results_of_a_saved_measurement_are_not_used():
    interrupted(4)
    progress.forget(NAME, Scale.FULL)
    assert repeated()[1] == list(range(10))


def test_short_runs_keep_nothing(folder):
    interrupted(4, Scale.SMOKE)
    assert not folder.exists()
    assert repeated(Scale.SMOKE)[1] == list(range(10))
