"""Numbers in text."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ..geometry.array_types import FloatArray, IntArray
from .polygons import FormatError

LARGEST = 2**31
"""Counts and indices from here on are refused: no file that fits into memory has as many."""


def floats(tokens: Sequence[bytes]) -> FloatArray:
    """Tokens as floats.

    Raises
    ------
    FormatError
        If one is no number.
    """
    try:
        return np.array([float(token) for token in tokens], dtype=np.float64)
    except ValueError as error:
        raise FormatError(str(error)) from error


def whole(token: bytes) -> int:
    """A token as a whole number below `LARGEST` in size."""
    try:
        value = int(token)
    except ValueError as error:
        raise FormatError(f"{shown(token)} is no whole number") from error
    if not -LARGEST < value < LARGEST:
        raise FormatError(f"{shown(token)} is beyond every count and index")
    return value


def wholes(tokens: Sequence[bytes]) -> IntArray:
    """Tokens as whole numbers, see `whole`."""
    return np.array([whole(token) for token in tokens], dtype=np.int64)


def shown(token: bytes) -> str:
    """A token as a message shows it: short and printable."""
    return ascii(token[:24].decode("latin-1"))
