"""Products of matrices are those of NumPy, to the last bit whatever vectors the processor has."""

import nicmm_kernels
import numpy as np
import pytest
from nicmm_kernels import KernelError, matrix_product


def matrices(n, k, m, precision):
    rng = np.random.default_rng(n + k + m)
    return tuple(rng.normal(size=shape).astype(precision) for shape in ((n, k), (k, m)))


@pytest.mark.parametrize("precision", [np.float32, np.float64])
@pytest.mark.parametrize(
    "shape", [(1, 1, 1), (3, 0, 5), (0, 3, 2), (4, 2, 0), (7, 16, 16), (9, 300, 17), (130, 64, 33)]
)
def test_products(shape, precision):
    n, k, m = shape
    first, second = matrices(*shape, precision)
    product = matrix_product(first, second)
    assert product.shape == (n, m) and product.dtype == precision
    exact = first.astype(float) @ second.astype(float)
    bound = np.abs(first).astype(float) @ np.abs(second).astype(float)
    assert (np.abs(product - exact) <= (k + 1) * np.finfo(precision).eps * bound).all()


@pytest.mark.parametrize("precision", [np.float32, np.float64])
def test_terms_are_added_in_their_order(precision):
    """So narrow and wide vectors give the same bits."""
    first, second = matrices(6, 600, 21, precision)
    in_order = np.zeros((6, 21), dtype=precision)
    for term in range(600):
        in_order += first[:, term, None] * second[term]
    for wide in (False, True):
        np.testing.assert_array_equal(matrix_product(first, second, wide=wide), in_order)


@pytest.mark.parametrize(
    ("first", "second"),
    [
        (np.ones((2, 3), dtype=int), np.ones((3, 2))),
        (np.ones((2, 3)), np.ones((3, 2), dtype=np.float32)),
        (np.ones((2, 3)), np.ones((2, 3))),
        (np.ones((2, 3)), np.ones((2, 3)).T),
        (np.ones(3), np.ones((3, 2))),
        (np.ones((2, 3)), np.ones(3)),
        ([[1.0]], np.ones((1, 1))),
    ],
)
def test_other_arrays_are_refused(first, second):
    with pytest.raises(KernelError):
        nicmm_kernels.matrix_product(first, second)
