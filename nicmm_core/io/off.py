"""Reads text files in the Object File Format (OFF).

Colours, normals and texture coordinates are ignored.
"""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np

from .numbers import floats, integer, quoted
from .polygons import FormatError, Polygons

_HEADER = re.compile(rb"(ST)?C?N?OFF")


def read_off(path: Path) -> Polygons:
    """Read a text file that has one vertex or face in each line.

    Raises
    ------
    FormatError
        If the header is not supported, or lines are missing or cannot be parsed.
    """
    rows = (line.partition(b"#")[0].split() for line in path.read_bytes().splitlines())
    lines = [words for words in rows if words]
    if not lines or not _HEADER.fullmatch(lines[0][0]):
        raise FormatError("it does not begin with OFF (binary and 4D OFF are not supported)")
    lines[0] = lines[0][1:]  # the counts may stand beside the name
    head, *rest = [words for words in lines if words] or [[]]
    if len(head) < 2:
        raise FormatError("it lacks the numbers of vertices and faces")
    n_vertices, n_faces = integer(head[0]), integer(head[1])
    if not 0 <= n_vertices + n_faces <= len(rest) or min(n_vertices, n_faces) < 0:
        raise FormatError(
            f"its header declares {n_vertices} vertices and {n_faces} faces, but it has "
            f"{len(rest)} lines for them; it may be truncated"
        )
    positions: list[bytes] = []
    for place, words in enumerate(rest[:n_vertices]):
        if len(words) < 3:
            raise FormatError(f"vertex {place} has {len(words)} coordinates")
        positions += words[:3]
    corners: list[int] = []
    sizes: list[int] = []
    for place, words in enumerate(rest[n_vertices : n_vertices + n_faces]):
        size = integer(words[0])
        if not 0 <= size < len(words):
            raise FormatError(
                f"face {place} declares {quoted(words[0])} corners, but its line has "
                f"{len(words) - 1}"
            )
        corners += map(integer, words[1 : size + 1])
        sizes.append(size)
    return Polygons(
        floats(positions).reshape(-1, 3),
        np.array(corners, dtype=np.int64),
        np.array(sizes, dtype=np.int64),
    )
