"""A control point is dragged: what going on from the last curve costs, and what it is worth."""

from __future__ import annotations

import importlib.util
from collections.abc import Iterable
from dataclasses import dataclass

import igl
import numpy as np

import nicmm_core as nicmm
from nicmm_core import shapes
from nicmm_core.geometry.array_types import IntArray
from nicmm_core.geometry.mesh import Mesh
from tests.oracles.checker import judge

from . import collections, report
from .measures import bending
from .peer_systems import later_signed_heat
from .peers import task_on
from .samples import random_sets
from .scale import Scale

SEED = 0
DRAGS = 5
"""Times that the first control point moves on to a neighbouring vertex."""

FINE_SUBDIVISIONS = 4
SAMPLES = 240
PEER_BODY = (812, 2)
"""Faces and subdivisions of the body on which signed heat is compared with: 13,000 faces."""

PEER_SETS = 10


@dataclass(frozen=True)
class Drag:
    """Seconds and iterations on one mesh.

    "First" is the first curve on a mesh, "another" one through other points on the same Designer,
    "dragged" the median of those after small moves, "rival" the variational method's.
    """

    first: float
    another: float
    dragged: float
    rival: float
    iterations: float
    bends: float
    faults: int


def run(scale: Scale) -> None:
    """Drag on the paper's resolution and on one with sixteen times as many faces."""
    coarse = _measured(collections.surfaces(scale, scale.choose(40, 4)), rival=True)
    if scale is Scale.SMOKE:
        fine = coarse
    else:
        meshes = collections.shrec16(scale.choose(8, 1), FINE_SUBDIVISIONS)
        fine = _measured(meshes, rival=False)
    ratio = _median(coarse, "dragged") / _median(coarse, "rival")
    first = _median(coarse, "first") / _median(coarse, "rival")
    growth = _median(fine, "dragged") / _median(coarse, "dragged")
    body = (
        f"Seed {SEED}, one set of 3–5 random vertices a mesh, shortest order; the first point then "
        f"moves to a neighbouring vertex {DRAGS} times. One process, medians over the meshes.\n\n"
        + report.table(
            (
                "meshes",
                "vertices",
                "first curve (ms)",
                "another on the same Designer",
                "dragged",
                "iterations",
                "variational",
                "bending, dragged / anew",
                "faults",
            ),  # fmt: skip
            [
                _row(f"{collections.label(scale)}, {len(coarse)}", coarse),
                _row(f"{len(fine)}, {FINE_SUBDIVISIONS} subdivisions", fine),
            ],
        )
        + f"\n\nA dragged curve takes {ratio:.3f} times as long as the variational method (goal "
        f"0.10) and a first one {first:.2f} times (goal 0.25). With sixteen times as many faces a "
        f"dragged curve takes {growth:.1f} times as long (goal 4)."
    )
    body += "\n\n" + _beside_signed_heat(scale)
    report.write_section("dragging", "Dragging a control point", body, scale)


def _beside_signed_heat(scale: Scale) -> str:
    """A dragged curve beside a later solve of potpourri3d's signed heat, on the same mesh."""
    if importlib.util.find_spec("potpourri3d") is None:
        return "potpourri3d is not installed, so its signed heat method is not measured."
    faces, subdivisions = (200, 1) if scale is Scale.SMOKE else PEER_BODY
    mesh = shapes.creature(SEED, faces=faces, subdivisions=subdivisions)
    generator = np.random.default_rng(SEED)
    ours, theirs = [], []
    for _ in range(scale.choose(PEER_SETS, 3)):
        points = generator.choice(len(mesh.vertices), 4, replace=False)
        ours.append(_dragged(mesh, points, rival=False).dragged)
        theirs.append(later_signed_heat(task_on(mesh, points)))
    ratio = np.median(ours) / np.median(theirs)
    return (
        f"On a generated body of {len(mesh.faces):,} faces, {len(ours)} sets of 4 points, a "
        f"dragged curve takes {1000 * np.median(ours):.0f} ms and a later solve of potpourri3d's "
        f"signed heat method, whose factorisations are kept, {1000 * np.median(theirs):.0f} ms by "
        f"the median: {ratio:.2f} (goal 1.0)."
    )


def _measured(meshes: Iterable[tuple[str, Mesh]], rival: bool) -> list[tuple[int, Drag]]:
    results = []
    for name, mesh, points in random_sets(meshes, 1, SEED):
        result = _dragged(mesh, points, rival)
        results.append((len(mesh.vertices), result))
        print(
            f"  {name}: first {1000 * result.first:.0f} ms, dragged {1000 * result.dragged:.0f}",
            flush=True,
        )
    return results


def _dragged(mesh: Mesh, points: IntArray, rival: bool) -> Drag:
    neighbours = igl.adjacency_list(mesh.faces)
    mesh = Mesh(mesh.vertices, mesh.faces)  # without anything cached
    designer = nicmm.Designer(mesh)
    designs = [designer.design(points, order="shortest")]
    faults = len(judge(mesh, designs[0], points, True, "shortest").faults)
    for _ in range(DRAGS):
        points = points.copy()
        points[0] = next(v for v in neighbours[points[0]] if v not in points)
        designs.append(designer.design(points, order="shortest", start=designs[-1]))
        faults += len(judge(mesh, designs[-1], points, True, "shortest").faults)
    anew = nicmm.Designer(mesh).design(points, order="shortest")
    generator = np.random.default_rng(SEED)
    others = generator.choice(np.flatnonzero(mesh.referenced), len(points), replace=False)
    another = designer.design(others, order="shortest")
    slow = np.nan
    if rival:
        slow = nicmm.design_curve(mesh, points, order="shortest", method="variational").seconds
    return Drag(
        first=designs[0].seconds,
        another=another.seconds,
        dragged=float(np.median([design.seconds for design in designs[1:]])),
        rival=slow,
        iterations=float(np.median([design.iterations for design in designs[1:]])),
        bends=bending(mesh, designs[-1].curves[0], SAMPLES)
        / bending(mesh, anew.curves[0], SAMPLES),
        faults=faults,
    )


def _median(results: list[tuple[int, Drag]], name: str) -> float:
    return float(np.median([getattr(result, name) for _, result in results]))


def _row(label: str, results: list[tuple[int, Drag]]) -> tuple[object, ...]:
    milliseconds = [
        f"{1000 * _median(results, name):.0f}" for name in ("first", "another", "dragged", "rival")
    ]
    rival = "–" if np.isnan(_median(results, "rival")) else milliseconds[3]
    return (
        label,
        f"{np.median([count for count, _ in results]):.0f}",
        *milliseconds[:3],
        f"{_median(results, 'iterations'):.0f}",
        rival,
        f"{_median(results, 'bends'):.2f}",
        sum(result.faults for _, result in results),
    )
