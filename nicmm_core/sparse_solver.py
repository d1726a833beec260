"""Factorisation of symmetric positive definite systems."""

from __future__ import annotations

import numpy as np
from scipy import sparse
from scipy.sparse import linalg

from .errors import MeshError

DEGENERATE = (
    "faces: the part of the mesh with the control points has faces without area, on which no "
    "distance can be computed; merge vertices by distance or dissolve degenerate faces"
)


def factorise(matrix: sparse.sparray) -> linalg.SuperLU:
    """LU factors of a symmetric positive definite matrix, without pivoting off the diagonal.

    SciPy has no sparse Cholesky; with an ordering for symmetric patterns its LU is about five
    times faster than with the default one. Unlike Cholesky it also survives the rounding that
    makes a system of very thin triangles barely indefinite.

    Raises
    ------
    MeshError
        If the matrix is singular or not finite, as faces without area make it.
    """
    if not np.isfinite(matrix.data).all():
        raise MeshError(DEGENERATE)
    try:
        return linalg.splu(
            sparse.csc_array(matrix),
            permc_spec="MMD_AT_PLUS_A",
            diag_pivot_thresh=0.0,
            options={"SymmetricMode": True},
        )
    except RuntimeError as error:  # "Factor is exactly singular"
        raise MeshError(DEGENERATE) from error
