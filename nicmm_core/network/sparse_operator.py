"""A constant sparse matrix as a differentiable operator."""

from __future__ import annotations

import warnings
from collections.abc import Callable

import torch
from scipy import sparse
from torch import Tensor


def sparse_operator(matrix: sparse.sparray, device: torch.device) -> Callable[[Tensor], Tensor]:
    """Multiplication of a vector (n,) by a sparse matrix (m, n), differentiable in the vector."""
    csr = sparse.csr_array(matrix)
    with warnings.catch_warnings():
        # torch warns once that compressed sparse tensors are in beta.
        warnings.filterwarnings("ignore", message="Sparse")
        tensor = torch.sparse_csr_tensor(
            torch.as_tensor(csr.indptr, dtype=torch.int32),
            torch.as_tensor(csr.indices, dtype=torch.int32),
            torch.as_tensor(csr.data, dtype=torch.float32),
            size=csr.shape,
            device=device,
        )
    return lambda vector: tensor @ vector
