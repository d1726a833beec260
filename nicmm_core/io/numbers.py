"""Parses numbers in text files."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ..geometry.array_types import FloatArray
from .polygons import FormatError

LARGEST = 2**31
"""Counts and indices of this size or more are refused: such a file would not fit into memory."""


def floats(tokens: Sequence[bytes]) -> FloatArray:
    """Convert tokens to floats.

    Raises
    ------
    FormatError
        If a token is not a number.
    """
    try:
        return np.array([float(token) for token in tokens], dtype=np.float64)
    except ValueError as error:
        raise FormatError(str(error)) from error


def integer(token: bytes) -> int:
    """Convert a token to an integer of absolute value below `LARGEST`, or raise FormatError."""
    try:
        value = int(token)
    except ValueError as error:
        raise FormatError(f"{quoted(token)} is not a whole number") from error
    if not -LARGEST < value < LARGEST:
        raise FormatError(f"{quoted(token)} is too large for a count or an index")
    return value


def quoted(token: bytes) -> str:
    """A token, shortened and escaped for an error message."""
    return ascii(token[:24].decode("latin-1"))
