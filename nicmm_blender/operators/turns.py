# SPDX-License-Identifier: GPL-3.0-or-later
"""Long work by turns: a thread that runs only while the caller waits for it.

The core works from beginning to end and only calls a progress function on its way. To let Blender
draw its window in between, the work is done in a thread that is parked inside that function
when its turn is over. Caller and thread never run at the same time, so Blender's Python sees one
thread only. The work must not touch Blender's data.
"""

import atexit
import threading
import time

import numpy as np

STACK = 64 * 1024 * 1024
"""Bytes; elsewhere than on Linux a thread gets far less than the main thread has."""

# Those that are parked; a thread must not be left behind when its work is no longer wanted.
_parked: set = set()


class Work:
    """A function of a progress function, done by turns.

    Attributes
    ----------
    fraction : float
        How much is done.
    polyline : (n, 3) float array
        The curve so far.
    done : bool
    """

    def __init__(self, function) -> None:
        self._function = function
        self._thread = None
        self._go, self._stop = threading.Semaphore(0), False
        self._back = threading.Semaphore(0)
        self._until = 0.0
        self._result, self._error = None, None
        self.fraction, self.polyline = 0.0, np.zeros((0, 3))
        self.done = False

    def turn(self, seconds: float) -> bool:
        """Go on for about so long; return whether the work is done."""
        if self.done:
            return True
        if self._thread is None:
            self._start()
        self._until = time.perf_counter() + seconds
        self._go.release()
        self._back.acquire()
        if self.done:
            _parked.discard(self)
            self._thread.join()
        return self.done

    def result(self):
        """What the function returned, or raise what it raised; after it is done."""
        if self._error is not None:
            raise self._error
        return self._result

    def cancel(self) -> None:
        """Let the function stop, and wait until it has; its result is not wanted."""
        self._stop = True
        if self._thread is None:
            self.done = True
        while not self.done:
            self.turn(0.0)

    def _start(self) -> None:
        before = threading.stack_size(STACK)
        try:
            # A daemon, so that Blender can end in any case; `stop_all` joins it before that.
            self._thread = threading.Thread(target=self._run, name="nicmm", daemon=True)
            self._thread.start()
        finally:
            threading.stack_size(before)
        _parked.add(self)

    def _run(self) -> None:
        self._go.acquire()
        try:
            self._result = self._function(self._progress)
        except BaseException as error:  # raised again where the result is asked for
            self._error = error
        self.done = True
        self._back.release()

    def _progress(self, fraction: float, polyline) -> bool:
        self.fraction = fraction
        if len(polyline):
            self.polyline = polyline
        if time.perf_counter() >= self._until and not self._stop:
            self._back.release()
            self._go.acquire()
        return not self._stop


def stop_all() -> None:
    """Cancel all that is parked: before Blender ends, opens another file or disables us."""
    for work in list(_parked):
        work.cancel()


def register() -> None:
    atexit.register(stop_all)


def unregister() -> None:
    stop_all()
    atexit.unregister(stop_all)
