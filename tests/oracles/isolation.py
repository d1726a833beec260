"""Work in a process of its own, so that a crash or a hang is a result like any other."""

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
    """What came of one item.

    Attributes
    ----------
    item : Item
    result : Result or None
        None where the process died or was stopped.
    failure : str
        How it died; empty where there is a result.
    output : str
        What was written to the terminal meanwhile, by Python or below it.
    seconds : float
        Of CPU time.
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
    """Do work on each item in a process of its own; another takes over where it dies.

    Parameters
    ----------
    work : callable
        Of a module, since the process imports it. What it raises ends the process.
    items : iterable
    patience : float
        Seconds by the wall clock after which an item is given up.
    memory : int, optional
        Bytes of address space that the process may have.
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
    """`isolated`, by several processes at once; results come in the order of the items."""
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
    # CPU seconds are those of one core: threads that wait for each other would count as well.
    for library in ("OMP", "OPENBLAS", "MKL"):
        os.environ.setdefault(f"{library}_NUM_THREADS", "1")
    # A forked process would inherit the locks of PyTorch's threads.
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
        with contextlib.suppress(EOFError):  # the other side has no more items
            while True:
                item = connection.recv()
                started = time.process_time()
                result = work(item)
                seconds = time.process_time() - started
                connection.send((result, _written(terminal), seconds))


def _written(terminal: BinaryIO) -> str:
    """What has been written, which is then forgotten."""
    # Python's own buffers are written line by line to a terminal only.
    import sys

    sys.stdout.flush()
    sys.stderr.flush()
    terminal.seek(0)
    text = terminal.read().decode("utf-8", "replace")
    terminal.seek(0)
    terminal.truncate()
    return text
