# SPDX-License-Identifier: GPL-3.0-or-later
"""Long work in time slices: a thread that runs only while the caller waits for it.

The core computes a curve in one call and calls a progress function now and then. So that Blender
can draw its window in between, the work runs in a thread that blocks inside the progress function
at the end of each time slice. Caller and thread never run at the same time, so at any time only one
of them uses Blender's Python. The work must not access Blender's data.
"""

from __future__ import annotations

import atexit
import threading
import time
from collections.abc import Callable
from typing import TYPE_CHECKING, Any, Generic, TypeVar

import numpy as np

if TYPE_CHECKING:
    from ...nicmm_core.progress import Progress

Result = TypeVar("Result")

STACK = 64 * 1024 * 1024
"""Stack size in bytes. Except on Linux, threads get far less than the main thread by default."""

# Work whose thread exists and is blocked; `stop_all` ends these threads.
_parked: set[Work[Any]] = set()


class Work(Generic[Result]):
    """A function that takes a progress function, run in time slices.

    Attributes
    ----------
    fraction : float
        Fraction of the work that is done.
    polyline : (n, 3) float array
        The unfinished curve; empty if there is none yet.
    done : bool
        Whether the function has returned, raised an error or been cancelled.
    """

    def __init__(self, function: Callable[[Progress], Result]) -> None:
        self._function = function
        self._thread: threading.Thread | None = None
        self._go, self._stop = threading.Semaphore(0), False
        self._back = threading.Semaphore(0)
        self._until = 0.0
        self._result: Result
        self._error: BaseException | None = None
        self.fraction, self.polyline = 0.0, np.zeros((0, 3))
        self.done = False

    def run_slice(self, seconds: float) -> bool:
        """Continue for about this many seconds; return whether the work is done."""
        if not self.done:
            self._thread = self._thread or self._start()
            self._until = time.perf_counter() + seconds
            self._go.release()
            self._back.acquire()
        if self.done and self._thread is not None:
            _parked.discard(self)
            self._thread.join()
        return self.done

    def result(self) -> Result:
        """Return the result of the function or raise its error. Call only when the work is done."""
        if self._error is not None:
            raise self._error
        return self._result

    def cancel(self) -> None:
        """Stop the function, wait until it has stopped and discard its result."""
        self._stop = True
        if self._thread is None:
            self.done = True
        while not self.done:
            self.run_slice(0.0)

    def _start(self) -> threading.Thread:
        before = threading.stack_size(STACK)
        try:
            # A daemon thread, so that Blender can always quit; `stop_all` joins it before that.
            thread = threading.Thread(target=self._run, name="nicmm", daemon=True)
            thread.start()
        finally:
            threading.stack_size(before)
        _parked.add(self)
        return thread

    def _run(self) -> None:
        self._go.acquire()
        try:
            self._result = self._function(self._progress)
        except BaseException as error:  # raised again in `result`
            self._error = error
        self.done = True
        self._back.release()

    def _progress(self, fraction: float, polyline: np.ndarray) -> bool:
        self.fraction = fraction
        if len(polyline):
            self.polyline = polyline
        if time.perf_counter() >= self._until and not self._stop:
            self._back.release()
            self._go.acquire()
        return not self._stop


def stop_all() -> None:
    """Cancel all blocked work, before Blender quits or the extension is disabled."""
    for work in list(_parked):
        work.cancel()


def register() -> None:
    atexit.register(stop_all)


def unregister() -> None:
    stop_all()
    atexit.unregister(stop_all)
