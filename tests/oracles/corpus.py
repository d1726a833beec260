"""Every mesh that is there: a valid curve, or an error where no curve can be.

Whether an error is due is decided by `feasibility`, from the arrays alone: points that no chain of
faces with common edges joins, and points at one place. All else is "declined though possible", and
a curve that `checker` faults, an untyped error, a crash or a hang is wrong.
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
    """One curve that is asked for: a file or a generated mesh, and which of its requests."""

    folder: str
    name: str
    path: Path | None
    request: int


REQUESTS = ((True, True), (True, False), (False, True), (False, False))
"""Whether all points are drawn from one connected part, and whether the curve is closed."""


@dataclass(frozen=True)
class Outcome:
    """Which of the four it is, why, and how many faces the mesh has."""

    verdict: str
    words: str = ""
    faces: int = 0


def outcome(item: Item) -> Outcome:
    """Ask for the curve and judge what comes."""
    try:
        mesh, designer = _prepared(item.name, item.path)
    # Every file in the collections holds a mesh.
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
    # An error that is not the package's own is a finding, and must not end a long measurement.
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
    """Random vertices; None where there are too few."""
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
