"""Factorisation of sparse symmetric systems, positive definite or quasi-definite."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from scipy import sparse
from scipy.sparse import csgraph, linalg

from ..errors import MeshError
from ..geometry.array_types import FloatArray, IntArray
from ..progress import checkpoint

DEGENERATE = (
    "faces: the part of the mesh with the control points has faces without area, on which no "
    "distance can be computed; merge vertices by distance or dissolve degenerate faces"
)


Solve = Callable[[FloatArray], FloatArray]
"""A function that solves a factorised system for one right-hand side, (n,), or several, (n, k)."""


def factorised(matrix: sparse.sparray) -> Solve:
    """Factorise a symmetric positive definite or quasi-definite matrix with diagonal pivots.

    SciPy has no sparse Cholesky factorisation. With an ordering for symmetric patterns, its LU
    factorisation is about five times faster than with the default ordering. Unlike Cholesky, it
    also handles systems on very thin triangles that rounding makes slightly indefinite. SuperLU is
    slow on large matrices whose rows are in the order of a subdivided mesh: 42 s for the Laplacian
    of 64,000 vertices, but 0.35 s after a reverse Cuthill–McKee ordering, with the same fill.

    Parameters
    ----------
    matrix : (n, n) sparse array

    Returns
    -------
    Solve
        Solver for right-hand sides.

    Raises
    ------
    MeshError
        If the matrix is singular or has entries that are not finite, as with faces without area.
    """
    if not np.isfinite(matrix.data).all():
        raise MeshError(DEGENERATE)
    checkpoint()
    order: IntArray | slice = slice(None)
    if matrix.shape[0] >= 4000:
        rows = sparse.csr_array(matrix)
        order = csgraph.reverse_cuthill_mckee(rows, symmetric_mode=True).astype(np.int64)
        matrix = rows[order][:, order]
    try:
        factors = linalg.splu(
            sparse.csc_array(matrix),
            permc_spec="MMD_AT_PLUS_A",
            diag_pivot_thresh=0.0,
            options={"SymmetricMode": True},
        )
    except RuntimeError as error:  # "Factor is exactly singular"
        raise MeshError(DEGENERATE) from error

    def solve(right: FloatArray) -> FloatArray:
        solution = np.empty_like(right)
        solution[order] = factors.solve(right[order])
        return solution

    return solve
