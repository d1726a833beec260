"""Cuts along designed curves, judged from outside: the same surface with the curve in its edges."""

from __future__ import annotations

import time
import zlib
from collections.abc import Iterable, Iterator
from dataclasses import dataclass

import numpy as np

import nicmm_core as nicmm
from nicmm_core.geometry.array_types import IntArray
from nicmm_core.geometry.mesh import unique_edges

from . import collections, report
from .samples import point_sets
from .scale import Scale

SEED = 0

AREA = 1e-9
"""Most that the total area may change by, relative to itself."""


@dataclass(frozen=True)
class Cut:
    """What came of cutting along one curve; ``least`` is the smallest part of any face."""

    collection: str
    name: str
    faults: tuple[str, ...]
    milliseconds: float
    least: float
    bounds: bool


def run(scale: Scale) -> None:
    """Cut along a closed and an open curve on every mesh."""
    cuts, refused = [], 0
    for label, meshes in _collections(scale):
        for name, mesh in meshes:
            generator = np.random.default_rng([SEED, zlib.crc32(name.encode())])
            designer = nicmm.Designer(mesh)
            (points,) = point_sets(mesh, 1, generator)
            for closed in (True, False):
                design = designer.design(points, closed=closed, order="shortest")
                try:
                    cuts.append(_cut(label, name, mesh, design.curves[0]))
                except nicmm.CurveError as error:
                    refused += 1
                    print(f"  {label}, {name}: {error}", flush=True)
            print(f"  {label}, {name}: {cuts[-1].faults or 'sound'}", flush=True)
    body = (
        f"Seed {SEED}; on each mesh a closed and an open curve through 3–5 random vertices. A cut "
        "is sound if Euler characteristic, boundary length and total area (to 1e-9) are as before, "
        "no edge has more than two faces that had not, every part has a positive area and turns as "
        "its face does, every edge of the chain is there, and the mesh falls apart along it "
        "exactly where the curve bounds a region. Refused: "
        f"{refused}.\n\n{_table(cuts)}\n\n{_faults(cuts)}"
    )
    report.write_section("cuts", "Cuts along curves", body, scale)


def _collections(scale: Scale) -> Iterator[tuple[str, Iterable[tuple[str, nicmm.Mesh]]]]:
    if scale is Scale.SMOKE:
        yield "generated creatures", collections.creatures(1)
        return
    yield "SHREC16, two Loop subdivisions", collections.shrec16(scale.choose(96, 8))
    yield "closed manifold", collections.clean(scale.choose(36, 3))


def _cut(label: str, name: str, mesh: nicmm.Mesh, curve: nicmm.SurfaceCurve) -> Cut:
    started = time.process_time()
    cut = nicmm.cut_mesh(mesh, curve)
    milliseconds = 1e3 * (time.process_time() - started)
    try:
        nicmm.enclosed_region(mesh, cut)
        bounds = True
    except nicmm.CurveError:
        bounds = False
    shares = np.linalg.det(cut.corner_weights(mesh))
    checks = {
        "Euler characteristic": _euler(cut.faces) == _euler(mesh.faces),
        "branches": unique_edges(cut.faces)[1].max() <= max(2, unique_edges(mesh.faces)[1].max()),
        "boundary": np.isclose(_rim(cut.mesh), _rim(mesh), rtol=1e-9, atol=0.0),
        "area": abs(cut.mesh.face_areas.sum() / mesh.face_areas.sum() - 1.0) < AREA,
        "orientation": shares.min() > 0.0,
        "chain": _has_chain(cut),
        "parts": bounds == (_n_parts(nicmm.part_mesh(cut).part) > _n_parts(mesh.face_component)),
    }
    faults = tuple(check for check, fine in checks.items() if not fine)
    return Cut(label, name, faults, milliseconds, float(shares.min()), bounds)


def _euler(faces: IntArray) -> int:
    return len(np.unique(faces)) - len(unique_edges(faces)[0]) + len(faces)


def _rim(mesh: nicmm.Mesh) -> float:
    edges, count = unique_edges(mesh.faces)
    start, end = mesh.vertices[edges[count == 1].T]
    return float(np.linalg.norm(start - end, axis=1).sum())


def _has_chain(cut: nicmm.CutMesh) -> bool:
    size = np.array([len(cut.vertices), 1])
    edges = unique_edges(cut.faces)[0] @ size
    return bool(np.isin(np.sort(cut.chain_edges, axis=1) @ size, edges).all())


def _n_parts(label: IntArray) -> int:
    return len(np.unique(label))


def _table(cuts: list[Cut]) -> str:
    lines = [
        "| meshes | cuts | sound | that bound a region | least part of a face | "
        "median ms (CPU) | most |",
        "|---|---|---|---|---|---|---|",
    ]
    for label in dict.fromkeys(cut.collection for cut in cuts):
        here = [cut for cut in cuts if cut.collection == label]
        sound = sum(not cut.faults for cut in here)
        times = [cut.milliseconds for cut in here]
        lines.append(
            f"| {label} | {len(here)} | {sound} | {sum(cut.bounds for cut in here)} | "
            f"{min(cut.least for cut in here):.1e} | {np.median(times):.0f} | {max(times):.0f} |"
        )
    return "\n".join(lines)


def _faults(cuts: list[Cut]) -> str:
    listed = [f"- {cut.name}: {', '.join(cut.faults)}" for cut in cuts if cut.faults]
    return "\n".join(listed) or "No cut has a fault."
