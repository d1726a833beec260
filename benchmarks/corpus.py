"""Every mesh that is there: a valid curve, or an error where no curve can be.

Whether an error is due is decided by `feasibility`, from the arrays alone: points that no chain of
faces with common edges joins, and points at one place. All else is "declined though possible", and
a curve that `checker` faults, an untyped error, a crash or a hang is wrong.
"""

from __future__ import annotations

import functools
import zlib
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

import nicmm_core as nicmm
from nicmm_core.geometry.array_types import IntArray
from nicmm_core.geometry.surface_points import locate_points
from nicmm_core.io.files import read_mesh

from . import collections, report
from .checker import judge
from .defects import defective_meshes
from .feasibility import edge_connected_parts, why_impossible
from .isolation import Isolated, isolated
from .scale import Scale

SEED = 0

FOLDERS = ("nasty", "thingi10k", "clean", "shapes", "meshcnn_seg", "big", "shrec16")

GENERATED = "generated"

PATIENCE = 1200.0
"""Seconds by the wall clock after which a curve is given up: it hangs."""

LISTED = 60
SLOWEST = 8

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

KIND = {True: "closed", False: "open"}


@dataclass(frozen=True)
class Outcome:
    """Which of the four it is, and why."""

    verdict: str
    words: str = ""


def run(scale: Scale) -> None:
    """Ask for curves on all meshes and sort what comes, one collection after the other."""
    items = _items(scale)
    folders = [f for f in (GENERATED, *FOLDERS) if any(item.folder == f for item in items)]
    done: list[Isolated[Item, Outcome]] = []
    for number, folder in enumerate(folders, start=1):
        here = [item for item in items if item.folder == folder]
        for one in isolated(outcome, here, PATIENCE):
            done.append(one)
            if _verdict(one) in (DECLINED, WRONG):
                print(f"  {_line(one)}", flush=True)
        _write(done, folders[:number], folders[number:], scale)


def _write(
    done: Sequence[Isolated[Item, Outcome]],
    folders: Sequence[str],
    missing: Sequence[str],
    scale: Scale,
) -> None:
    """The section as far as the measurement is; a large collection takes hours."""
    rows = []
    for folder in folders:
        rows += _row(folder, [one for one in done if one.item.folder == folder])
    rows += _row("all", done)
    slowest = sorted(done, key=lambda one: -one.seconds)[:SLOWEST]
    listed = [one for one in done if _verdict(one) in (DECLINED, WRONG)]
    body = (
        f"Seed {SEED}; on each mesh {len(REQUESTS)} curves through random vertices, shortest "
        "order: 3–5 closed and 2–4 open, drawn from one part of the surface that "
        "common edges connect, and from all of its vertices. Whether an error is due is decided "
        "from the arrays alone.\n\n"
        + report.table(("meshes", "curves", GOOD, DUE, DECLINED, WRONG, "CPU seconds"), rows)
        + "\n\n"
        + ("".join(f"- {_line(one)}\n" for one in listed[:LISTED]) or "None declined or wrong.\n")
        + "\nThe slowest: "
        + report.listed(f"{_name(one.item)} {one.seconds:.0f} s" for one in slowest)
        + "."
        + (f"\n\nNot measured yet: {report.listed(missing)}." if missing else "")
    )
    report.write_section("corpus", "Every mesh", body, scale)


def _items(scale: Scale) -> list[Item]:
    items = [Item(GENERATED, name, None, r) for name, r in _generated_requests(scale)]
    if scale is Scale.SMOKE:
        return items
    generator = np.random.default_rng(SEED)
    for folder in FOLDERS:
        files = collections.mesh_files(folder)
        share = scale.choose(len(files), -(-len(files) // 10))
        for place in np.sort(generator.choice(len(files), share, replace=False)):
            for request in range(len(REQUESTS)):
                name = str(files[place].relative_to(collections.COLLECTIONS / folder))
                items.append(Item(folder, name, files[place], request))
    return items


def _generated_requests(scale: Scale) -> list[tuple[str, int]]:
    """All of them, or one request each."""
    names = [name for name, _ in defective_meshes()]
    if scale is Scale.SMOKE:
        return [(name, place % len(REQUESTS)) for place, name in enumerate(names)]
    return [(name, request) for name in names for request in range(len(REQUESTS))]


def outcome(item: Item) -> Outcome:
    """Ask for the curve and judge what comes."""
    try:
        mesh, designer = _prepared(item.name, item.path)
    # Every file in the collections holds a mesh.
    except nicmm.NicmmError as error:
        return Outcome(DECLINED, f"{type(error).__name__}: {error}")
    except Exception as error:
        return Outcome(WRONG, f"untyped {type(error).__name__}: {error}")
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


def _verdict(one: Isolated[Item, Outcome]) -> str:
    return WRONG if one.result is None or one.output.strip() else one.result.verdict


def _name(item: Item) -> str:
    of_one_part, closed = REQUESTS[item.request]
    where = "one part" if of_one_part else "anywhere"
    return f"{item.folder}/{item.name} {KIND[closed]} {where}"


def _line(one: Isolated[Item, Outcome]) -> str:
    words = one.failure if one.result is None else one.result.words
    printed = f" printed {one.output.strip()[:200]!r}" if one.output.strip() else ""
    return f"{_name(one.item)}: {_verdict(one)}: {words[:300]}{printed} ({one.seconds:.1f} s)"


def _row(label: str, done: Sequence[Isolated[Item, Outcome]]) -> list[tuple[object, ...]]:
    if not done:
        return []
    counts = Counter(map(_verdict, done))
    shares = [
        f"{counts[each]} ({100 * counts[each] / len(done):.1f} %)"
        for each in (GOOD, DUE, DECLINED, WRONG)
    ]
    meshes = len({(one.item.folder, one.item.name) for one in done})
    return [(f"{meshes} {label}", len(done), *shares, f"{sum(one.seconds for one in done):.0f}")]
