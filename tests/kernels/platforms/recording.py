# SPDX-License-Identifier: GPL-3.0-or-later
"""Records calls of kernels in files, from which `replay.c` repeats them without Python."""

from __future__ import annotations

import ctypes
import struct
import sys
import weakref
from collections import Counter
from collections.abc import Callable, Iterable, Iterator
from itertools import chain
from pathlib import Path
from typing import Any, NamedTuple
from unittest import mock

import numpy as np
from nicmm_kernels import threads
from nicmm_kernels.library import COUNT, NUMBER, POINTER, Kernel
from numpy.core import _internal as numpy_internal

PACKAGE = "nicmm_kernels."

DATA = (ctypes.Structure, ctypes.Array, ctypes._SimpleCData)
"""What a kernel is given by a pointer, besides arrays of NumPy."""

NOWHERE = -1
"""Index of no memory, for a null pointer."""


class Recording:
    """Recorded calls of kernels, and what they return and change.

    Attributes
    ----------
    kernels : dict
        For each recorded kernel, in the order of first calls, the types of its result and of its
        arguments.
    called : list of str
        Name of the kernel of each call.
    results : list of bytes
        What each call returned and changed, as `replay.c` writes it.
    """

    def __init__(self) -> None:
        self.kernels: dict[str, tuple[Any, list[Any]]] = {}
        self.called: list[str] = []
        self.results: list[bytes] = []
        self._blocks: dict[bytes, int] = {}
        self._calls: list[bytes] = []

    @property
    def unused(self) -> list[str]:
        """Names of the kernels of which there is no call."""
        modules = [module for name, module in sys.modules.items() if name.startswith(PACKAGE)]
        members = [vars(module).values() for module in modules]
        every = {one._name for found in members for one in found if isinstance(one, Kernel)}
        return sorted(every - set(self.kernels))

    def add(self, name: str, function: Any, memory: Memory) -> int:
        """Call a kernel and record the call; returns what the kernel returns."""
        before = memory.contents()
        returned: int = function(*memory.given)
        changed = [
            _integers(i) + after for i, after in enumerate(memory.contents()) if after != before[i]
        ]
        blocks = [self._blocks.setdefault(block, len(self._blocks)) for block in before]
        self.kernels.setdefault(name, (function.restype, function.argtypes))
        self._calls.append(
            _integers(list(self.kernels).index(name), len(blocks), *blocks)
            + _integers(len(memory.pointers), *chain.from_iterable(memory.pointers))
        )
        self.called.append(name)
        self.results.append(_integers(returned) + b"".join(changed))
        return returned

    def write(self, path: Path) -> None:
        """Write the file that `replay.c` reads."""
        with path.open("wb") as file:
            file.write(_integers(len(self._blocks)))
            for block in self._blocks:
                stored = block.rstrip(b"\0")
                file.write(_integers(len(block), len(stored)) + stored)
            file.write(_integers(len(self._calls)) + b"".join(self._calls))

    def write_declarations(self, path: Path) -> None:
        """Write the types of the kernels for `replay.c`."""
        in_c = {ctypes.c_int: "int", COUNT: "int64_t", NUMBER: "double"}
        members = {COUNT: "integer", NUMBER: "number"}
        lines = []
        for name, (result, kinds) in self.kernels.items():
            types = ", ".join(in_c.get(kind, "void *") for kind in kinds)
            arguments = ", ".join(
                f"given[{i}].{members.get(kind, 'address')}" for i, kind in enumerate(kinds)
            )
            lines.append(f"KERNEL({in_c[result]}, {name}, ({types}), ({arguments}))\n")
        path.write_text("".join(lines), encoding="ascii")

    def first_difference(self, results: bytes) -> str | None:
        """The first call whose results differ from the recorded ones, in words."""
        start = 0
        for i, (name, expected) in enumerate(zip(self.called, self.results, strict=True)):
            if results[start : start + len(expected)] != expected:
                return f"call {i + 1} of {len(self.called)}, of {name}, differs"
            start += len(expected)
        return None if start == len(results) else "there are more results than recorded"


class Pointer(NamedTuple):
    """A pointer in the memory of a call.

    Attributes
    ----------
    holder, offset : int
        Index of the memory that contains the pointer, and its offset there.
    target, inside : int
        Index of the memory to which it points, or `NOWHERE`, and how far inside.
    """

    holder: int
    offset: int
    target: int
    inside: int


