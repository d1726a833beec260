"""Measures how often `nicmm` gives one closed loop through all points (section 5, Fig. 16).

An outcome "by itself" means that every step of the fit kept one loop. In all other cases some
vertices had to be held, which the paper does not do.
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
from .evidence import NETWORK, Results
from .measures import bending
from .samples import random_sets
from .scale import Scale

TITLE = "One loop through all points (section 5, Fig. 16)"
ROOMS = NETWORK

SEED = 0
SETS = 2
METHOD = "nicmm"

REFUSED, SEVERAL, NOT_FINITE = "refused", "several", "not finite"
BY_ITSELF, KEPT = "by itself", "kept"
"""Outcomes; `KEPT` is one loop for which some vertices had to be held."""


def measure(scale: Scale) -> Results:
    """Design curves on SHREC16, Loop-subdivided twice, and on closed manifold meshes."""
    surfaces = collections.surfaces(scale, scale.choose(48, 2))
    sets = _designed(collections.label(scale), surfaces)
    if scale is not Scale.SMOKE:
        sets += _designed("closed manifold", collections.clean(scale.choose(36, 2)))
    return {"seed": SEED, "sets_a_mesh": SETS, "method": METHOD, "sets": sets}


def section(results: Results) -> str:
    """Outcomes on each collection, and a comparison with the paper's limitation."""
    header = (
        "meshes", "sets", "one loop", "by itself", "refused", "several", "not finite",
        "L ∮ κ_g² ds, quartiles", "iterations, median", "seconds, median",
    )  # fmt: skip
    rows = []
    for label in dict.fromkeys(each["collection"] for each in results["sets"]):
        rows.append(_row(label, [e for e in results["sets"] if e["collection"] == label]))
    return (
        f"The table counts how often `{results['method']}` gives exactly one closed loop through "
        f"all control points, for {results['sets_a_mesh']} sets of 3–5 random vertices per mesh "
        f"(shortest order, seed {results['seed']}). Each row is a collection of meshes. *By "
        "itself* counts the loops for which every step kept one loop through all points; for the "
        "other loops some vertices had to be held, because another sign of φ there would have "
        "split the loop or detached it from a point. The remaining outcomes are failures: "
        "*refused* (no simple path through the points was found), *several* curves, and values "
        "that are *not finite*.\n\n"
        f"{report.table(header, rows)}\n\n{_finding(results['sets'])}"
    )


def _designed(label: str, meshes: Iterable[tuple[str, Mesh]]) -> list[Results]:
    """Outcomes of all sets of one collection."""
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


def _finding(sets: Sequence[Results]) -> str:
    """Whether level sets without repair have the problem that the paper reports."""
    counts = Counter(each["outcome"] for each in sets)
    alone = counts[BY_ITSELF]
    text = (
        "The paper names the lack of control over the topology as a limitation (section 5, "
        f"Fig. 16). On {alone} of {len(sets)} sets every step kept one loop by itself, "
    )
    text += (
        "which agrees with the paper; "
        if alone < len(sets)
        else "so the limitation does not show on these sets; "
    )
    return text + f"with vertices held, {alone + counts[KEPT]} of {len(sets)} curves are one loop."
