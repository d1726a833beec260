# SPDX-License-Identifier: GPL-3.0-or-later
"""Loads the library, and checks everything that is passed to it.

The library trusts the sizes that it is given, so they are all derived from the arrays, with the
functions of this module; nothing but this package calls the library. It checks every index before
it uses it.

A call may not take long, since other code has to look after progress and cancelling. So a kernel
whose work has no small bound stops after a certain amount of it, and is called again until all is
done; in between, it calls a function of the caller.
"""

from __future__ import annotations

import ctypes
import os
import platform
import sys
from collections.abc import Callable
from functools import cache, cached_property
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]
BoolArray = NDArray[np.bool_]

MOST_WORK = 500_000
"""Number of faces that a call may cross before it returns, which takes some 0.03 s."""

LIBRARY_VARIABLE = "NICMM_KERNELS_LIBRARY"
"""Environment variable with the path of another library, such as one that checks itself."""

FLOAT, INT, BOOL = np.dtype(np.float64), np.dtype(np.int64), np.dtype(np.bool_)
POINTER, COUNT, NUMBER = ctypes.c_void_p, ctypes.c_int64, ctypes.c_double
TOO_SMALL = 2

_FILES = {"win32": "nicmm_kernels.dll", "darwin": "libnicmm_kernels.dylib"}
_ERRORS = {
    1: "an index is out of range",
    TOO_SMALL: "an array is too small",
    3: "a value is NaN or infinite",
    4: "a matrix is not positive definite",
    5: "a cost is negative",
}


class KernelError(RuntimeError):
    """A kernel was given data that it cannot use."""


class MissingLibraryError(KernelError, ImportError):
    """The compiled kernels are not installed for this platform, or those of another version are."""


@cache
def _library() -> ctypes.CDLL:
    given = os.environ.get(LIBRARY_VARIABLE)
    file = _FILES.get(sys.platform, "libnicmm_kernels.so")
    path = Path(given) if given else Path(__file__).resolve().with_name(file)
    try:
        return ctypes.CDLL(str(path))
    except OSError as error:
        raise MissingLibraryError(
            f"The compiled kernels of NICMM Curves for {platform.system()} on "
            f"{platform.machine()} cannot be loaded from {path} ({error}). Install the package "
            "for this platform; in a copy of the sources, run: python3 build.py test --quick"
        ) from error


class Kernel:
    """A function of the library, which is loaded at the first call.

    Parameters
    ----------
    name : str
    arguments : ctypes types
        Types of the arguments; a structure stands for a pointer to it.
    """

    def __init__(self, name: str, *arguments: Any) -> None:
        self._name, self._arguments = name, arguments

    @cached_property
    def result(self) -> Any:
        """The function itself, which returns an error code or a number."""
        function = getattr(_library(), self._name, None)
        if function is None:
            raise MissingLibraryError(
                f"The compiled kernels of NICMM Curves have no {self._name}: they are those of "
                "another version. Install the package again; in a copy of the sources, run: "
                "python3 build.py test --quick"
            )
        function.restype = COUNT if self._name.endswith("_items") else ctypes.c_int
        function.argtypes = [
            ctypes.POINTER(kind) if issubclass(kind, ctypes.Structure) else kind
            for kind in self._arguments
        ]
        return function

    def __call__(self, *given: Any) -> None:
        """Call the function; raises KernelError if it returns an error code."""
        self.check(self.result(*given))

    def check(self, code: int) -> None:
        """Raise KernelError unless a code tells that all is well."""
        if code:
            raise KernelError(f"{self._name}: {_ERRORS.get(code, f'unknown error {code}')}")


@cache
def has_wide_vectors() -> bool:
    """Whether the processor has vectors of 256 bits."""
    return bool(_library().has_wide_vectors())


def in_several_calls(
    kernel: Kernel,
    count: int,
    before: tuple[Any, ...],
    scratch: FloatArray,
    meanwhile: Callable[[], object],
    after: tuple[Any, ...] = (),
) -> None:
    """Call a kernel that finishes items in turn until it has finished `count` of them.

    Parameters
    ----------
    kernel : Kernel
        Takes scratch and its size, `MOST_WORK` and the number of finished items, after some and
        before other arguments.
    count : int
    before, after : tuples
        These other arguments.
    scratch : (q,) float array
    meanwhile : callable
        Called between two calls.
    """
    done = COUNT(0)
    while done.value < count:
        if done.value:
            meanwhile()
        kernel(*before, scratch.ctypes.data, len(scratch), MOST_WORK, done, *after)


def address(name: str, array: Any, dtype: np.dtype[Any], *shape: int) -> int:
    """The address of an array, which has to have this type and shape and to be contiguous."""
    if not isinstance(array, np.ndarray):
        raise KernelError(f"{name} is {type(array).__name__}; pass an array")
    if array.dtype != dtype:
        raise KernelError(f"{name} has type {array.dtype}; pass {dtype}")
    if array.shape != shape:
        raise KernelError(f"{name} has shape {array.shape}; pass {shape}")
    if not array.flags.c_contiguous:
        raise KernelError(f"{name} has strides {array.strides}; pass a contiguous array")
    return array.ctypes.data


def optional_address(name: str, array: Any, dtype: np.dtype[Any], *shape: int) -> int | None:
    """The same, or None instead of an array."""
    return None if array is None else address(name, array, dtype, *shape)


def rows(name: str, array: Any) -> int:
    """Length of the first axis of an array, from which other shapes follow."""
    if not isinstance(array, np.ndarray) or array.ndim == 0:
        raise KernelError(f"{name} is {type(array).__name__}; pass an array")
    return len(array)


def rows_of_curves(name: str, array: Any) -> tuple[int, int]:
    """Number of curves and of nodes of each, from an array with a row for each curve."""
    c = rows(name, array)
    if array.ndim != 2 or array.shape[1] == 0:
        raise KernelError(f"{name} has shape {array.shape}; pass one row per curve")
    return c, array.shape[1]


def first_fixed(fixed: BoolArray, c: int, n: int) -> int:
    """The address of the marks of fixed nodes, (c, n), which include the first of each curve."""
    place = address("fixed", fixed, BOOL, c, n)
    if not fixed[:, 0].all():
        raise KernelError("fixed is False at the first node of a curve; it must not move")
    return place
