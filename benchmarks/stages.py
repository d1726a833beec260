"""Measures the time and the function calls of each stage of a design, by mesh size."""

from __future__ import annotations

import multiprocessing
import resource
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from types import ModuleType
from typing import Any
from unittest import mock

import numpy as np

import nicmm_core as nicmm
from nicmm_core import (
    designer,
    mapped_surface,
    repaired_surface,
    shapes,
    start_search,
    surface_designer,
)
from nicmm_core.coarsening import coarse_start
from nicmm_core.courses import course_candidates, course_search, course_set, course_surface
from nicmm_core.geometry.array_types import IntArray
from nicmm_core.geometry.mesh import Mesh

from . import report
from .evidence import DESIGN, Results
from .scale import Scale

TITLE = "Where the time goes"
TIMED = True
ROOMS = DESIGN

SEED = 0
SIZES = ((500, 2), (1000, 3), (1500, 5))
"""Faces before subdivision, and subdivisions: 8,000, 64,000 and 1,536,000 faces in the end."""

SETS = 5
DRAGS = 5
POINTS = 4

STAGES: dict[str, list[tuple[ModuleType | type, str]]] = {
    "checks, clean surface, manifold": [
        (designer, "checked_options"),
        (designer, "locate_control_points"),
        (designer, "clean_surfaces"),
        (repaired_surface, "manifold"),
    ],
    "canonical copy": [
        (repaired_surface, "renumbered"),
        (coarse_start, "renumbered"),
        (repaired_surface.Manifold, "request"),
        (repaired_surface.Manifold, "design_on_original"),
    ],
    "normals": [(mapped_surface, "curve_surface"), (course_surface, "curve_surface")],
    "coarse mesh": [(coarse_start, "build_coarse_mesh")],
    "hop graph": [(course_surface, "build_hop_graph")],
    "distances, order of the points": [
        (course_surface, "distances_along_edges"),
        (course_surface, "shortest_order"),
    ],
    "least costs, routes": [
        (course_search, "with_control_points"),
        (course_candidates, "leg_choices"),
        (course_candidates, "cheapest_orders"),
        (course_candidates, "routes_of_legs"),
    ],
    "combinations": [
        (course_candidates, "curves_on_routes"),
        (course_candidates, "crossing_legs"),
        (course_candidates, "junctions_of_routes"),
        (course_candidates, "cheapest_combinations"),
        (course_candidates, "distinct_combinations"),
        (course_candidates, "course_nodes"),
    ],
    "legs recombined": [(course_search, "recombined")],
    "crossings removed": [(course_set, "remove_crossings")],
    "courses relaxed together": [(course_set, "relax_batch")],
    "courses compared, denser": [
        (course_search, "distinct_courses"),
        (course_search, "with_nodes"),
        (course_set, "with_nodes"),
    ],
    "course traced": [(start_search, "simple_curve")],
    "initial path": [(start_search, "find_initial_path")],
    "mapping to the fine mesh": [(coarse_start, "nodes_on_fine_mesh")],
    "start from the last curve": [(surface_designer, "moved_start")],
    "relaxation": [(surface_designer, "relax")],
}
"""Functions of each stage, each in the namespace of its caller; none of them calls another."""

REST = "rest"
TOTAL = "together"

Times = dict[str, float]
"""Time in milliseconds, or number of calls, by stage."""


def measure(scale: Scale) -> Results:
    """Measure designs on generated bodies of three sizes."""
    sizes = ((200, 1),) if scale is Scale.SMOKE else SIZES[: scale.choose(3, 2)]
    bodies = []
    for faces, subdivisions in sizes:
        mesh = shapes.creature(SEED, faces=faces, subdivisions=subdivisions)
        print(f"  {len(mesh.faces):,} faces", flush=True)
        bodies.append(
            {
                "faces": len(mesh.faces),
                "milliseconds": _measured(mesh),
                "calls": _counted(mesh),
                "bytes_a_vertex": round(_bytes_a_vertex(faces, subdivisions), 1),
            }
        )
    return {"seed": SEED, "sets": SETS, "points": POINTS, "drags": DRAGS, "bodies": bodies}


def section(results: Results) -> str:
    """Median time and calls of every stage, and the memory."""
    bodies = results["bodies"]
    medians, calls = {}, {}
    for body in bodies:
        for kind, stages in body["milliseconds"].items():
            label = f"{body['faces']:,} faces, {kind}"
            medians[label] = {stage: float(np.median(each)) for stage, each in stages.items()}
        for kind, counts in body["calls"].items():
            calls[f"{body['faces']:,} faces, {kind}"] = counts
    bytes_each = report.listed(
        f"{body['bytes_a_vertex']:,.0f} with {body['faces']:,} faces" for body in bodies
    )
    return (
        "The tables show how the time and the function calls of a design by `elastic` are "
        "distributed over its stages, on a generated body of each size. Each row is a stage and "
        "each column a mesh size and a kind of design. *First* is the first curve on a mesh, of "
        "which only the arrays have been checked; *another* is a curve through other points on the "
        "same Designer; *dragged* is a curve after one point has moved to a neighbouring vertex, "
        f"{results['drags']} times per set, which starts from the curve before. The row "
        f"*{REST}* is all that belongs to no stage, and *{TOTAL}* is the whole design; a dash "
        "means that the stage did not run. The first table has medians in milliseconds over "
        f"{results['sets']} sets of {results['points']} random vertices (shortest order, seed "
        f"{results['seed']}). The paper has no corresponding measurement.\n\n"
        + _table(medians, 1)
        + "\n\nThe second table has the numbers of calls of functions in Python and C for one "
        "set, counted by `sys.setprofile`.\n\n"
        + _table(calls, 0)
        + "\n\nThe greatest memory that a first curve takes, in addition to that of the process "
        f"with the arrays of the mesh, in bytes per vertex: {bytes_each}."
    )


