"""How often a design gives exactly one closed loop through all points, and how often by itself.

"By itself" is the paper's level set: no vertex had to keep the side that it has initially.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Sequence

import numpy as np

import nicmm_core as nicmm
from nicmm_core.geometry.array_types import IntArray
from nicmm_core.geometry.curve import is_one_curve
from nicmm_core.geometry.mesh import Mesh

from . import collections, report
from .evidence import Results
from .measures import bending
from .samples import random_sets
from .scale import Scale

TITLE = "One loop through all points (limit in section 5)"
WITHOUT = ("coarsening", "courses", "outputs", "relaxation", "splines")

SEED = 0
SETS = 2
METHOD = "nicmm-paper"

REFUSED, SEVERAL, NOT_FINITE = "refused", "several", "not finite"
BY_ITSELF, KEPT = "by itself", "kept"
"""Outcomes; the last one is one loop whose topology had to be held."""


def measure(scale: Scale) -> Results:
    """Measure on SHREC16 after two Loop subdivisions and on closed manifold meshes."""
    surfaces = collections.surfaces(scale, scale.choose(48, 2))
    sets = _designed(collections.label(scale), surfaces)
    if scale is not Scale.SMOKE:
        sets += _designed("closed manifold", collections.clean(scale.choose(36, 2)))
    return {"seed": SEED, "sets_a_mesh": SETS, "method": METHOD, "sets": sets}


def section(results: Results) -> str:
    """The outcomes on each collection."""
    header = (
        "meshes", "sets", "one loop", "by itself", "refused", "several", "not finite",
        "L ∮ κ_g² ds, quartiles", "iterations", "seconds",
    )  # fmt: skip
    rows = []
    for label in dict.fromkeys(each["collection"] for each in results["sets"]):
        rows.append(_row(label, [e for e in results["sets"] if e["collection"] == label]))
    return (
        f"Seed {results['seed']}, {results['sets_a_mesh']} sets of 3–5 random vertices a mesh, "
        f"shortest order, {results['method']}; iterations and seconds are medians.\n\n"
        + report.table(header, rows)
    )


def _designed(label: str, meshes: Iterable[tuple[str, Mesh]]) -> list[Results]:
    """What came of each set."""
    sets = []
    for name, mesh, points in random_sets(meshes, SETS, SEED):
        answer = _answer(name, mesh, points)
        sets.append({"collection": label, "mesh": name, **answer})
    return sets


def _answer(name: str, mesh: Mesh, points: IntArray) -> Results:
    try:
        design = nicmm.design_curve(mesh, points, order="shortest", method=METHOD)
    except nicmm.UnreachableError as error:
        print(f"  {name}: {error}", flush=True)
        return {"outcome": REFUSED, "bending": None, "iterations": None, "seconds": None}
    bends = None
    if not (np.isfinite(design.field).all() and np.isfinite(design.curves[0].points).all()):
        outcome = NOT_FINITE
    elif not is_one_curve(design.curves):
        outcome = SEVERAL
    else:
        outcome = KEPT if design.breaking_vertices else BY_ITSELF
        bends = round(bending(mesh, design.curves[0]), 4)
    print(f"  {name}: {outcome}, {design.iterations} it, {design.status.name}", flush=True)
    return {
        "outcome": outcome,
        "bending": bends,
        "iterations": design.iterations,
        "seconds": round(design.seconds, 3),
    }


def _row(label: str, sets: Sequence[Results]) -> tuple[object, ...]:
    counts = Counter(each["outcome"] for each in sets)
    bends = [each["bending"] for each in sets if each["bending"] is not None]
    designed = [each for each in sets if each["outcome"] != REFUSED]
    return (
        label,
        len(sets),
        counts[BY_ITSELF] + counts[KEPT],
        *(counts[outcome] for outcome in (BY_ITSELF, REFUSED, SEVERAL, NOT_FINITE)),
        " · ".join(f"{value:.0f}" for value in np.quantile(bends, [0.25, 0.5, 0.75])),
        f"{np.median([each['iterations'] for each in designed]):.0f}",
        f"{np.median([each['seconds'] for each in designed]):.2f}",
    )
