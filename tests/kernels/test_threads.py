"""Rows shared among threads: the same results, and errors and cancellations that stop them all."""

from __future__ import annotations

import multiprocessing
import threading
import time

import numpy as np
import pytest
from nicmm_kernels import threads

import nicmm_core as nicmm
from nicmm_core import shapes


@pytest.fixture(params=[1, 2, 5])
def count(request, monkeypatch):
    """A number of threads, instead of that of the processors."""
    return use_threads(request.param, monkeypatch)


def use_threads(count, monkeypatch):
    monkeypatch.setattr(threads, "thread_count", lambda: count)
    threads._executor.cache_clear()
    return count


@pytest.fixture(autouse=True)
def own_executor():
    yield
    threads._executor.cache_clear()


def squares(rows, meanwhile):
    meanwhile()
    return [row * row for row in range(rows.start, rows.stop)]


@pytest.mark.parametrize("rows", [0, 1, 4, 23])
def test_results_come_in_order(count, rows):
    parts = threads.in_threads(squares, rows, lambda: None)
    assert [each for part in parts for each in part] == [row * row for row in range(rows)]
    used = min(count, rows)
    assert len(parts) == (min(threads.PARTS_OF_A_THREAD * used, rows) if used > 1 else 1)


def test_few_rows_are_not_shared(count):
    assert len(threads.in_threads(squares, 99, lambda: None, fewest=50)) == 1


def test_rows_are_computed_at_the_same_time(monkeypatch):
    use_threads(3, monkeypatch)
    all_begun = threading.Barrier(3, timeout=30.0)
    threads.in_threads(lambda rows, meanwhile: all_begun.wait(), 3, lambda: None)


@pytest.mark.parametrize("failing", [0, 2])
def test_an_error_stops_all_threads(monkeypatch, failing):
    use_threads(3, monkeypatch)
    ended = []

    def compute(rows, meanwhile):
        if rows.start == failing:
            raise ValueError("one row")
        while rows.start == 1:  # the second thread goes on until it is stopped
            try:
                meanwhile()
            except BaseException:
                ended.append(rows.start)
                raise
            time.sleep(0.001)

    with pytest.raises(ValueError, match="one row"):
        threads.in_threads(compute, 3, lambda: None)
    assert ended == [1]


def test_cancelling_stops_all_threads(monkeypatch):
    use_threads(3, monkeypatch)
    ended = []

    def compute(rows, meanwhile):
        try:
            while rows.start:
                meanwhile()
                time.sleep(0.001)
        finally:
            ended.append(rows.start)

    def cancel():
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        threads.in_threads(compute, 3, cancel)
    assert sorted(ended) == [0, 1, 2]


@pytest.mark.slow
def test_a_design_does_not_depend_on_the_number_of_threads(monkeypatch):
    mesh = shapes.torus(around=60, across=30)
    points = [3, 700, 1200, 1500]
    curves = []
    for number in (1, 2, 3):
        use_threads(number, monkeypatch)
        curves.append(nicmm.design_curve(mesh, points, closed=True).curves[0])
    for curve in curves[1:]:
        np.testing.assert_array_equal(curve.points, curves[0].points)


def test_the_number_of_threads_can_be_chosen(monkeypatch):
    monkeypatch.setenv(threads.THREADS_VARIABLE, "3")
    threads.thread_count.cache_clear()
    try:
        assert threads.thread_count() == 3
    finally:
        threads.thread_count.cache_clear()


def _in_a_forked_process(queue):
    queue.put(threads.in_threads(squares, 4, lambda: None))


@pytest.mark.skipif(
    "fork" not in multiprocessing.get_all_start_methods(), reason="no fork on this platform"
)
def test_a_forked_process_has_threads_of_its_own(monkeypatch):
    use_threads(2, monkeypatch)
    expected = threads.in_threads(squares, 4, lambda: None)
    context = multiprocessing.get_context("fork")
    queue = context.Queue()
    process = context.Process(target=_in_a_forked_process, args=(queue,))
    process.start()
    assert queue.get(timeout=30.0) == expected
    process.join()
