"""Lets NumPy and SciPy multiply matrices in one thread.

Sums then do not depend on the number of processors, so the same input gives the same curve
everywhere. The matrices here are small: further threads gain nothing, and on a busy machine they
wait for each other, which took six times as long.
"""

from __future__ import annotations

from contextlib import AbstractContextManager
from functools import cache

from threadpoolctl import ThreadpoolController


def single_blas_thread() -> AbstractContextManager[object]:
    """A context with one BLAS thread, which restores the former number of threads.

    While several threads of the process are in such a context, the first one decides.
    """
    limit: AbstractContextManager[object] = _controller().limit(limits=1, user_api="blas")
    return limit


@cache
def _controller() -> ThreadpoolController:
    """The BLAS libraries of this process; finding them takes some milliseconds."""
    return ThreadpoolController()
