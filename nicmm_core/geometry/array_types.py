"""Names for the array types in signatures; docstrings give the shapes."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]
BoolArray = NDArray[np.bool_]

Array = Any
"""A NumPy array or a PyTorch tensor, in functions that accept both."""
