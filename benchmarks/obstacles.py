"""Discs painted on the free curve: whether the next one stays out of them, and at what price."""

from __future__ import annotations

import itertools
from collections import Counter

import numpy as np

import nicmm_core as nicmm
from nicmm_core.geometry.array_types import FloatArray, IntArray
from nicmm_core.geometry.curve import SurfaceCurve
from nicmm_core.geometry.mesh import Mesh
from tests.oracles.checker import judge

from . import collections, report
from .measures import bending
from .samples import random_sets
from .scale import Scale

SEED = 3
RADIUS = 0.04
"""Of the discs, in diagonals."""

SAMPLES = 128


def run(scale: Scale) -> None:
    """Obstacles of weight 1 on closed meshes and on people and animals."""
    if scale is Scale.SMOKE:
        meshes = collections.creatures(2)
    else:
        some = collections.bodies(scale.choose(12, 2))
        meshes = itertools.chain(collections.clean(scale.choose(36, 4)), some)
    outcomes: Counter[str] = Counter()
    bends, times = [], []
    for name, mesh, points in random_sets(meshes, 1, SEED):
        free = nicmm.design_curve(mesh, points, order="shortest")
        weights = _disc(mesh, free.curves[0])
        try:
            design = nicmm.design_curve(mesh, points, order="shortest", obstacles=weights)
        except nicmm.UnreachableError as error:
            outcomes["said to leave no way"] += 1
            print(f"  {name}: {error}", flush=True)
            continue
        curve = design.curves[0]
        faults = judge(mesh, design, points, True, "shortest").faults
        entered = _length_inside(mesh, curve, weights) > 0.0
        outcomes["entered or at fault" if entered or faults else "gone round"] += 1
        bends.append(bending(mesh, curve, SAMPLES) / bending(mesh, free.curves[0], SAMPLES))
        times.append(design.seconds / free.seconds)
        print(f"  {name}: {'entered' if entered else 'kept out'} {faults or ''}", flush=True)
    rows = [(what, count) for what, count in sorted(outcomes.items())]
    body = (
        f"Seed {SEED}, one set of 3–5 random vertices a mesh, shortest order; discs of weight 1, "
        f"{2 * RADIUS:.0%} of the diagonal across, round the point of the free curve that is "
        "farthest from its control points. A curve has entered if it has any length in faces "
        "whose three corners are painted; faults are those of the guarantee's judge.\n\n"
        + report.table(("outcome", "sets"), rows)
        + f"\n\nRelative to the free curve, quartiles: bending {_quartiles(bends)}, time "
        f"{_quartiles(times)}."
    )
    report.write_section("obstacles", "Obstacles", body, scale)


def _disc(mesh: Mesh, curve: SurfaceCurve) -> FloatArray:
    controls = curve.points[curve.control_index]
    apart = np.linalg.norm(curve.points[:, None] - controls, axis=2).min(axis=1)
    away = np.linalg.norm(mesh.vertices - curve.points[apart.argmax()], axis=1)
    return (away < RADIUS * mesh.diagonal).astype(np.float64)


def _length_inside(mesh: Mesh, curve: SurfaceCurve, weights: FloatArray) -> float:
    lengths = np.linalg.norm(np.roll(curve.points, -1, axis=0) - curve.points, axis=1)
    faces: IntArray = mesh.faces[curve.faces]
    return float(lengths[(weights[faces] >= 1.0).all(axis=1)].sum())


def _quartiles(ratios: list[float]) -> str:
    return " · ".join(f"{value:.2f}" for value in np.quantile(ratios, [0.25, 0.5, 0.75]))
