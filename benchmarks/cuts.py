"""Tests cuts along designed curves: the result must be the same surface with the curve as edges."""

from __future__ import annotations

import time
import zlib
from collections.abc import Iterable, Iterator, Sequence

import numpy as np

import nicmm_core as nicmm
from nicmm_core.geometry.array_types import IntArray
from nicmm_core.geometry.mesh import unique_edges

from . import collections, report
from .evidence import DESIGN, Results
from .samples import point_sets
from .scale import Scale

TITLE = "Cuts along curves"
ROOMS = (*DESIGN, "outputs")

SEED = 0

AREA = 1e-9
"""Greatest relative change of the total area."""


def measure(scale: Scale) -> Results:
    """Cut along a closed and an open curve on every mesh."""
    answers = []
    for label, meshes in _collections(scale):
        for name, mesh in meshes:
            generator = np.random.default_rng([SEED, zlib.crc32(name.encode())])
            designer = nicmm.Designer(mesh)
            (points,) = point_sets(mesh, 1, generator)
            faults: list[str] = []
            for closed in (True, False):
                design = designer.design(points, closed=closed, order="shortest")
                answer: Results = {"meshes": label, "mesh": name, "closed": closed}
                try:
                    answer |= _cut(mesh, design.curves[0])
                    faults += answer["faults"]
                except nicmm.CurveError as error:
                    answer["refused"] = str(error)
                    print(f"  {label}, {name}: {error}", flush=True)
                answers.append(answer)
            print(f"  {label}, {name}: {report.listed(faults) or 'sound'}", flush=True)
    return {"seed": SEED, "area": AREA, "answers": answers}


def section(results: Results) -> str:
    """Number of sound cuts, and the faults of the others."""
    cuts = [each for each in results["answers"] if "refused" not in each]
    area = np.format_float_scientific(results["area"], trim="-", exp_digits=1)
    return (
        "Meshes were cut along a closed and an open curve each, and the table counts the cuts that "
        "are sound. A cut is sound if Euler characteristic, boundary length and total area (to "
        f"{area}) are unchanged; no edge gets more than two faces; every part of a face has a "
        "positive area and the orientation of its face; every edge of the curve is an edge of the "
        "cut mesh; and the cut separates the mesh exactly if the curve bounds a region. Each row "
        "is a collection, with the number of curves that bound a region, the smallest part of a "
        "face relative to that face, and the median and greatest CPU time of a cut. The curves "
        f"pass 3–5 random vertices (seed {results['seed']}). Cuts that were refused with an error: "
        f"{len(results['answers']) - len(cuts)}. The paper has no corresponding measurement.\n\n"
        f"{_table(cuts)}\n\n{_faults(cuts)}"
    )


def summary(results: Results) -> str:
    """What the documents say of it."""
    cuts = [each for each in results["answers"] if "refused" not in each]
    sound = sum(not each["faults"] for each in cuts)
    meshes = len({(each["meshes"], each["mesh"]) for each in cuts})
    return report.item(
        "A manifold stays a manifold: faces do not overlap, there are no holes, and boundaries do "
        f"not move (`python -m benchmarks cuts`: {sound} of {len(cuts)} cuts on {meshes} "
        "third-party meshes)."
    )


def _collections(scale: Scale) -> Iterator[tuple[str, Iterable[tuple[str, nicmm.Mesh]]]]:
    if scale is Scale.SMOKE:
        yield "generated creatures", collections.creatures(1)
        return
    yield "SHREC16, two Loop subdivisions", collections.shrec16(scale.choose(48, 8))
    yield "closed manifold", collections.clean(scale.choose(36, 3))


def _cut(mesh: nicmm.Mesh, curve: nicmm.SurfaceCurve) -> Results:
    """Outcome of a cut along one curve; "least" is the smallest part of a face, relative to it."""
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
    return {
        "faults": [check for check, fine in checks.items() if not fine],
        "milliseconds": round(milliseconds, 2),
        "least": float(f"{shares.min():.4g}"),
        "bounds": bounds,
    }


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


def _table(cuts: Sequence[Results]) -> str:
    header = (
        "meshes", "cuts", "sound", "that bound a region", "smallest part of a face",
        "median time (ms)", "greatest time (ms)",
    )  # fmt: skip
    rows = []
    for label in dict.fromkeys(cut["meshes"] for cut in cuts):
        here = [cut for cut in cuts if cut["meshes"] == label]
        times = [cut["milliseconds"] for cut in here]
        rows.append(
            (
                label,
                len(here),
                sum(not cut["faults"] for cut in here),
                sum(cut["bounds"] for cut in here),
                f"{min(cut['least'] for cut in here):.1e}",
                f"{np.median(times):.0f}",
                f"{max(times):.0f}",
            )
        )
    return report.table(header, rows)


def _faults(cuts: Sequence[Results]) -> str:
    listed = [f"- {cut['mesh']}: {report.listed(cut['faults'])}" for cut in cuts if cut["faults"]]
    return "\n".join(listed) or "All of these cuts are sound."
