"""Products of dense matrices of NumPy, by a kernel, or of PyTorch."""

from __future__ import annotations

import nicmm_kernels
import numpy as np

from ..geometry.array_types import Array


def product(first: Array, second: Array) -> Array:
    """The product of two matrices (n, k) and (k, m) of one precision, shape (n, m)."""
    if not isinstance(first, np.ndarray):
        return first @ second
    return nicmm_kernels.matrix_product(np.ascontiguousarray(first), np.ascontiguousarray(second))
