"""A constant sparse matrix as a differentiable operator."""

from __future__ import annotations

import warnings
from typing import Any

import torch
from scipy import sparse
from torch import Tensor


class SparseOperator:
    """Multiplication of a vector by a sparse matrix, differentiable in the vector.

    The transposed matrix is stored as well, since torch would otherwise build it anew in every
    backward pass.
    """

    def __init__(self, matrix: sparse.sparray, device: torch.device) -> None:
        self.forward_matrix = _csr_tensor(matrix, device)
        self.backward_matrix = _csr_tensor(matrix.T, device)

    def __call__(self, vector: Tensor) -> Tensor:
        """Map a vector of shape (n,) to shape (m,)."""
        return _Product.apply(vector, self)


class _Product(torch.autograd.Function):
    @staticmethod
    def forward(ctx: Any, vector: Tensor, operator: SparseOperator) -> Tensor:
        ctx.operator = operator
        return operator.forward_matrix @ vector

    @staticmethod
    def backward(ctx: Any, gradient: Tensor) -> tuple[Tensor, None]:
        return ctx.operator.backward_matrix @ gradient, None


def _csr_tensor(matrix: sparse.sparray, device: torch.device) -> Tensor:
    csr = sparse.csr_array(matrix)
    with warnings.catch_warnings():
        # torch warns once that compressed sparse tensors are in beta.
        warnings.filterwarnings("ignore", message="Sparse")
        return torch.sparse_csr_tensor(
            torch.as_tensor(csr.indptr, dtype=torch.int32),
            torch.as_tensor(csr.indices, dtype=torch.int32),
            torch.as_tensor(csr.data, dtype=torch.float32),
            size=csr.shape,
            device=device,
        )
