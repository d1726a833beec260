"""Measures whether a curve stays the same on meshes with defects that keep the surface."""

from __future__ import annotations

import os
import time
import zlib
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import chain

import numpy as np

import nicmm_core as nicmm
from nicmm_core.courses.comparison import farthest_between
from nicmm_core.geometry.array_types import FloatArray, IntArray
from nicmm_core.geometry.curve import resample
from nicmm_core.geometry.mesh import Mesh
from nicmm_core.relaxation.curve_nodes import CurveSurface
from nicmm_core.relaxation.elastic_energy import comparable_energies
from tests.oracles import same_surface
from tests.oracles.checker import judge

from . import collections, report
from .evidence import DESIGN, Results
from .parallel import in_processes
from .progress import resumed
from .samples import random_sets
from .scale import Scale

CHANGING = ("gaps", "other diagonals")
"""Changes after which the search may find another course."""

TITLE = "Defects that keep the surface"
ROOMS = DESIGN

SEED = 42

SAME = 1e-6
"""Distance, in diagonals, up to which a curve counts as the same."""

SIMILAR = 1.15
"""Ratio of energies up to which curves count as similar."""

SAMPLES = 1_000
"""Number of points at which two curves are compared."""

WORKERS = os.cpu_count() or 1
"""Number of processes; a request is measured by one of them."""

CHANGES = (*same_surface.SAME_CURVE, *same_surface.SIMILAR_CURVE, *same_surface.CHAINS)


@dataclass(frozen=True)
class Job:
    """One request on one mesh."""

    mesh_name: str
    mesh: Mesh
    points: IntArray
    closed: bool


def measure(scale: Scale) -> Results:
    """Design each curve on the clean mesh and on every changed one."""
    surfaces = collections.surfaces(scale, scale.choose(24, 3, 1))
    if scale is not Scale.SMOKE:
        others = (collections.clean(scale.choose(10, 1)), collections.bodies(scale.choose(6, 1)))
        surfaces = chain(surfaces, *others)
    jobs = (
        Job(name, mesh, points, closed)
        for name, mesh, points in random_sets(surfaces, 1, SEED)
        for closed in (True, False)
    )
    workers = 1 if scale is Scale.SMOKE else WORKERS
    requests = []
    for request in resumed(
        "defects", scale, jobs, lambda rest: in_processes(_measured, rest, workers)
    ):
        requests.append(request)
        worst = max(
            request["answers"], key=lambda name: abs(np.log(request["answers"][name]["energy"]))
        )
        ratio = request["answers"][worst]["energy"]
        print(f"  {request['mesh']}, closed {request['closed']}: {worst} {ratio}", flush=True)
    return {
        "seed": SEED,
        "collection": collections.label(scale),
        "changes": list(CHANGES),
        "requests": requests,
    }


def section(results: Results) -> str:
    """How far curves move, how their energies change and how long they take, by change."""
    requests = results["requests"]
    meshes = len({request["mesh"] for request in requests})
    header = (
        "change", "energy, geometric mean", "least", "greatest",
        f"within {100 * (SIMILAR - 1):.0f} %", f"within {SAME:g} of the diagonal",
        "greatest distance, % of the diagonal", "time", "greatest", "faults",
    )  # fmt: skip
    rows = [_row(name, [r["answers"][name] for r in requests]) for name in results["changes"]]
    return (
        "Each mesh was changed in ways that keep its surface, alone and one after another, and the "
        "same control points were asked for. Each row is a change; a chain applies several. Its "
        "columns are the elastic energy of the curve relative to that on the unchanged mesh, as "
        "geometric mean, least and greatest; the share of curves whose energy changes by at most "
        f"{100 * (SIMILAR - 1):.0f} %, and of those nowhere farther than {SAME:g} of the diagonal "
        "from the curve on the unchanged mesh; the greatest distance; the time relative to that on "
        "the unchanged mesh, as median and greatest; and the number of curves in which an "
        f"independent check finds a fault. {meshes} meshes ({results['collection']}, closed "
        "manifolds and bodies), each with one set of 3–5 random vertices (shortest order, seed "
        f"{results['seed']}), asked for as a closed and as an open curve.\n\n"
        + report.table(header, rows)
        + "\n\nThe first nine changes keep the faces up to order, orientation, repetition and "
        "vertices in common, so the curve is the same unless a coordinate is rounded "
        "otherwise. The others change the triangulation. Divided edges become whole again, "
        "except beside needles. Gaps as wide as a rounding error in single precision move "
        "vertices, which are then rounded otherwise, and the search may find another course. "
        "Other diagonals mostly lead to the same Delaunay triangulation, on which the curve "
        "is found, but the surface on which it is relaxed at last is another one. Times are "
        "processor times of single runs, two at once. The paper has no corresponding "
        "measurement."
    )


