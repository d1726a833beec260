"""Requests curves on all available meshes and classifies the answers.

An answer is a good curve, or an error where no curve exists. Whether one exists is decided by
`feasibility`, from the arrays alone: an error is due if no chain of faces with common edges joins
the points, or if two points coincide. Any other error of the package is "declined though possible".
A curve that `checker` faults, an untyped error, a crash or a hang is wrong.
"""

from __future__ import annotations

import functools
import zlib
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

import nicmm_core as nicmm
from nicmm_core.geometry.array_types import IntArray
from nicmm_core.geometry.surface_points import locate_points
from nicmm_core.io.files import read_mesh

from .checker import judge
from .defects import defective_meshes
from .feasibility import edge_connected_parts, why_impossible

SEED = 0

FOLDERS = ("nasty", "thingi10k", "clean", "shapes", "meshcnn_seg", "big", "shrec16")

GENERATED = "generated"

GOOD, DUE, DECLINED, WRONG = "good curve", "error where due", "declined though possible", "wrong"


@dataclass(frozen=True)
class Item:
    """One request: a file or a generated mesh, and the index of the request in `REQUESTS`."""

    folder: str
    name: str
    path: Path | None
    request: int


REQUESTS = ((True, True), (True, False), (False, True), (False, False))
"""For each request: whether all points are on one connected part, and whether it is closed."""


@dataclass(frozen=True)
class Outcome:
    """Class of an answer, the reason for it, and the number of faces of the mesh."""

    verdict: str
    words: str = ""
    faces: int = 0


def outcome(item: Item) -> Outcome:
    """Request the curve and classify the answer."""
    try:
        mesh, designer = _prepared(item.name, item.path)
    # Every file in the collections contains a mesh, so an error is never due here.
    except nicmm.NicmmError as error:
        return Outcome(DECLINED, f"{type(error).__name__}: {error}")
    except Exception as error:
        return Outcome(WRONG, f"untyped {type(error).__name__}: {error}")
    return replace(_answer(item, mesh, designer), faces=len(mesh.faces))


def _answer(item: Item, mesh: nicmm.Mesh, designer: nicmm.Designer) -> Outcome:
    of_one_part, closed = REQUESTS[item.request]
    generator = np.random.default_rng([SEED, zlib.crc32(item.name.encode()), item.request])
    points = _points(mesh, of_one_part, closed, generator)
    if points is None:
        return Outcome(DUE, "too few vertices")
    located = locate_points(mesh, points, "points")
    due = why_impossible(mesh, located)
    try:
        design = designer.design(points, closed=closed, order="shortest")
    except nicmm.NicmmError as error:
        words = f"{type(error).__name__}: {error}"
        return Outcome(DUE if due else DECLINED, words)
    # Any other exception is a finding as well, and must not end a long measurement.
    except Exception as error:
        return Outcome(WRONG, f"untyped {type(error).__name__}: {error}")
    faults = judge(mesh, design, points, closed, "shortest").faults
    if not np.isfinite(design.field).all():
        faults.append("the field is not finite")
    return Outcome(WRONG if faults else GOOD, "; ".join(faults))


@functools.lru_cache(maxsize=1)
def _prepared(name: str, path: Path | None) -> tuple[nicmm.Mesh, nicmm.Designer]:
    mesh = dict(defective_meshes())[name] if path is None else read_mesh(path)
    return mesh, nicmm.Designer(mesh)


def _points(
    mesh: nicmm.Mesh, of_one_part: bool, closed: bool, generator: np.random.Generator
) -> IntArray | None:
    """Random vertices; None if there are too few."""
    faces = mesh.faces
    if of_one_part:
        part = edge_connected_parts(mesh)
        faces = faces[part == part[generator.integers(len(faces))]]
    vertices = np.unique(faces)
    fewest = 3 if closed else 2
    if len(vertices) < fewest:
        return None
    count = min(int(generator.integers(fewest, fewest + 3)), len(vertices))
    return generator.choice(vertices, count, replace=False)
