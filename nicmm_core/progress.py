"""Progress reports and cancellation of a design.

Any stage may take a long time, from the search for a path to the relaxation. So every stage calls
`checkpoint` often; a call costs little more than reading a clock. `watched` sets the progress
function of the design that runs in the current context, so that stages need no parameter for it.

`checkpoint` may raise `CancelledError`. Call it only where data that outlive the design are
consistent.
"""

from __future__ import annotations

import contextlib
import time
from collections.abc import Callable, Iterator
from contextvars import ContextVar

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]

Progress = Callable[[float, FloatArray], object]
"""Function of the fraction done and the points of the current curve, (n, 3).

It cancels the design by returning False.
"""

Placement = Callable[[FloatArray], FloatArray]
"""Map from positions on a copy of a mesh, (n, 3), to positions on the mesh of the caller."""

INTERVAL = 0.1
"""Least time between two calls of a progress function, in seconds.

A cancellation usually takes effect within 0.2 s. On meshes of a million faces it may take longer,
since checkpoints are farther apart there.
"""


class CancelledError(Exception):
    """The caller has cancelled. Internal: `Design.status` reports the cancellation."""


class _Watch:
    """A progress function with the time of its next call and the arguments of its last call."""

    def __init__(self, progress: Progress) -> None:
        self._progress = progress
        self._fraction = 0.0
        self._points = np.zeros((0, 3))
        self._pending: Callable[[], FloatArray] | None = None
        self._shown = self._stopped = False
        self._next_call = time.perf_counter() + INTERVAL
        self._next_points = 0.0
        # The subrange of the current stage, and the map of its points to the mesh of the caller.
        self.low, self.high = 0.0, 1.0
        self.place: Placement = lambda points: points

    def ask(self, done: float | None, points: Callable[[], FloatArray] | None) -> None:
        """Call the function if it is due; raise CancelledError if it has returned False."""
        if self._stopped:
            raise CancelledError
        if done is not None:
            self._fraction = max(self._fraction, self.low + done * (self.high - self.low))
        if points is not None:
            place = self.place
            self._pending = lambda: place(points())
        now = time.perf_counter()
        new = self._pending is not None and now >= self._next_points
        # The first curve is shown without waiting for the interval.
        if now < self._next_call and (self._shown or not new):
            return
        self._next_call = now + INTERVAL
        if self._pending is not None and new:
            find, self._pending = self._pending, None
            self._points, self._shown = find(), True
            after = time.perf_counter()
            # Evaluating the points takes at most about a tenth of the time.
            self._next_points = after + 10.0 * (after - now)
        # The caller may modify the copy.
        answer = self._progress(self._fraction, self._points.copy())
        self._stopped = isinstance(answer, bool | np.bool_) and not answer
        self._next_call = time.perf_counter() + INTERVAL
        if self._stopped:
            raise CancelledError


_watch: ContextVar[_Watch | None] = ContextVar("watch", default=None)


@contextlib.contextmanager
def watched(progress: Progress | None) -> Iterator[None]:
    """Report the progress of this block to a function, if there is one; False cancels."""
    token = _watch.set(None if progress is None else _Watch(progress))
    try:
        yield
    finally:
        _watch.reset(token)


def checkpoint(done: float | None = None, points: Callable[[], FloatArray] | None = None) -> None:
    """Report progress, and cancel the design if the caller has asked for it.

    Parameters
    ----------
    done : float, optional
        Fraction of the current subrange that is done.
    points : callable, optional
        Returns the points of the current curve, (n, 3); called only when they are shown.

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
    """Map the progress of this block to a subrange, given by two fractions of the current range."""
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
def uninterrupted() -> Iterator[None]:
    """Neither report progress nor cancel in this block, which must not take long."""
    token = _watch.set(None)
    try:
        yield
    finally:
        _watch.reset(token)


@contextlib.contextmanager
def placed(place: Placement) -> Iterator[None]:
    """Map the points that this block reports, (n, 3), to other positions by a function."""
    watch = _watch.get()
    if watch is None:
        yield
        return
    before = watch.place
    watch.place = lambda points: before(place(points))
    try:
        yield
    finally:
        watch.place = before