def summary(results: Results) -> str:
    """What the documents say of it."""
    body = results["bodies"][-1]
    first, another, dragged = (
        np.median(body["milliseconds"][kind]["together"]) / 1000.0
        for kind in ("first", "another", "dragged")
    )
    return report.item(
        f"On a mesh of {body['faces'] / 1e6:.1f} million faces the first curve takes {first:.1f} "
        f"seconds, a further curve {another:.1f} seconds, and an update while a point is dragged "
        f"{1000.0 * dragged:.1f} milliseconds "
        "([by stage](../benchmarks/RESULTS.md#where-the-time-goes))."
    )


def _table(columns: dict[str, Times], digits: int) -> str:
    stages = next(iter(columns.values()))
    rows = [
        (
            stage,
            *(
                f"{values[stage]:,.{digits}f}" if values[stage] else "–"
                for values in columns.values()
            ),
        )
        for stage in stages
    ]
    return report.table(("stage", *columns), rows)


def _counted(mesh: Mesh) -> dict[str, Times]:
    """Function calls of a first curve, and of another one on the same Designer."""
    generator = np.random.default_rng(SEED)
    designer = nicmm.Designer(Mesh(mesh.vertices, mesh.faces))
    calls = 0

    def count(frame: object, event: str, argument: object) -> None:
        nonlocal calls
        calls += event in ("call", "c_call")

    counts = {}
    for kind in ("first", "another"):
        points = generator.choice(len(mesh.vertices), POINTS, replace=False)
        sys.setprofile(count)
        try:
            counts[kind], _ = _measured_by(lambda: calls, designer, points)
        finally:
            sys.setprofile(None)
    return counts


def _measured(mesh: Mesh) -> dict[str, dict[str, list[float]]]:
    """Times of all runs in milliseconds, by kind of run and stage."""
    generator = np.random.default_rng(SEED)
    runs: dict[str, list[Times]] = {"first": [], "another": [], "dragged": []}
    for _ in range(SETS):
        designer = nicmm.Designer(Mesh(mesh.vertices, mesh.faces))  # without cached values
        points = generator.choice(len(mesh.vertices), POINTS, replace=False)
        runs["first"].append(_timed(designer, points)[0])
        points = generator.choice(len(mesh.vertices), POINTS, replace=False)
        times, before = _timed(designer, points)
        runs["another"].append(times)
        for _ in range(DRAGS):
            points = _dragged(designer.mesh, points)
            times, before = _timed(designer, points, before)
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
    times, found = _measured_by(time.perf_counter, designer, points, start)
    return {stage: 1000.0 * value for stage, value in times.items()}, found


def _measured_by(
    clock: Callable[[], float],
    designer: nicmm.Designer,
    points: IntArray,
    start: nicmm.Design | None = None,
) -> tuple[Times, nicmm.Design]:
    """Increase of a clock in every stage of a design, and the design."""
    with _stopwatches(clock) as spent:
        started = clock()
        found = designer.design(points, order="shortest", start=start)
        total = clock() - started
    spent[REST] = total - sum(spent.values())
    spent[TOTAL] = total
    return spent, found


@contextmanager
def _stopwatches(clock: Callable[[], float]) -> Iterator[Times]:
    """Accumulate the increase of a clock in every stage."""
    spent = dict.fromkeys(STAGES, 0.0)

    def timed(stage: str, function: Any) -> Any:
        def wrapped(*arguments: Any, **named: Any) -> Any:
            started = clock()
            try:
                return function(*arguments, **named)
            finally:
                spent[stage] += clock() - started

        return wrapped

    with ExitStack() as patches:
        for stage, functions in STAGES.items():
            for module, name in functions:
                wrapped = timed(stage, getattr(module, name))
                patches.enter_context(mock.patch.object(module, name, wrapped))
        yield spent


def _bytes_a_vertex(faces: int, subdivisions: int) -> float:
    """Memory in bytes per vertex that the first curve on a mesh takes in a separate process."""
    with multiprocessing.get_context("spawn").Pool(1) as pool:
        return float(pool.apply(_growth, (faces, subdivisions)))


def _growth(faces: int, subdivisions: int) -> float:
    nicmm.design_curve(shapes.sphere(3), [0, 100, 200])  # loads what is loaded once per process
    mesh = shapes.creature(SEED, faces=faces, subdivisions=subdivisions)
    before = _resident()
    points = np.random.default_rng(SEED).choice(len(mesh.vertices), POINTS, replace=False)
    nicmm.design_curve(mesh, points, order="shortest")
    return max(0, _peak() - before) / len(mesh.vertices)


def _resident() -> int:
    """Memory in use now, in bytes."""
    with open("/proc/self/statm") as file:
        return int(file.read().split()[1]) * resource.getpagesize()


def _peak() -> int:
    """Peak memory of the process, in bytes."""
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    return peak if sys.platform == "darwin" else peak * 1024
