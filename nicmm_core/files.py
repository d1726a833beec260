"""Reading meshes and writing curves."""

from __future__ import annotations

import csv
import json
import os
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import igl
import numpy as np

from .array_types import FloatArray, IntArray
from .curve import SurfaceCurve
from .errors import ArgumentError, MeshError
from .mesh import Mesh

MESH_FORMATS = (".obj", ".off", ".ply", ".stl")
CURVE_FORMATS = (".obj", ".json", ".csv")


def read_mesh(path: str | Path) -> Mesh:
    """Read a triangle mesh from OBJ, OFF, PLY or STL.

    The corners of an STL file, which stores every triangle for itself, are joined where their
    positions are equal.

    Raises
    ------
    MeshError
        If the file is missing, has another ending or holds no triangle mesh.
    """
    path = Path(path)
    if path.suffix.lower() not in MESH_FORMATS:
        raise MeshError(f"{path} is no mesh file known here; use {', '.join(MESH_FORMATS)}")
    if not path.is_file():
        raise MeshError(f"{path} does not exist; check the path of the mesh")
    try:
        with _silent_output():
            vertices, faces = igl.read_triangle_mesh(str(path))[:2]
    except (RuntimeError, ValueError) as error:
        raise MeshError(f"{path} cannot be read as a triangle mesh ({error})") from error
    if path.suffix.lower() == ".stl" and len(vertices):
        vertices, faces = _joined(np.asarray(vertices), np.asarray(faces))
    return Mesh(vertices, faces)


@contextmanager
def _silent_output() -> Iterator[None]:
    """Keep libigl's readers, which print what they do not like, from writing to the terminal."""
    sys.stdout.flush()
    saved = os.dup(1)
    try:
        with open(os.devnull, "wb") as nothing:
            os.dup2(nothing.fileno(), 1)
        yield
    finally:
        os.dup2(saved, 1)
        os.close(saved)


def write_mesh(path: str | Path, mesh: Mesh) -> None:
    """Write a mesh as OBJ, OFF, PLY or STL by the path's ending."""
    igl.write_triangle_mesh(str(path), mesh.vertices.copy(), mesh.faces.copy())


def write_curve(path: str | Path, curve: SurfaceCurve) -> None:
    """Write a curve by the path's ending.

    OBJ gets a polyline, JSON faces, barycentrics, points and control indices, CSV one row a point
    (face, three barycentrics, three coordinates).

    Raises
    ------
    ArgumentError
        If the ending is another one.
    """
    path = Path(path)
    writers = {".obj": _write_obj, ".json": _write_json, ".csv": _write_csv}
    check_curve_path(path)
    writers[path.suffix.lower()](path, curve)


def check_curve_path(path: str | Path) -> None:
    """Refuse an output path before any work is done for it."""
    path = Path(path)
    if path.suffix.lower() not in CURVE_FORMATS:
        raise ArgumentError(f"{path} has no known ending; write to {', '.join(CURVE_FORMATS)}")
    if not path.resolve().parent.is_dir():
        raise ArgumentError(f"the folder of {path} does not exist; make it first")


def _write_obj(path: Path, curve: SurfaceCurve) -> None:
    lines = [f"v {x!r} {y!r} {z!r}" for x, y, z in curve.points.tolist()]
    order = [*range(1, len(curve.points) + 1), *([1] if curve.closed else [])]
    lines.append("l " + " ".join(map(str, order)))
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")


def _write_json(path: Path, curve: SurfaceCurve) -> None:
    data = {
        "closed": curve.closed,
        "faces": curve.faces.tolist(),
        "barycentric": curve.barycentric.tolist(),
        "points": curve.points.tolist(),
        "control_index": curve.control_index.tolist(),
    }
    path.write_text(json.dumps(data, indent=1) + "\n", encoding="utf-8")


def _write_csv(path: Path, curve: SurfaceCurve) -> None:
    with path.open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file)
        writer.writerow(["face", "b0", "b1", "b2", "x", "y", "z"])
        for face, barycentric, point in zip(
            curve.faces.tolist(), curve.barycentric.tolist(), curve.points.tolist(), strict=True
        ):
            writer.writerow([face, *barycentric, *point])


def _joined(vertices: FloatArray, faces: IntArray) -> tuple[FloatArray, IntArray]:
    """Merge vertices of equal position and drop the faces that this collapses."""
    unique, index = np.unique(vertices, axis=0, return_inverse=True)
    faces = index.reshape(-1)[faces]
    collapsed = (faces == np.roll(faces, 1, axis=1)).any(axis=1)
    return unique, faces[~collapsed]
