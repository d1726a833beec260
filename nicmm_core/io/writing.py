"""Encodes meshes as files. Coordinates keep all digits, except in STL, which has single precision.

Each function returns the content of a file, given vertices, (V, 3), and triangles, (F, 3).
"""

from __future__ import annotations

import numpy as np

from ..geometry.array_types import FloatArray, IntArray
from .stl import HEADER_BYTES, TRIANGLE


def obj_bytes(vertices: FloatArray, faces: IntArray) -> bytes:
    """Encode a mesh as Wavefront OBJ."""
    lines = [f"v {x!r} {y!r} {z!r}" for x, y, z in vertices.tolist()]
    lines += [f"f {a} {b} {c}" for a, b, c in (faces + 1).tolist()]
    return _text(lines)


def off_bytes(vertices: FloatArray, faces: IntArray) -> bytes:
    """Encode a mesh in the Object File Format (OFF)."""
    lines = ["OFF", f"{len(vertices)} {len(faces)} 0"]
    lines += [f"{x!r} {y!r} {z!r}" for x, y, z in vertices.tolist()]
    lines += [f"3 {a} {b} {c}" for a, b, c in faces.tolist()]
    return _text(lines)


def ply_bytes(vertices: FloatArray, faces: IntArray) -> bytes:
    """Encode a mesh as binary PLY."""
    header = ["ply", "format binary_little_endian 1.0", f"element vertex {len(vertices)}"]
    header += [f"property double {axis}" for axis in "xyz"]
    header += [f"element face {len(faces)}", "property list uchar int vertex_indices"]
    row = np.dtype([("count", "u1"), ("corners", "<i4", 3)])
    rows = np.empty(len(faces), dtype=row)
    rows["count"], rows["corners"] = 3, faces
    return _text([*header, "end_header"]) + vertices.astype("<f8").tobytes() + rows.tobytes()


def stl_bytes(vertices: FloatArray, faces: IntArray) -> bytes:
    """Encode a mesh as binary STL, with zero normals, since readers compute them."""
    rows = np.zeros(len(faces), dtype=TRIANGLE)
    rows["corners"] = vertices[faces]
    return len(faces).to_bytes(4, "little").rjust(HEADER_BYTES, b" ") + rows.tobytes()


def _text(lines: list[str]) -> bytes:
    return ("\n".join(lines) + "\n").encode("ascii")
