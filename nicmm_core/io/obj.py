"""Reads positions and faces from Wavefront OBJ files; everything else is ignored."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from .numbers import floats, integer, quoted
from .polygons import FormatError, Polygons


def read_obj(path: Path) -> Polygons:
    """Read the ``v`` and ``f`` lines.

    Raises
    ------
    FormatError
        If one of these lines cannot be parsed.
    """
    positions: list[bytes] = []
    corners: list[int] = []
    sizes: list[int] = []
    data = path.read_bytes().replace(b"\\\r\n", b" ").replace(b"\\\n", b" ")
    for number, line in enumerate(data.splitlines(), start=1):
        if line[:1] not in b"vf \t":
            continue
        words = line.partition(b"#")[0].split()
        if not words:
            continue
        if words[0] == b"v":
            if len(words) < 4:
                raise FormatError(
                    f"line {number} has a vertex with only {len(words) - 1} coordinates"
                )
            positions += words[1:4]
        elif words[0] == b"f":
            for word in words[1:]:
                index = integer(word.partition(b"/")[0])
                # Negative indices count back from the last vertex so far.
                corners.append(index - 1 if index > 0 else len(positions) // 3 + index)
                if index == 0 or corners[-1] < 0:
                    raise FormatError(
                        f"line {number} refers to vertex {quoted(word)} after "
                        f"{len(positions) // 3} vertices; indices start at 1 or count back from -1"
                    )
            sizes.append(len(words) - 1)
    return Polygons(
        floats(positions).reshape(-1, 3),
        np.array(corners, dtype=np.int64),
        np.array(sizes, dtype=np.int64),
    )
