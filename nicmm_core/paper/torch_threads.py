"""A context in which torch uses a single thread, for reproducible training."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

import torch


@contextmanager
def single_thread() -> Iterator[None]:
    """Let torch use one thread, and restore the previous number of threads afterwards.

    Sums then do not depend on the number of cores, so the same input gives the same curve on all
    machines of the same kind. Matrices with a few thousand rows gain nothing from more threads. On
    a busy machine the threads wait for each other, which took ten times as long.
    """
    before = torch.get_num_threads()
    torch.set_num_threads(1)
    try:
        yield
    finally:
        torch.set_num_threads(before)
