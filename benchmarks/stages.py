"""Where the time of a design goes, by stage, and how it grows with the mesh."""

from __future__ import annotations

import multiprocessing
import resource
import sys
import time
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from types import ModuleType
from typing import Any
from unittest import mock

import numpy as np

import nicmm_core as nicmm
from nicmm_core import shapes, surface_designer
from nicmm_core.coarsening import coarse_start
from nicmm_core.courses import course_search, course_surface
from nicmm_core.geometry.array_types import IntArray
from nicmm_core.geometry.mesh import Mesh
from nicmm_core.level_set import problem, zero_set
from nicmm_core.network import single_pass

from . import report
from .evidence import Results
from .scale import Scale

TITLE = "Where the time goes"
TIMED = True
WITHOUT = ("outputs",)

SEED = 0
SIZES = ((500, 2), (1000, 3), (1500, 5))
"""Faces and subdivisions of the bodies: 8,000, 64,000 and 1,536,000 faces."""

SETS = 5
DRAGS = 5
POINTS = 4

STAGES: dict[str, list[tuple[ModuleType, str]]] = {
    "normals": [(surface_designer, "curve_surface")],
    "coarse mesh": [(coarse_start, "build_coarse_mesh")],
    "copy in its frame": [(course_surface, "renumbered")],
    "hop graph": [(course_surface, "build_hop_graph")],
    "order of the points": [(course_surface, "visiting_order")],
    "least costs, routes": [
        (course_search, "with_control_points"),
        (course_search, "routes_of_legs"),
    ],
    "combinations": [
        (course_search, "laid_routes"),
        (course_search, "crossing_routes"),
        (course_search, "combined"),
        (course_search, "course_nodes"),
    ],
    "crossings removed": [(course_search, "uncrossed")],
    "courses relaxed together": [(course_search, "relax_together")],
    "courses compared": [(course_search, "_best")],
    "initial path": [(problem, "build_initial_loop")],
    "distance and smoothing": [(problem, "signed_distance"), (problem, "build_smoother")],
    "network": [(single_pass, "infer_level_set")],
    "one loop, contour": [
        (problem, "keep_topology"),
        (zero_set, "keep_topology"),
        (zero_set, "extract_curves"),
    ],
    "mapping to the fine mesh": [
        (coarse_start, "curve_on_fine_mesh"),
        (coarse_start, "nodes_on_fine_mesh"),
    ],
    "start from the last curve": [(surface_designer, "moved_start")],
    "relaxation": [(surface_designer, "relax")],
}
"""Functions that make up a design, each where its caller finds it; none calls another."""

REST = "rest"
TOTAL = "together"

Times = dict[str, float]
"""Milliseconds by stage."""


def measure(scale: Scale) -> Results:
    """Measure generated bodies of three sizes."""
    sizes = ((200, 1),) if scale is Scale.SMOKE else SIZES[: scale.choose(3, 2)]
    bodies = []
    for faces, subdivisions in sizes:
        mesh = shapes.creature(SEED, faces=faces, subdivisions=subdivisions)
        print(f"  {len(mesh.faces):,} faces", flush=True)
        runs = _measured(mesh)
        memory = round(_bytes_a_vertex(faces, subdivisions), 1)
        bodies.append({"faces": len(mesh.faces), "milliseconds": runs, "bytes_a_vertex": memory})
    return {"seed": SEED, "sets": SETS, "points": POINTS, "drags": DRAGS, "bodies": bodies}


def section(results: Results) -> str:
    """Medians of every stage, and the memory."""
    bodies = results["bodies"]
    columns = {
        f"{body['faces']:,}, {kind}": {stage: np.median(each) for stage, each in stages.items()}
        for body in bodies
        for kind, stages in body["milliseconds"].items()
    }
    stages = next(iter(columns.values()))
    rows = [
        (stage, *(f"{times[stage]:.1f}" if times[stage] else "–" for times in columns.values()))
        for stage in stages
    ]
    bytes_each = report.listed(
        f"{body['bytes_a_vertex']:,.0f} with {body['faces']:,} faces" for body in bodies
    )
    return (
        f"Seed {results['seed']}, {results['sets']} sets of {results['points']} random vertices on "
        "a generated body of each size, shortest order; medians in milliseconds. *First*: the "
        "first curve on a mesh, whose arrays have been checked and no more. *Another*: through "
        "other points on the same Designer. *Dragged*: after a point has moved to a neighbouring "
        f"vertex, {results['drags']} times a set.\n\n"
        + report.table(("stage", *columns), rows)
        + "\n\nGreatest memory that a first curve takes beyond what the process had with the "
        f"mesh's arrays, in bytes a vertex: {bytes_each}."
    )


