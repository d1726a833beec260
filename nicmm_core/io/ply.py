"""Reads PLY files: text and binary, properties of any type, faces or triangle strips."""

from __future__ import annotations

import contextlib
import io
import re
import warnings
from pathlib import Path

import numpy as np
from plyfile import PlyData, PlyElement, PlyParseError

from ..geometry.array_types import IntArray
from .numbers import integer
from .polygons import FormatError, Polygons

_CORNERS = ("vertex_indices", "vertex_index")

_COUNT = re.compile(rb"^element\s+\S+\s+(\S+)", re.MULTILINE)


def read_ply(path: Path) -> Polygons:
    """Read the element "vertex" and "face" or "tristrips"; other elements are ignored.

    Raises
    ------
    FormatError
        If the header cannot be parsed, the body is too short for it, or vertices or faces are
        missing or invalid.
    """
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", UserWarning)  # about empty lists in text files
            warnings.simplefilter("ignore", DeprecationWarning)  # about fractions as indices
            elements = _elements(path)
        vertices = np.stack([elements["vertex"][axis] for axis in "xyz"], axis=1)
        strips = "tristrips" in elements
        corners, sizes = _corners(elements["tristrips" if strips else "face"])
        vertices = vertices.astype(np.float64)
    except KeyError as error:
        raise FormatError(f"it has no {error.args[0]}") from error
    except (PlyParseError, TypeError, ValueError, OverflowError) as error:
        raise FormatError(f"{error}; it may be truncated"[:300]) from error
    return Polygons(vertices, *(_unrolled(corners, sizes) if strips else (corners, sizes)))


def _elements(path: Path) -> PlyData:
    """The elements of a file, by their names."""
    data = path.read_bytes()
    end = max(data.find(b"end_header"), 0)
    for count in _COUNT.findall(data, 0, end):
        # The parser would reserve memory for any number of rows; each has at least one byte.
        if not 0 <= integer(count) <= len(data):
            raise FormatError("its header declares more rows than the file has room for")
    if not data[:end].isascii():  # as in a comment, but the parser takes nothing else
        header = data[:end].decode("ascii", "replace").replace("\ufffd", "?").encode("ascii")
        return PlyData.read(io.BytesIO(header + data[end:]))
    for corners in (3, 4):  # faces of one size are read at once
        lengths = dict.fromkeys(_CORNERS, corners)
        with contextlib.suppress(PlyParseError):
            return PlyData.read(path, known_list_len={"face": lengths})
    return PlyData.read(path)


def _corners(faces: PlyElement) -> tuple[IntArray, IntArray]:
    """Vertex indices of all faces, and the number of corners of each."""
    lists = faces[next((name for name in _CORNERS if name in faces), _CORNERS[0])]
    sizes = np.array([len(corners) for corners in lists], dtype=np.int64)
    values = np.concatenate([np.zeros(0), *lists])
    # Written so that NaN fails too. Larger numbers might overflow.
    if not ((np.abs(values) < 2.0**53) & (values == np.round(values))).all():
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
