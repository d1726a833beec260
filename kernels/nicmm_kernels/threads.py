# SPDX-License-Identifier: GPL-3.0-or-later
"""Shares the rows of a computation among threads.

The library lets other threads of Python run while it computes. Every row is computed on its own, so
results do not depend on the number of threads.
"""

from __future__ import annotations

import os
from collections.abc import Callable
from concurrent.futures import FIRST_EXCEPTION, ThreadPoolExecutor, wait
from functools import cache
from threading import Event, Lock
from typing import TypeVar

THREADS_VARIABLE = "NICMM_THREADS"
"""Environment variable with the number of threads, instead of that of the available processors."""

MOST_THREADS = 8
"""Greatest number of threads without this variable; more would hardly gain anything."""

PARTS_OF_A_THREAD = 4
"""Number of parts that a thread computes in turn, since some rows take longer than others."""

PATIENCE = 0.02
"""Seconds between two calls of the caller's function while other threads compute."""

Meanwhile = Callable[[], object]
Result = TypeVar("Result")


class _StoppedError(Exception):
    """Another thread has failed or the caller has cancelled."""


@cache
def thread_count() -> int:
    """Number of threads among which rows are shared."""
    given = os.environ.get(THREADS_VARIABLE)
    if given is not None:
        return max(1, int(given))
    available = getattr(os, "sched_getaffinity", None)
    processors = len(available(0)) if available else os.cpu_count() or 1
    return min(processors, MOST_THREADS)


@cache
def _executor() -> ThreadPoolExecutor:
    return ThreadPoolExecutor(thread_count() - 1, thread_name_prefix="nicmm_kernels")


if hasattr(os, "register_at_fork"):  # a forked process has none of the threads
    os.register_at_fork(after_in_child=_executor.cache_clear)


def in_threads(
    compute: Callable[[slice, Meanwhile], Result],
    count: int,
    meanwhile: Meanwhile,
    fewest: int = 1,
) -> list[Result]:
    """Compute consecutive parts of some rows in several threads, and return their results in order.

    Parameters
    ----------
    compute : callable
        Computes a slice of the rows, and calls a function from time to time. It must not wait for
        other threads.
    count : int
        Number of rows.
    meanwhile : callable
        Called from the present thread; an error that it raises stops all threads.
    fewest : int
        Least number of rows for which another thread is worthwhile.
    """
    threads = min(thread_count(), count // fewest)
    if threads <= 1:
        return [compute(slice(0, count), meanwhile)]
    parts = min(PARTS_OF_A_THREAD * threads, count // fewest)
    bounds = [count * part // parts for part in range(parts + 1)]
    slices = [slice(*pair) for pair in zip(bounds, bounds[1:], strict=False)]
    results: list[list[Result]] = [[] for _ in slices]
    left, lock, stop = list(range(parts))[::-1], Lock(), Event()

    def check() -> None:
        if stop.is_set():
            raise _StoppedError

    def check_and_ask() -> None:
        check()
        meanwhile()

    def compute_parts(meanwhile: Meanwhile) -> None:
        try:
            while True:
                with lock:
                    if not left:
                        return
                    part = left.pop()
                results[part].append(compute(slices[part], meanwhile))
        except BaseException:
            stop.set()
            raise

    others = [_executor().submit(compute_parts, check) for _ in range(threads - 1)]
    try:
        compute_parts(check_and_ask)
        while wait(others, PATIENCE, FIRST_EXCEPTION).not_done:
            check_and_ask()
    except BaseException as error:
        stop.set()
        wait(others)
        if not isinstance(error, _StoppedError):
            raise
    for other in others:
        problem = other.exception()
        if problem is not None and not isinstance(problem, _StoppedError):
            raise problem
    return [result for (result,) in results]
