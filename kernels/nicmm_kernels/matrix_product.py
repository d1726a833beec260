# SPDX-License-Identifier: GPL-3.0-or-later
"""Products of matrices in single and double precision."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from .library import COUNT, POINTER, Kernel, KernelError, address, has_wide_vectors, rows

Matrix = NDArray[np.floating[Any]]

_ARGUMENTS = [*[COUNT] * 3, *[POINTER] * 2, COUNT, POINTER]
_PRODUCTS = {
    np.dtype(np.float32): Kernel("single_product", *_ARGUMENTS),
    np.dtype(np.float64): Kernel("double_product", *_ARGUMENTS),
}


def matrix_product(first: Matrix, second: Matrix, wide: bool = True) -> Matrix:
    """The product of two contiguous matrices (n, k) and (k, m) of one precision, shape (n, m).

    Its time does not depend on how NumPy was built: some builds, as with Blender on Debian, have no
    optimised BLAS and take ten times as long. An optimised one takes half as long. The
    matrices should have at most some thousand rows and some hundred columns, since the call is not
    divided.

    Parameters
    ----------
    wide : bool, optional
        Whether the processor's wide vectors are used where it has them. The result is the same.
    """
    n, k = rows("first", first), rows("second", second)
    m = second.shape[1] if second.ndim == 2 else 0
    if first.dtype not in _PRODUCTS:
        raise KernelError(f"first has type {first.dtype}; pass single or double precision")
    product = np.zeros((n, m), dtype=first.dtype)
    _PRODUCTS[first.dtype](
        n, k, m, address("first", first, first.dtype, n, k),
        address("second", second, first.dtype, k, m), wide and has_wide_vectors(),
        product.ctypes.data,
    )  # fmt: skip
    return product
