"""Runs work in separate processes, so that a crash or a hang is a result like any other."""

from __future__ import annotations

import concurrent.futures
import contextlib
import multiprocessing
import os
import queue
import resource
import tempfile
import time
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from multiprocessing.connection import Connection
from multiprocessing.process import BaseProcess
from typing import BinaryIO, Generic, TypeVar

Item = TypeVar("Item")
Result = TypeVar("Result")


@dataclass(frozen=True)
class Isolated(Generic[Item, Result]):
    """Outcome of one item.

    Attributes
    ----------
    item : Item
        Argument of the work.
    result : Result or None
        Return value of the work; None if the process died or was killed.
    failure : str
        How the process ended; empty if there is a result.
    output : str
        Text written to the terminal meanwhile, by Python or by compiled code.
    seconds : float
        CPU time in seconds.
    """

    item: Item
    result: Result | None
    failure: str = ""
    output: str = ""
    seconds: float = 0.0


def isolated(
    work: Callable[[Item], Result],
    items: Iterable[Item],
    patience: float,
    memory: int | None = None,
) -> Iterator[Isolated[Item, Result]]:
    """Process items one by one in a separate process, which is replaced if it dies.

    Parameters
    ----------
    work : callable
        Module-level function, since the process imports it. An exception ends the process.
    items : iterable
        Arguments of the work.
    patience : float
        Wall-clock time in seconds after which an item is given up.
    memory : int, optional
        Limit on the address space of the process, in bytes.

    Yields
    ------
    Isolated
        Outcome of each item, in order.
    """
    process, connection = None, None
    try:
        for item in items:
            if process is None or connection is None:
                process, connection = _started(work, memory)
            try:
                connection.send(item)
                if connection.poll(patience):
                    result, output, seconds = connection.recv()
                    yield Isolated(item, result, "", output, seconds)
                    continue
                failure = f"gave no answer within {patience:g} s"
                process.kill()
            except (EOFError, ConnectionError):
                process.join()
                failure = f"the process died with exit code {process.exitcode}"
            process.join()
            process, connection = None, None
            yield Isolated(item, None, failure)
    finally:
        if process is not None:
            process.kill()
            process.join()


def isolated_beside(
    work: Callable[[Item], Result], items: Iterable[Item], patience: float, workers: int
) -> Iterator[Isolated[Item, Result]]:
    """Like `isolated`, with several processes; outcomes come in the order of the items."""
    with concurrent.futures.ThreadPoolExecutor(workers) as threads:
        waiting: list[queue.Queue[Item | None]] = [queue.Queue() for _ in range(workers)]
        done: list[queue.Queue[Isolated[Item, Result]]] = [queue.Queue() for _ in range(workers)]

        def serve(worker: int) -> None:
            for one in isolated(work, iter(waiting[worker].get, None), patience):
                done[worker].put(one)

        count = 0
        for count, item in enumerate(items, start=1):
            waiting[(count - 1) % workers].put(item)
        for each in waiting:
            each.put(None)
        for worker in range(workers):
            threads.submit(serve, worker)
        for number in range(count):
            yield done[number % workers].get()


def _started(work: Callable[[Item], Result], memory: int | None) -> tuple[BaseProcess, Connection]:
    # One thread per library: busy waiting of other threads would count as CPU time.
    for library in ("OMP", "OPENBLAS", "MKL"):
        os.environ.setdefault(f"{library}_NUM_THREADS", "1")
    # A forked process would inherit locks that threads of PyTorch hold.
    context = multiprocessing.get_context("spawn")
    here, there = context.Pipe()
    process = context.Process(target=_work, args=(there, work, memory), daemon=True)
    process.start()
    there.close()
    return process, here


def _work(connection: Connection, work: Callable[[Item], Result], memory: int | None) -> None:
    if memory is not None:
        resource.setrlimit(resource.RLIMIT_AS, (memory, memory))
    with tempfile.TemporaryFile() as terminal:
        for descriptor in (1, 2):
            os.dup2(terminal.fileno(), descriptor)
        with contextlib.suppress(EOFError):  # the parent has no more items
            while True:
                item = connection.recv()
                started = time.process_time()
                result = work(item)
                seconds = time.process_time() - started
                connection.send((result, _written(terminal), seconds))


def _written(terminal: BinaryIO) -> str:
    """Text written since the last call."""
    # Python flushes line by line only to a real terminal.
    import sys

    sys.stdout.flush()
    sys.stderr.flush()
    terminal.seek(0)
    text = terminal.read().decode("utf-8", "replace")
    terminal.seek(0)
    terminal.truncate()
    return text
