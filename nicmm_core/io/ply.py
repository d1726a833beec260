"""Polygon File Format: text and binary, properties of any type, faces or triangle strips."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np

from ..geometry.array_types import FloatArray, IntArray
from .numbers import floats, shown, whole
from .polygons import FormatError, Polygons

TYPES = {
    **dict.fromkeys(("char", "int8"), "i1"),
    **dict.fromkeys(("uchar", "uint8"), "u1"),
    **dict.fromkeys(("short", "int16"), "i2"),
    **dict.fromkeys(("ushort", "uint16"), "u2"),
    **dict.fromkeys(("int", "int32"), "i4"),
    **dict.fromkeys(("uint", "uint32"), "u4"),
    **dict.fromkeys(("float", "float32"), "f4"),
    **dict.fromkeys(("double", "float64"), "f8"),
}

_FORMATS = {"ascii": "", "binary_little_endian": "<", "binary_big_endian": ">"}

_CORNERS = ("vertex_indices", "vertex_index")


@dataclass(frozen=True)
class _Property:
    """One column of an element; ``count_type`` where it holds a list."""

    name: str
    type: str
    count_type: str | None = None


@dataclass
class _Element:
    name: str
    count: int
    properties: list[_Property] = field(default_factory=list)


Columns = dict[str, tuple[FloatArray, IntArray]]
"""For each property, all values, row by row, and the number of values in each row."""


def read_ply(data: bytes) -> Polygons:
    """Read the elements "vertex" and "face" or "tristrips"; others are ignored.

    Raises
    ------
    FormatError
        If the header cannot be parsed, or the body is too short for it.
    """
    byte_order, elements, start = _header(data)
    read = _text_reader(data[start:]) if byte_order == "" else _binary_reader(data, start)
    found: dict[str, Columns] = {}
    for element in elements:
        found[element.name] = read(element, byte_order)
        if "vertex" in found and ("face" in found or "tristrips" in found):
            break
    if "vertex" not in found or not ("face" in found or "tristrips" in found):
        raise FormatError("it has no vertices or no faces")
    vertices = np.stack([_coordinate(found["vertex"], axis) for axis in "xyz"], axis=1)
    if "tristrips" in found:
        corners, sizes = _unrolled(*_corners(found["tristrips"]))
    else:
        corners, sizes = _corners(found["face"])
    return Polygons(vertices, corners, sizes)


def _header(data: bytes) -> tuple[str, list[_Element], int]:
    """Byte order ("" for text), elements, and offset of the body."""
    end = data.find(b"end_header")
    newline = data.find(b"\n", end)
    if not data.startswith(b"ply") or end < 0 or newline < 0:
        raise FormatError("it has no PLY header that ends in end_header")
    byte_order: str | None = None
    elements: list[_Element] = []
    for line in data[:end].splitlines()[1:]:
        words = line.decode("latin-1").split()
        try:
            match words:
                case ["format", name, *_]:
                    byte_order = _FORMATS[name]
                case ["element", name, count]:
                    elements.append(_Element(name, whole(count.encode("latin-1"))))
                case ["property", "list", count_type, kind, name]:
                    column = _Property(name, TYPES[kind], TYPES[count_type])
                    elements[-1].properties.append(column)
                case ["property", kind, name]:
                    elements[-1].properties.append(_Property(name, TYPES[kind]))
                case [] | ["comment" | "obj_info", *_]:
                    pass
                case _:
                    raise KeyError(line)
        except (KeyError, IndexError) as error:
            raise FormatError(f"its header has an invalid line {shown(line)}") from error
    if byte_order is None:
        raise FormatError("its header does not give the format")
    for element in elements:
        names = [column.name for column in element.properties]
        if not names or len(set(names)) < len(names) or element.count < 0:
            raise FormatError(f"its header has an invalid element {element.name!r}")
    return byte_order, elements, newline + 1


def _binary_reader(data: bytes, start: int) -> Callable[[_Element, str], Columns]:
    """A function that reads the next element at each call."""
    position = start

    def read(element: _Element, byte_order: str) -> Columns:
        nonlocal position
        sizes = _row_sizes(data, position, element, byte_order)
        rows = np.zeros(0, dtype=_row_type(element, byte_order, sizes))
        room = (len(data) - position) // rows.dtype.itemsize
        if element.count <= room:
            rows = np.frombuffer(data, rows.dtype, count=element.count, offset=position)
        if element.count <= room and _are_alike(rows, sizes):
            position += rows.nbytes
            return _columns(element, rows, sizes)
        columns, position = _uneven(data, position, element, byte_order)
        return columns

    return read


def _row_sizes(data: bytes, position: int, element: _Element, byte_order: str) -> dict[str, int]:
    """Length of each list in the first row; 0 if there is no row."""
    sizes: dict[str, int] = {}
    for column in element.properties:
        if column.count_type is not None:
            count, position = _count_at(data, position, column, byte_order) or (0, len(data))
            sizes[column.name] = count
            position += count * np.dtype(column.type).itemsize
        else:
            position += np.dtype(column.type).itemsize
    return sizes


def _count_at(
    data: bytes, position: int, column: _Property, byte_order: str
) -> tuple[int, int] | None:
    """Length of the list at a position, and offset of its values; None if it does not fit."""
    count_type = np.dtype(byte_order + str(column.count_type))
    begin = position + count_type.itemsize
    if begin > len(data):
        return None
    count = np.frombuffer(data, count_type, count=1, offset=position)[0]
    if not 0 <= count <= (len(data) - begin) // np.dtype(column.type).itemsize:
        return None
    return int(count), begin


def _row_type(element: _Element, byte_order: str, sizes: dict[str, int]) -> np.dtype:
    """The type of a row whose lists have the given lengths."""
    fields: list[tuple] = []
    for place, column in enumerate(element.properties):
        if column.count_type is not None:
            fields.append((f"count {place}", byte_order + column.count_type))
            fields.append((f"value {place}", byte_order + column.type, (sizes[column.name],)))
        else:
            fields.append((f"value {place}", byte_order + column.type))
    return np.dtype(fields)


def _are_alike(rows: np.ndarray, sizes: dict[str, int]) -> bool:
    """Whether the lists have the same lengths in all rows as in the first one."""
    counts = [rows[name] for name in rows.dtype.names or () if name.startswith("count")]
    return all(bool((c == s).all()) for c, s in zip(counts, sizes.values(), strict=True))


def _columns(element: _Element, rows: np.ndarray, sizes: dict[str, int]) -> Columns:
    return {
        column.name: (
            rows[f"value {place}"].astype(np.float64).reshape(-1),
            np.full(len(rows), sizes.get(column.name, 1)),
        )
        for place, column in enumerate(element.properties)
    }


def _uneven(data: bytes, position: int, element: _Element, byte_order: str) -> tuple[Columns, int]:
    """Read rows with lists of different lengths one by one."""
    values: dict[str, list[np.ndarray]] = {column.name: [] for column in element.properties}
    sizes: dict[str, list[int]] = {column.name: [] for column in element.properties}
    for row in range(element.count):
        for column in element.properties:
            kind = np.dtype(byte_order + column.type)
            count, begin = 1, position
            if column.count_type is not None:
                count, begin = _count_at(data, position, column, byte_order) or (-1, position)
            position = begin + count * kind.itemsize
            if count < 0 or position > len(data):
                raise FormatError(
                    f"{element.name} {row} of {element.count} is beyond the end of the file, "
                    "which may be truncated"
                )
            values[column.name].append(np.frombuffer(data, kind, count, begin))
            sizes[column.name].append(count)
    return {
        name: (
            np.concatenate([np.zeros(0), *values[name]]),
            np.array(sizes[name], dtype=np.int64),
        )
        for name in values
    }, position


def _text_reader(body: bytes) -> Callable[[_Element, str], Columns]:
    """A function that reads the next element at each call."""
    tokens = body.split()
    position = 0

    def taken(count: int, element: _Element) -> list[bytes]:
        nonlocal position
        if not 0 <= count <= len(tokens) - position:
            raise FormatError(f"the element {element.name!r} ends early; the file may be truncated")
        position += count
        return tokens[position - count : position]

    def read(element: _Element, _: str) -> Columns:
        n_columns = len(element.properties)
        if all(column.count_type is None for column in element.properties):
            table = floats(taken(element.count * n_columns, element)).reshape(-1, n_columns)
            ones = np.ones(element.count, dtype=np.int64)
            return {
                column.name: (table[:, place], ones)
                for place, column in enumerate(element.properties)
            }
        values: dict[str, list[bytes]] = {column.name: [] for column in element.properties}
        sizes: dict[str, list[int]] = {column.name: [] for column in element.properties}
        for _row in range(element.count):
            for column in element.properties:
                count = 1
                if column.count_type is not None:
                    count = whole(taken(1, element)[0])
                values[column.name] += taken(count, element)
                sizes[column.name].append(count)
        return {
            name: (floats(values[name]), np.array(sizes[name], dtype=np.int64)) for name in values
        }

    return read


def _coordinate(columns: Columns, axis: str) -> FloatArray:
    values, sizes = columns.get(axis, (np.zeros(0), np.full(1, -1)))
    if (sizes != 1).any():
        raise FormatError(f"its vertices have no coordinate {axis}")
    return values


def _corners(columns: Columns) -> tuple[IntArray, IntArray]:
    """Vertex indices of all faces, and the number of corners of each."""
    name = next((name for name in _CORNERS if name in columns), None)
    if name is None:
        raise FormatError("its faces have no list of vertex_indices")
    values, sizes = columns[name]
    # NaN compares false; larger numbers are not indices and would not fit.
    if not (np.abs(values) < 2.0**53).all():
        raise FormatError("its faces have corners that are not indices")
    if (values != np.round(values)).any():
        raise FormatError("its faces have corners that are not whole numbers")
    return values.astype(np.int64), sizes


def _unrolled(corners: IntArray, sizes: IntArray) -> tuple[IntArray, IntArray]:
    """Triangles of strips; a corner -1 ends a strip inside a list."""
    n_corners = len(corners)
    begins = np.zeros(n_corners, dtype=bool)
    begins[(np.cumsum(sizes) - sizes)[sizes > 0]] = True
    begins[1:] |= corners[:-1] == -1
    strip = np.cumsum(begins)
    first = np.maximum.accumulate(np.where(begins, np.arange(n_corners), 0))
    three = np.stack([corners[:-2], corners[1:-1], corners[2:]], axis=1)
    # Every second triangle of a strip has the opposite orientation.
    odd = (np.arange(len(three)) - first[: len(three)]) % 2 == 1
    three[odd] = three[odd][:, [1, 0, 2]]
    triangles = three[(three != -1).all(axis=1) & (strip[: len(three)] == strip[2:])]
    return triangles.reshape(-1), np.full(len(triangles), 3)