def summary(results: Results) -> str:
    """What the documents say of it."""
    same: list[float] = []
    others = []
    for name in results["changes"]:
        answers = [request["answers"][name] for request in results["requests"]]
        share = np.mean([each["away"] <= SAME for each in answers])
        if name in CHANGING:
            moved = np.abs(np.log([each["energy"] for each in answers])) > np.log(SIMILAR)
            others.append(f"{100 * moved.mean():.0f} % ({name})")
        elif not any(change in name for change in CHANGING):
            same.append(float(share))
    return report.item(
        "Defects that keep the surface hardly ever change the curve: with turned or doubled faces, "
        "as a soup, with faces without area, T-junctions or loose vertices, "
        f"{100 * min(same):.0f} % or more of the curves stay the same within {SAME:g} of the "
        "diagonal. Tiny gaps, and quadrilaterals divided along the other diagonal, can lead to "
        f"another course: the energy changes by more than {100 * (SIMILAR - 1):.0f} % for "
        f"{report.listed(others)} of the curves "
        "([measured](../benchmarks/RESULTS.md#defects-that-keep-the-surface))."
    )


def _row(name: str, answers: Sequence[Results]) -> tuple[object, ...]:
    energies = np.array([answer["energy"] for answer in answers])
    away = np.array([answer["away"] for answer in answers])
    seconds = np.array([answer["time"] for answer in answers])
    similar = np.abs(np.log(energies)) <= np.log(SIMILAR)
    return (
        name,
        f"{np.exp(np.log(energies).mean()):.3f}",
        f"{energies.min():.3f}",
        f"{energies.max():.3f}",
        f"{100 * similar.mean():.0f} %",
        f"{100 * (away <= SAME).mean():.0f} %",
        f"{100 * away.max():.2g}",
        f"{np.median(seconds):.2f}",
        f"{seconds.max():.2f}",
        sum(bool(answer["faults"]) for answer in answers),
    )


def _measured(job: Job) -> Results:
    """Answers on all changed meshes, compared with that on the unchanged one."""
    unchanged = _designed(job.mesh, job.points, job.closed)
    samples = _samples(unchanged[0].curves[0].points, job.closed)
    energy, scale = _energy(unchanged[0], None)
    answers = {}
    for name in CHANGES:
        changed = same_surface.changed(job.mesh, name, zlib.crc32(job.mesh_name.encode()))
        mesh, points = changed.mesh, changed.number[job.points]
        design, seconds = _designed(mesh, points, job.closed)
        there = _samples(changed.undone(design.curves[0].points), job.closed)
        verdict = judge(mesh, design, points, job.closed, "shortest")
        answers[name] = {
            "energy": round(_energy(design, scale)[0] / energy, 6),
            "away": float(f"{farthest_between(samples, there) / job.mesh.diagonal:.3g}"),
            "time": round(seconds / unchanged[1], 3),
            "faults": verdict.faults,
        }
    return {"mesh": job.mesh_name, "closed": job.closed, "answers": answers}


def _designed(mesh: Mesh, points: IntArray, closed: bool) -> tuple[nicmm.Design, float]:
    """A curve, and the processor time that it took, in seconds."""
    started = time.process_time()
    design = nicmm.design_curve(mesh, points, closed=closed, order="shortest")
    return design, time.process_time() - started


def _samples(points: FloatArray, closed: bool) -> FloatArray:
    samples: FloatArray = resample(points, SAMPLES, closed)[0]
    return samples


def _energy(design: nicmm.Design, scale: float | None) -> tuple[float, float]:
    """Energy of a curve on a length scale, by default its length, and that scale.

    Lengths are those of the copy on which the curve was designed.
    """
    assert design.resumable is not None
    nodes, mesh = design.resumable.curve.nodes, design.resumable.mesh
    surface = CurveSurface(mesh, mesh.vertices)  # without maps only the nodes count
    scale = float(nodes.lengths.sum()) if scale is None else scale
    return float(comparable_energies(surface, nodes, 1.0, scale)[0]), scale
