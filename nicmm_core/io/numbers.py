"""Parses numbers in text."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ..geometry.array_types import FloatArray, IntArray
from .polygons import FormatError

LARGEST = 2**31
"""Larger counts and indices are refused, since such a file would not fit into memory."""


def floats(tokens: Sequence[bytes]) -> FloatArray:
    """Tokens as floats.

    Raises
    ------
    FormatError
        If one is not a number.
    """
    try:
        return np.array([float(token) for token in tokens], dtype=np.float64)
    except ValueError as error:
        raise FormatError(str(error)) from error


def whole(token: bytes) -> int:
    """A token as an integer with absolute value below `LARGEST`."""
    try:
        value = int(token)
    except ValueError as error:
        raise FormatError(f"{shown(token)} is not a whole number") from error
    if not -LARGEST < value < LARGEST:
        raise FormatError(f"{shown(token)} is too large for a count or an index")
    return value


def wholes(tokens: Sequence[bytes]) -> IntArray:
    """Tokens as integers, see `whole`."""
    return np.array([whole(token) for token in tokens], dtype=np.int64)


def shown(token: bytes) -> str:
    """A token shortened and escaped for a message."""
    return ascii(token[:24].decode("latin-1"))
