"""Factorisation of symmetric positive definite systems."""

from __future__ import annotations

from scipy import sparse
from scipy.sparse import linalg


def factorise(matrix: sparse.sparray) -> linalg.SuperLU:
    """LU factors of a symmetric positive definite matrix, without pivoting off the diagonal.

    SciPy has no sparse Cholesky; with an ordering for symmetric patterns its LU is about five
    times faster than with the default one. Unlike Cholesky it also survives the rounding that
    makes a system of very thin triangles barely indefinite.
    """
    return linalg.splu(
        sparse.csc_array(matrix),
        permc_spec="MMD_AT_PLUS_A",
        diag_pivot_thresh=0.0,
        options={"SymmetricMode": True},
    )
