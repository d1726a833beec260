"""Keeps the results of an unfinished measurement, so that an interruption loses little.

The file of a measurement holds the digest of its code, and then pairs of a result and the
seconds until then. Results of other code are not used.
"""

from __future__ import annotations

import contextlib
import pickle
import time
from collections.abc import Callable, Iterable, Iterator
from itertools import islice
from pathlib import Path
from typing import Any, TypeVar

from . import evidence
from .scale import Scale

Item = TypeVar("Item")
Result = TypeVar("Result")

FOLDER = evidence.QUICK_OUTPUT / "unfinished"


def resumed(
    name: str,
    scale: Scale,
    items: Iterable[Item],
    measured: Callable[[Iterable[Item]], Iterator[Result]],
) -> Iterator[Result]:
    """Yield a result for each item, in order, and keep it until the measurement is saved.

    Parameters
    ----------
    name : str
        Name of the measurement.
    scale : Scale
        Only full runs keep results.
    items : iterable
        The same items in the same order whenever the code is the same.
    measured : callable
        Function from items to an iterator of their results. It is called with the items that an
        interrupted run has not reached.
    """
    if scale is not Scale.FULL:
        yield from measured(items)
        return
    pairs = _read(name)
    yield from (result for result, _ in pairs)
    earlier = pairs[-1][1] if pairs else 0.0
    started = time.perf_counter()
    FOLDER.mkdir(parents=True, exist_ok=True)
    rewritten = _file(name).with_suffix(".part")  # an interrupted run may end within a record
    with rewritten.open("wb") as file:
        for record in (evidence.code_behind(name), *pairs):
            pickle.dump(record, file)
    rewritten.replace(_file(name))
    with _file(name).open("ab") as file:
        for result in measured(islice(items, len(pairs), None)):
            pickle.dump((result, earlier + time.perf_counter() - started), file)
            file.flush()
            yield result


def seconds_before(name: str, scale: Scale) -> float:
    """Duration of the interrupted runs that the next run continues."""
    pairs = _read(name) if scale is Scale.FULL else []
    return pairs[-1][1] if pairs else 0.0


def forget(name: str, scale: Scale) -> None:
    """Delete the results of a measurement that has been saved."""
    if scale is Scale.FULL:
        _file(name).unlink(missing_ok=True)


def _read(name: str) -> list[tuple[Any, float]]:
    """Results of an interrupted run of the present code, with the seconds until each of them."""
    pairs: list[tuple[Any, float]] = []
    if not _file(name).exists():
        return pairs
    with _file(name).open("rb") as file:
        if pickle.load(file) != evidence.code_behind(name):
            return pairs
        # The last record may be incomplete.
        with contextlib.suppress(EOFError, pickle.UnpicklingError):
            while True:
                pairs.append(pickle.load(file))
    return pairs


def _file(name: str) -> Path:
    return FOLDER / f"{name}.pickle"