class Memory:
    """The memory that a call reads and writes: its arguments, and what they point to.

    Arguments and what structures consist of are pointers, integers and floats of 8 bytes; pointers
    point to structures, numbers or arrays of NumPy.

    Parameters
    ----------
    kinds : ctypes types
        Types of the arguments.
    given : tuple
        The arguments.
    arrays : list of (int, int)
        Addresses of the arrays to which they may point: the first, and that after the last.

    Attributes
    ----------
    pointers : list of Pointer
        Index 0 is that of the arguments, which are a structure themselves.
    """

    def __init__(
        self, kinds: list[Any], given: tuple[Any, ...], arrays: list[tuple[int, int]]
    ) -> None:
        self.given, self._arrays = given, arrays
        self.pointers: list[Pointer] = []
        self._places: list[tuple[int, int]] = []  # address and size
        self._indices: dict[int, int] = {}
        self._objects = {ctypes.addressof(one): one for one in given if isinstance(one, DATA)}
        fields = [
            (f"argument_{i}", kind if kind in (COUNT, NUMBER) else POINTER)
            for i, kind in enumerate(kinds)
        ]
        words = [ctypes.addressof(one) if isinstance(one, DATA) else one for one in given]
        structure: Any = type("Arguments", (ctypes.Structure,), {"_fields_": fields})
        arguments = structure(*words)
        self._objects[ctypes.addressof(arguments)] = arguments
        self._add(ctypes.addressof(arguments))

    def contents(self) -> list[bytes]:
        """The present bytes of each memory, with zeros in place of addresses."""
        contents = [bytearray(ctypes.string_at(*place)) for place in self._places]
        for pointer in self.pointers:
            contents[pointer.holder][pointer.offset : pointer.offset + 8] = bytes(8)
        return [bytes(content) for content in contents]

    def _add(self, address: int) -> tuple[int, int]:
        """Index of the memory that contains an address, and how far inside the address is."""
        found = self._objects.get(address)
        start, size = self._array_at(address) if found is None else (address, ctypes.sizeof(found))
        if start not in self._indices:
            index = self._indices[start] = len(self._places)
            self._places.append((start, size))
            for offset in () if found is None else _pointer_offsets(type(found)):
                target = POINTER.from_address(address + offset).value
                there = (NOWHERE, 0) if target is None else self._add(target)
                self.pointers.append(Pointer(index, offset, *there))
        return self._indices[start], address - start

    def _array_at(self, address: int) -> tuple[int, int]:
        """Address and size of the largest array that contains an address."""
        found = [
            (end - start, start)
            for start, end in self._arrays
            if 0 <= address - start < max(end - start, 1)
        ]
        if not found:
            raise LookupError("a kernel is given an address that is in no array of NumPy")
        size, start = max(found)
        return start, size


def _pointer_offsets(kind: Any, start: int = 0) -> Iterator[int]:
    """Offsets of the pointers in an argument, of which every part takes 8 bytes."""
    if issubclass(kind, ctypes.Structure):
        for name, field in kind._fields_:
            yield from _pointer_offsets(field, start + getattr(kind, name).offset)
    elif issubclass(kind, ctypes.Array):
        for i in range(kind._length_):
            yield from _pointer_offsets(kind._type_, start + i * ctypes.sizeof(kind._type_))
    elif kind is POINTER:
        yield start
    elif kind not in (COUNT, NUMBER):
        raise TypeError(f"{kind.__name__} is of a kind that is not recorded")


def _bounds(owner: np.ndarray) -> tuple[int, int]:
    """First address of an array that owns its memory, and the address behind its last byte."""
    start = owner.__array_interface__["data"][0]
    return start, start + owner.nbytes


def _integers(*values: int) -> bytes:
    return struct.pack(f"<{len(values)}q", *values)


def record(designs: Iterable[Callable[[], object]]) -> Recording:
    """Compute designs, and record their calls of kernels.

    Of each design and kernel, these are the calls whose number is a power of two. Arrays of NumPy
    start as zeros, so that recordings are small and always the same. One thread makes all calls, so
    that nothing else changes the memory of a call.
    """
    recording, numbers = Recording(), Counter[str]()
    owners: weakref.WeakValueDictionary[int, Any] = weakref.WeakValueDictionary()
    address_of, function_of = numpy_internal._ctypes, vars(Kernel)["result"]

    def noted(array: Any, address: int) -> Any:
        owner = array
        while isinstance(owner.base, np.ndarray):
            owner = owner.base
        owners[id(owner)] = owner
        return address_of(array, address)

    def recorded(kernel: Kernel) -> Callable[..., int]:
        function = function_of.__get__(kernel, Kernel)

        def call(*given: Any) -> int:
            numbers[kernel._name] += 1
            number = numbers[kernel._name]
            if number & (number - 1):
                return function(*given)
            arrays = [_bounds(owner) for owner in owners.values()]
            memory = Memory(function.argtypes, given, arrays)
            return recording.add(kernel._name, function, memory)

        return call

    with (
        # NumPy calls this for `array.ctypes`, from which kernels get all addresses.
        mock.patch.object(numpy_internal, "_ctypes", noted),
        mock.patch.object(Kernel, "result", property(recorded)),
        mock.patch.object(np, "empty", np.zeros),
        mock.patch.object(threads, "thread_count", lambda: 1),
    ):
        for design in designs:
            numbers.clear()
            design()
    return recording
