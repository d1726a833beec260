"""How far a design is: what the caller is shown, and whether to go on.

Time goes by in many places, from the search for a path to the relaxation, and in any of them the
caller may have had enough. So whatever may take long calls `checkpoint` again and again; it costs
little more than reading a clock. Who listens belongs to the design that is running in this thread
and not to the signatures of all stages: `watched` says who it is.

A checkpoint may leave by `CancelledError`. It stands where nothing is half changed that outlives
the design.
"""

from __future__ import annotations

import contextlib
import time
from collections.abc import Callable, Iterator
from contextvars import ContextVar

import numpy as np

from .geometry.array_types import FloatArray

Progress = Callable[[float, FloatArray], object]
"""Called with the fraction done and the points of the curve so far, (n, 3); False stops."""

INTERVAL = 0.1
"""Least seconds between two calls of a caller's progress function.

A few times a second, and often enough that a wish to stop is heard within 0.2 seconds.
"""

SHOWING = 10.0
"""Least time between two sets of points, relative to what finding the former took."""


class CancelledError(Exception):
    """The caller wants no more; for use inside, the result of a design says so by its status."""


class _Watch:
    """A progress function, when it was called and what it has been told."""

    def __init__(self, progress: Progress) -> None:
        self._progress = progress
        self._fraction = 0.0
        self._points = np.zeros((0, 3))
        self._pending: Callable[[], FloatArray] | None = None
        self._shown = self._stopped = False
        self._next_call = time.perf_counter() + INTERVAL
        self._next_points = 0.0
        # The part of the whole that is being done, and where its points are in space.
        self.low, self.high = 0.0, 1.0
        self.offset = np.zeros(3)

    def ask(self, done: float | None, points: Callable[[], FloatArray] | None) -> None:
        """Call the function if it is time to; raise CancelledError where it has said False."""
        if self._stopped:
            raise CancelledError
        if done is not None:
            self._fraction = max(self._fraction, self.low + done * (self.high - self.low))
        if points is not None:
            self._pending = points
        now = time.perf_counter()
        new = self._pending is not None and now >= self._next_points
        # What is the first curve is shown at once.
        if now < self._next_call and (self._shown or not new):
            return
        self._next_call = now + INTERVAL
        if self._pending is not None and new:
            find, self._pending = self._pending, None
            self._points, self._shown = find() + self.offset, True
            after = time.perf_counter()
            self._next_points = after + SHOWING * (after - now)
        # A copy, with which the caller may do as it likes.
        answer = self._progress(self._fraction, self._points.copy())
        self._stopped = isinstance(answer, bool | np.bool_) and not answer
        self._next_call = time.perf_counter() + INTERVAL
        if self._stopped:
            raise CancelledError


_watch: ContextVar[_Watch | None] = ContextVar("watch", default=None)


@contextlib.contextmanager
def watched(progress: Progress | None) -> Iterator[None]:
    """Tell a function, or nobody, of what is done in this block, and stop when it says False."""
    token = _watch.set(None if progress is None else _Watch(progress))
    try:
        yield
    finally:
        _watch.reset(token)


def checkpoint(done: float | None = None, points: Callable[[], FloatArray] | None = None) -> None:
    """A place at which a design may be cancelled.

    Parameters
    ----------
    done : float, optional
        Fraction of the present part that is done.
    points : callable, optional
        Gives the points of the curve so far, (n, 3); called when they are to be shown.

    Raises
    ------
    CancelledError
        If the progress function has returned False.
    """
    watch = _watch.get()
    if watch is not None:
        watch.ask(done, points)


@contextlib.contextmanager
def subrange(start: float, end: float) -> Iterator[None]:
    """What is done in this block is one part of what is being done, by fractions of it."""
    watch = _watch.get()
    if watch is None:
        yield
        return
    low, high = watch.low, watch.high
    watch.low, watch.high = low + start * (high - low), low + end * (high - low)
    try:
        watch.ask(0.0, None)
        yield
    finally:
        watch.low, watch.high = low, high


@contextlib.contextmanager
def displaced(offset: FloatArray) -> Iterator[None]:
    """Points of this block are shown as far away as the offset, (3,)."""
    watch = _watch.get()
    if watch is None:
        yield
        return
    before = watch.offset
    watch.offset = before + offset
    try:
        yield
    finally:
        watch.offset = before
