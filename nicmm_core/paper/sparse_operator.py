"""A constant sparse matrix as a differentiable operator on torch tensors."""

from __future__ import annotations

import warnings
from collections.abc import Callable

import torch
from scipy import sparse
from torch import Tensor


def sparse_operator(matrix: sparse.sparray, device: torch.device) -> Callable[[Tensor], Tensor]:
    """A function that multiplies a sparse matrix (m, n) by a vector (n,), with derivatives."""
    csr = sparse.csr_array(matrix)
    with warnings.catch_warnings():
        # torch warns once per process that compressed sparse tensors are in beta.
        warnings.filterwarnings("ignore", message="Sparse")
        tensor = torch.sparse_csr_tensor(
            torch.as_tensor(csr.indptr, dtype=torch.int32),
            torch.as_tensor(csr.indices, dtype=torch.int32),
            torch.as_tensor(csr.data, dtype=torch.float32),
            size=csr.shape,
            device=device,
        )
    return lambda vector: tensor @ vector
