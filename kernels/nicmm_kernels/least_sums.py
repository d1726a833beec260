# SPDX-License-Identifier: GPL-3.0-or-later
"""The product of two matrices with sums instead of products, and minima instead of sums."""

from __future__ import annotations

import numpy as np

from .library import COUNT, FLOAT, POINTER, FloatArray, Kernel, address, rows

_LEAST_SUMS = Kernel("least_sums", *[COUNT] * 3, *[POINTER] * 3)


def least_sums(one: FloatArray, other: FloatArray) -> FloatArray:
    """The least sums over the middle, (a, c), of entries of two matrices, (a, b) and (b, c).

    The matrices should have at most some hundred rows and columns, since the call is not divided.
    """
    a, b = rows("one", one), rows("other", other)
    c = other.shape[1] if other.ndim == 2 else 0
    sums = np.empty((a, c))
    _LEAST_SUMS(
        a, b, c, address("one", one, FLOAT, a, b), address("other", other, FLOAT, b, c),
        sums.ctypes.data,
    )  # fmt: skip
    return sums
