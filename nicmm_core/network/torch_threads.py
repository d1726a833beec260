"""One thread for the network."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

import torch


@contextmanager
def single_thread() -> Iterator[None]:
    """Let torch use one thread, and as many as before afterwards.

    Sums then do not depend on the number of cores, so the same input gives the same curve on every
    machine of a kind. The matrices of a few thousand rows gain nothing from more threads, and on
    a busy machine the threads of a step wait for one another, which took ten times as long.
    """
    before = torch.get_num_threads()
    torch.set_num_threads(1)
    try:
        yield
    finally:
        torch.set_num_threads(before)
