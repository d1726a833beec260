"""Distributes the jobs of a measurement over processes."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from multiprocessing import get_context
from typing import TypeVar

Job = TypeVar("Job")
Result = TypeVar("Result")


def in_processes(
    measured: Callable[[Job], Result], jobs: Iterable[Job], workers: int
) -> Iterator[Result]:
    """Yield the results of a function of the top level of a module, in the order of the jobs.

    With one worker, everything runs in the present process.
    """
    if workers == 1:
        yield from map(measured, jobs)
        return
    # A forked process would inherit the locks of PyTorch's threads.
    with get_context("spawn").Pool(workers) as pool:
        yield from pool.imap(measured, jobs)
