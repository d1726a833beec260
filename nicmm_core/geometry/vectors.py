"""Products and lengths of arrays of vectors.

The first axis holds the components, since operations along a long last axis are several times as
fast as along an axis of length three. Callers transpose arrays of row vectors, (n, 3).
"""

from __future__ import annotations

import numpy as np

from . import tolerances
from .array_types import FloatArray


def dot(one: FloatArray, other: FloatArray) -> FloatArray:
    """Dot products, (3, …) and (3, …) to (…)."""
    return one[0] * other[0] + one[1] * other[1] + one[2] * other[2]


def cross(one: FloatArray, other: FloatArray) -> FloatArray:
    """Cross products, (3, …)."""
    return np.array(
        [
            one[1] * other[2] - one[2] * other[1],
            one[2] * other[0] - one[0] * other[2],
            one[0] * other[1] - one[1] * other[0],
        ]
    )


def lengths(vectors: FloatArray) -> FloatArray:
    """Lengths of vectors, (3, …) to (…)."""
    return np.sqrt(dot(vectors, vectors))


def unit(vectors: FloatArray) -> FloatArray:
    """Vectors, (3, …), divided by their lengths."""
    return vectors / np.maximum(lengths(vectors), tolerances.TINY)