def _measured(mesh: Mesh) -> dict[str, dict[str, list[float]]]:
    """Milliseconds of all runs, by kind of run and stage."""
    generator = np.random.default_rng(SEED)
    runs: dict[str, list[Times]] = {"first": [], "another": [], "dragged": []}
    for _ in range(SETS):
        designer = nicmm.Designer(Mesh(mesh.vertices, mesh.faces))  # without anything cached
        points = generator.choice(len(mesh.vertices), POINTS, replace=False)
        runs["first"].append(_timed(designer, points)[0])
        points = generator.choice(len(mesh.vertices), POINTS, replace=False)
        times, design = _timed(designer, points)
        runs["another"].append(times)
        for _ in range(DRAGS):
            points = _dragged(designer.mesh, points)
            times, design = _timed(designer, points, design)
            runs["dragged"].append(times)
    return {
        kind: {stage: [round(one[stage], 3) for one in times] for stage in (*STAGES, REST, TOTAL)}
        for kind, times in runs.items()
    }


def _dragged(mesh: Mesh, points: IntArray) -> IntArray:
    around = np.unique(mesh.faces[mesh.faces_at(points[:1])])
    moved = points.copy()
    moved[0] = next(vertex for vertex in around.tolist() if vertex not in points)
    return moved


def _timed(
    designer: nicmm.Designer, points: IntArray, start: nicmm.Design | None = None
) -> tuple[Times, nicmm.Design]:
    with _stopwatches() as seconds:
        started = time.perf_counter()
        design = designer.design(points, order="shortest", start=start)
        total = time.perf_counter() - started
    seconds[REST] = total - sum(seconds.values())
    seconds[TOTAL] = total
    return {stage: 1000.0 * value for stage, value in seconds.items()}, design


@contextmanager
def _stopwatches() -> Iterator[Times]:
    """Add up the seconds spent in every stage."""
    seconds = dict.fromkeys(STAGES, 0.0)

    def timed(stage: str, function: Any) -> Any:
        def wrapped(*arguments: Any, **named: Any) -> Any:
            started = time.perf_counter()
            try:
                return function(*arguments, **named)
            finally:
                seconds[stage] += time.perf_counter() - started

        return wrapped

    with ExitStack() as patches:
        for stage, functions in STAGES.items():
            for module, name in functions:
                wrapped = timed(stage, getattr(module, name))
                patches.enter_context(mock.patch.object(module, name, wrapped))
        yield seconds


def _bytes_a_vertex(faces: int, subdivisions: int) -> float:
    """What the first curve on a mesh adds to the memory of a process of its own."""
    with multiprocessing.get_context("spawn").Pool(1) as pool:
        return float(pool.apply(_growth, (faces, subdivisions)))


def _growth(faces: int, subdivisions: int) -> float:
    nicmm.design_curve(shapes.sphere(3), [0, 100, 200])  # what every process loads once
    mesh = shapes.creature(SEED, faces=faces, subdivisions=subdivisions)
    before = _resident()
    points = np.random.default_rng(SEED).choice(len(mesh.vertices), POINTS, replace=False)
    nicmm.design_curve(mesh, points, order="shortest")
    return max(0, _peak() - before) / len(mesh.vertices)


def _resident() -> int:
    """Bytes of memory in use now."""
    with open("/proc/self/statm") as file:
        return int(file.read().split()[1]) * resource.getpagesize()


def _peak() -> int:
    """Greatest memory that was ever in use, in bytes."""
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    return peak if sys.platform == "darwin" else peak * 1024
