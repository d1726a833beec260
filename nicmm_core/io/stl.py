"""Reads STL files, binary and text.

Triangles in STL do not share vertices, so corners with equal positions become one vertex.
"""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np

from ..geometry.array_types import FloatArray
from ..geometry.grouping import distinct_rows
from .numbers import floats
from .polygons import FormatError, Polygons

HEADER_BYTES = 84
"""Size of the header of a binary file: 80 arbitrary bytes, then the number of triangles."""

TRIANGLE = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attribute", "<u2")])
"""Layout of a triangle in a binary file."""

_VERTEX = re.compile(rb"\bvertex\s+(\S+)\s+(\S+)\s+(\S+)", re.IGNORECASE)
_FACET = re.compile(rb"\bendfacet\b", re.IGNORECASE)


def read_stl(path: Path) -> Polygons:
    """Read a binary or text file. A binary file, too, may begin with "solid".

    Raises
    ------
    FormatError
        If the file is truncated, or cannot be parsed as binary or as text.
    """
    data = path.read_bytes()
    count = int.from_bytes(data[HEADER_BYTES - 4 : HEADER_BYTES], "little")
    room = max(len(data) - HEADER_BYTES, 0) // TRIANGLE.itemsize
    whole_file = HEADER_BYTES + TRIANGLE.itemsize * count == len(data)
    if not whole_file and data.lstrip()[:5].lower() == b"solid":
        vertices = _text_corners(data)
    elif len(data) < HEADER_BYTES or count > room:
        raise FormatError(
            f"its header declares {count} triangles, but the file has room for only {room}; it may "
            "be truncated"
        )
    else:
        triangles = np.frombuffer(data, TRIANGLE, count=count, offset=HEADER_BYTES)
        vertices = triangles["corners"].astype(np.float64).reshape(-1, 3)
    vertices = vertices + 0.0  # -0.0 and 0.0 are one position
    first, corners = distinct_rows(vertices)
    return Polygons(vertices[first], corners, np.full(len(vertices) // 3, 3))


def _text_corners(data: bytes) -> FloatArray:
    tokens = [token for corner in _VERTEX.findall(data) for token in corner]
    facets = len(_FACET.findall(data))
    if len(tokens) != 9 * facets:
        raise FormatError(
            f"it has {facets} complete facets and {len(tokens) // 3} corners, which is not three "
            "per facet; it may be truncated"
        )
    return floats(tokens).reshape(-1, 3)
