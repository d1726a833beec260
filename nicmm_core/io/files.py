"""Reads and writes meshes and curves, in the format of the file extension."""

from __future__ import annotations

import csv
import io
import json
from pathlib import Path

import numpy as np

from ..errors import ArgumentError, MeshError, NicmmError
from ..geometry.curve import SurfaceCurve
from ..geometry.mesh import Mesh, MeshLike, as_mesh, real_array, whole_numbers
from .obj import read_obj
from .off import read_off
from .ply import read_ply
from .polygons import FormatError
from .stl import read_stl
from .writing import obj_bytes, off_bytes, ply_bytes, stl_bytes

_READERS = {".obj": read_obj, ".off": read_off, ".ply": read_ply, ".stl": read_stl}

_WRITERS = {".obj": obj_bytes, ".off": off_bytes, ".ply": ply_bytes, ".stl": stl_bytes}

MESH_FORMATS = tuple(_READERS)
CURVE_FORMATS = (".obj", ".json", ".csv")


def read_mesh(path: str | Path) -> Mesh:
    """Read a triangle mesh from an OBJ, OFF, PLY or STL file.

    Larger faces are triangulated, and triangles that have a vertex twice are left out. So face
    indices may differ from those in the file, but vertex indices do not. In an STL file, which
    stores every triangle separately, corners with equal positions become one vertex.

    Raises
    ------
    MeshError
        If the file cannot be opened, its extension is not supported, or it contains no usable mesh.
    """
    path = _supported(path, MESH_FORMATS, MeshError, "of a mesh file")
    try:
        if not path.is_file():
            raise MeshError(f"{path} does not exist or is not a file; check the path of the mesh")
        # Positions that are not finite need no warning here, since `Mesh` refuses them below.
        with np.errstate(invalid="ignore", over="ignore"):
            polygons = _READERS[path.suffix.lower()](path)
            triangles = polygons.triangles()
    except OSError as error:
        raise MeshError(f"{path} cannot be opened ({error}); check its permissions") from error
    except FormatError as error:
        raise MeshError(
            f"{path} cannot be read as {path.suffix[1:].upper()} ({error}); export it again"
        ) from error
    try:
        return Mesh(polygons.vertices, triangles)
    except MeshError as error:
        raise MeshError(f"{path} contains no usable mesh: {error}") from error


def read_curve(path: str | Path) -> SurfaceCurve:
    """Read a curve from a JSON file that `write_curve` has written.

    Whether it lies on a mesh is checked where it is used.

    Raises
    ------
    ArgumentError
        If the file cannot be opened or contains no curve.
    """
    path = _supported(path, (".json",), ArgumentError, "of a curve file")
    try:
        data = json.loads(path.read_text(encoding="utf-8"))
        closed = data["closed"]
        faces, control_index = (whole_numbers(data[name]) for name in ("faces", "control_index"))
        barycentric, points = (real_array(data[name]) for name in ("barycentric", "points"))
    except OSError as error:
        raise ArgumentError(f"{path} cannot be opened ({error}); check the path") from error
    except (ValueError, TypeError, KeyError, OverflowError, RecursionError) as error:
        raise ArgumentError(
            f"{path} contains no curve ({error!r}); write the curve as JSON again"
        ) from error
    return SurfaceCurve(closed, faces, barycentric, points, control_index)


def write_mesh(path: str | Path, mesh: MeshLike) -> None:
    """Write a mesh as OBJ, OFF, PLY or STL, by the extension of the path.

    Raises
    ------
    ArgumentError
        If the extension is not supported, or the file cannot be written.
    """
    mesh = as_mesh(mesh)
    path = _checked_output(path, MESH_FORMATS)
    _write(path, _WRITERS[path.suffix.lower()](mesh.vertices, mesh.faces))


def write_curve(path: str | Path, curve: SurfaceCurve) -> None:
    """Write a curve as OBJ, JSON or CSV, by the extension of the path.

    An OBJ file contains a polyline. A JSON file contains all attributes of the curve. A CSV file
    contains a row for each point: its face, three barycentric coordinates and three coordinates.

    Raises
    ------
    ArgumentError
        If the extension is not supported, or the file cannot be written.
    """
    path = check_curve_path(path)
    texts = {".obj": _obj_text, ".json": _json_text, ".csv": _csv_text}
    _write(path, texts[path.suffix.lower()](curve).encode("utf-8"))


def check_curve_path(path: str | Path) -> Path:
    """Check the path of a curve file before any work is done; raises ArgumentError if unusable."""
    return _checked_output(path, CURVE_FORMATS)


def _checked_output(path: str | Path, formats: tuple[str, ...]) -> Path:
    path = _supported(path, formats, ArgumentError, "to write to")
    try:
        has_folder = path.absolute().parent.is_dir()
    except OSError as error:  # a name that is too long
        raise ArgumentError(
            f"{path} is not a path to write to ({error}); choose another"
        ) from error
    if not has_folder:
        raise ArgumentError(f"the folder of {path} does not exist; create it first")
    return path


def _supported(
    path: str | Path, formats: tuple[str, ...], error: type[NicmmError], purpose: str
) -> Path:
    """The path, if it has one of the given extensions; otherwise raises an ``error``."""
    try:
        path = Path(path)
    except TypeError as cause:
        raise error(f"{path!r} is not a path {purpose}; pass a str or a Path") from cause
    if path.suffix.lower() not in formats:
        raise error(f"{path} has no supported extension; use {', '.join(formats)}")
    return path


def _write(path: Path, data: bytes) -> None:
    try:
        path.write_bytes(data)
    except (OSError, ValueError) as error:  # ValueError: an invalid file name
        raise ArgumentError(
            f"{path} cannot be written ({error}); choose another file or folder"
        ) from error


def _obj_text(curve: SurfaceCurve) -> str:
    lines = [f"v {x!r} {y!r} {z!r}" for x, y, z in curve.points.tolist()]
    order = [*range(1, len(curve.points) + 1), *([1] if curve.closed else [])]
    lines.append("l " + " ".join(map(str, order)))
    return "\n".join(lines) + "\n"


def _json_text(curve: SurfaceCurve) -> str:
    data = {
        "closed": curve.closed,
        "faces": curve.faces.tolist(),
        "barycentric": curve.barycentric.tolist(),
        "points": curve.points.tolist(),
        "control_index": curve.control_index.tolist(),
    }
    return json.dumps(data, indent=1) + "\n"


def _csv_text(curve: SurfaceCurve) -> str:
    text = io.StringIO(newline="")
    writer = csv.writer(text)
    writer.writerow(["face", "b0", "b1", "b2", "x", "y", "z"])
    points = zip(
        curve.faces.tolist(), curve.barycentric.tolist(), curve.points.tolist(), strict=True
    )
    writer.writerows([face, *barycentric, *point] for face, barycentric, point in points)
    return text.getvalue()
