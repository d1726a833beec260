"""How often a design gives exactly one closed loop through all points, and how often by itself.

"By itself" is the paper's level set: no vertex had to keep the side that it has initially.
"""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

import nicmm_core as nicmm
from nicmm_core.geometry.curve import is_one_curve
from nicmm_core.geometry.mesh import Mesh

from . import collections, report
from .measures import bending
from .samples import random_sets
from .scale import Scale

SEED = 0
SETS = 2
METHOD = "nicmm-paper"


def run(scale: Scale) -> None:
    """Measure on SHREC16 after two Loop subdivisions and on closed manifold meshes."""
    rows = [_measured(collections.label(scale), collections.surfaces(scale, scale.choose(48, 2)))]
    if scale is not Scale.SMOKE:
        rows.append(_measured("closed manifold", collections.clean(scale.choose(36, 2))))
    header = (
        "meshes", "sets", "one loop", "by itself", "refused", "several", "not finite",
        "L ∮ κ_g² ds, quartiles", "iterations", "seconds",
    )  # fmt: skip
    body = (
        f"Seed {SEED}, {SETS} sets of 3–5 random vertices a mesh, shortest order, {METHOD}; "
        "iterations and seconds are medians.\n\n" + report.table(header, rows)
    )
    report.write_section(
        "one_loop", "One loop through all points (limit in section 5)", body, scale
    )


def _measured(label: str, meshes: Iterable[tuple[str, Mesh]]) -> tuple[object, ...]:
    outcomes, bends, times, iterations = [], [], [], []
    for name, mesh, points in random_sets(meshes, SETS, SEED):
        try:
            design = nicmm.design_curve(mesh, points, order="shortest", method=METHOD)
        except nicmm.UnreachableError as error:
            outcomes.append("refused")
            print(f"  {name}: {error}", flush=True)
            continue
        if not (np.isfinite(design.field).all() and np.isfinite(design.curves[0].points).all()):
            outcomes.append("not finite")
        elif not is_one_curve(design.curves):
            outcomes.append("several")
        else:
            outcomes.append("kept" if design.breaking_vertices else "by itself")
            bends.append(bending(mesh, design.curves[0]))
        times.append(design.seconds)
        iterations.append(design.iterations)
        print(f"  {name}: {outcomes[-1]}, {design.iterations} it, {design.status.name}", flush=True)
    by_itself = outcomes.count("by itself")
    return (
        label,
        len(outcomes),
        by_itself + outcomes.count("kept"),
        by_itself,
        outcomes.count("refused"),
        outcomes.count("several"),
        outcomes.count("not finite"),
        " · ".join(f"{value:.0f}" for value in np.quantile(bends, [0.25, 0.5, 0.75])),
        f"{np.median(iterations):.0f}",
        f"{np.median(times):.2f}",
    )
