"""Lets NumPy and SciPy multiply matrices in one thread.

Sums then do not depend on the number of processors, so the same input gives the same curve on all
machines of the same kind. The matrices here are small: further threads gain nothing, and on a busy
machine they wait for each other, which took six times as long. Apple's Accelerate, with which some
builds of NumPy for macOS multiply, cannot be limited.
"""

from __future__ import annotations

import threading
from collections.abc import Iterator
from contextlib import contextmanager
from functools import cache

from threadpoolctl import ThreadpoolController

_limited = threading.Lock()
"""Held by the context that has set the limit; there is one number of threads in a process."""


@contextmanager
def single_blas_thread() -> Iterator[None]:
    """One BLAS thread, and the former number of threads afterwards.

    Contexts within another one, also in other threads, do nothing. So one that lasts longer than
    the context that set the limit ends with the former number of threads.
    """
    if not _limited.acquire(blocking=False):
        yield
        return
    try:
        with _controller().limit(limits=1, user_api="blas"):
            yield
    finally:
        _limited.release()


@cache
def _controller() -> ThreadpoolController:
    """The BLAS libraries of this process; finding them takes some milliseconds."""
    return ThreadpoolController()
