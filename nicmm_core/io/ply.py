"""Reads PLY files: text and binary, properties of any type, faces or triangle strips."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from ..geometry.array_types import FloatArray, IntArray
from .numbers import floats, integer, quoted
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
    """A property of an element; ``count_type`` is the type of list lengths, None for one value."""

    name: str
    type: str
    count_type: str | None = None


@dataclass
class _Element:
    name: str
    count: int
    properties: list[_Property] = field(default_factory=list)


Fields = list[tuple[str, int]]
"""Type and number of values of each field of a row."""

Columns = dict[str, tuple[FloatArray, IntArray]]
"""For each property, all its values, row by row, and the number of values in each row."""


def read_ply(data: bytes) -> Polygons:
    """Read the element "vertex" and "face" or "tristrips"; other elements are ignored.

    Raises
    ------
    FormatError
        If the header cannot be parsed, the body is too short for it, or vertices or faces are
        missing or invalid.
    """
    byte_order, elements, start = _header(data)
    body = _Binary(data, start, byte_order) if byte_order else _Text(data[start:])
    found: dict[str, Columns] = {}
    for element in elements:
        found[element.name] = _read(element, body)
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
                    elements.append(_Element(name, integer(count.encode("latin-1"))))
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
            raise FormatError(f"its header has an invalid line {quoted(line)}") from error
    if byte_order is None:
        raise FormatError("its header does not give the format")
    for element in elements:
        names = [column.name for column in element.properties]
        if not names or len(set(names)) < len(names) or element.count < 0:
            raise FormatError(f"its header has an invalid element {element.name!r}")
    return byte_order, elements, newline + 1


class _Text:
    """The body of a text file, read from ``position``, an index of tokens, onwards."""

    def __init__(self, body: bytes) -> None:
        self._tokens, self.position = body.split(), 0

    def room(self, fields: Fields) -> int:
        """Number of rows with the given fields for which the rest of the body has room."""
        return (len(self._tokens) - self.position) // max(sum(size for _, size in fields), 1)

    def rows(self, fields: Fields, count: int) -> list[FloatArray]:
        """Read the next ``count`` rows: for each field, an array (count, size)."""
        sizes = [size for _, size in fields]
        begin, self.position = self.position, self.position + count * sum(sizes)
        table = floats(self._tokens[begin : self.position]).reshape(count, sum(sizes))
        return np.split(table, np.cumsum(sizes)[:-1], axis=1)


class _Binary:
    """The body of a binary file, read from ``position``, an index of bytes, onwards."""

    def __init__(self, data: bytes, position: int, byte_order: str) -> None:
        self._data, self.position, self._byte_order = data, position, byte_order

    def room(self, fields: Fields) -> int:
        """Number of rows with the given fields for which the rest of the body has room."""
        return (len(self._data) - self.position) // max(self._row(fields).itemsize, 1)

    def rows(self, fields: Fields, count: int) -> list[FloatArray]:
        """Read the next ``count`` rows: for each field, an array (count, size)."""
        row = self._row(fields)
        found = np.frombuffer(self._data, row, count, self.position)
        self.position += found.nbytes
        return [found[name].astype(np.float64) for name in row.names or ()]

    def _row(self, fields: Fields) -> np.dtype:
        names = enumerate(fields)
        return np.dtype([(str(n), self._byte_order + kind, (size,)) for n, (kind, size) in names])


def _read(element: _Element, body: _Text | _Binary) -> Columns:
    """Read an element, as one table if its lists have the same lengths in all rows."""
    begin = body.position
    first = _row_by_row(element, min(element.count, 1), body)
    body.position = begin
    fields: Fields = []
    for column in element.properties:
        counts = [] if column.count_type is None else [(column.count_type, 1)]
        fields += [*counts, (column.type, int(first[column.name][1].sum()))]
    if element.count <= body.room(fields):
        blocks = iter(body.rows(fields, element.count))
        columns, alike = {}, True
        for column in element.properties:
            sizes = np.ones(element.count) if column.count_type is None else next(blocks).ravel()
            values = next(blocks)
            alike &= bool((sizes == values.shape[1]).all())
            columns[column.name] = values.ravel(), sizes.astype(np.int64)
        if alike:
            return columns
        body.position = begin
    return _row_by_row(element, element.count, body)


def _row_by_row(element: _Element, n_rows: int, body: _Text | _Binary) -> Columns:
    """Read rows with lists of any lengths."""
    values: dict[str, list[FloatArray]] = {column.name: [] for column in element.properties}
    sizes: dict[str, list[int]] = {column.name: [] for column in element.properties}

    def taken(kind: str, count: float) -> FloatArray:
        if not (0 <= count <= body.room([(kind, 1)]) and count % 1 == 0):
            raise FormatError(
                f"the element {element.name!r} of {element.count} rows ends early, in row "
                f"{len(sizes[element.properties[0].name])}; the file may be truncated"
            )
        return body.rows([(kind, int(count))], 1)[0].ravel()

    for _ in range(n_rows):
        for column in element.properties:
            count = 1.0 if column.count_type is None else float(taken(column.count_type, 1)[0])
            values[column.name].append(taken(column.type, count))
            sizes[column.name].append(int(count))
    return {
        name: (np.concatenate([np.zeros(0), *values[name]]), np.array(sizes[name], dtype=np.int64))
        for name in values
    }


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
    # Written so that NaN fails too. Larger numbers are not indices, and might overflow.
    if not (np.abs(values) < 2.0**53).all():
        raise FormatError("its faces have corners that are not indices")
    if (values != np.round(values)).any():
        raise FormatError("its faces have corners that are not whole numbers")
    return values.astype(np.int64), sizes


def _unrolled(corners: IntArray, sizes: IntArray) -> tuple[IntArray, IntArray]:
    """Corners and sizes of the triangles of strips; a corner of -1 ends a strip within a list."""
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
