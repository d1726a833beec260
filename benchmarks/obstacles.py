"""Measures whether a curve avoids an obstacle on its free course, and what the detour costs."""

from __future__ import annotations

import itertools
from collections import Counter
from collections.abc import Sequence

import numpy as np

import nicmm_core as nicmm
from nicmm_core.geometry.array_types import FloatArray, IntArray
from nicmm_core.geometry.curve import SurfaceCurve
from nicmm_core.geometry.mesh import Mesh
from tests.oracles.checker import judge

from . import collections, report
from .evidence import DESIGN, Results
from .measures import bending
from .samples import random_sets
from .scale import Scale

TITLE = "Obstacles (Fig. 14)"
ROOMS = DESIGN

SEED = 3
RADIUS = 0.04
"""Radius of the discs, in diagonals."""

SAMPLES = 128

AVOIDS = "avoids the obstacle"


def measure(scale: Scale) -> Results:
    """Design curves with an obstacle of weight 1, on closed meshes, people and animals."""
    if scale is Scale.SMOKE:
        meshes = collections.creatures(2)
    else:
        some = collections.bodies(scale.choose(12, 2))
        meshes = itertools.chain(collections.clean(scale.choose(36, 4)), some)
    return {
        "seed": SEED,
        "radius": RADIUS,
        "sets": [
            {"mesh": name, "detour": _detour(name, mesh, points)}
            for name, mesh, points in random_sets(meshes, 1, SEED)
        ],
    }


def section(results: Results) -> str:
    """Number of curves that avoid their obstacle, and the costs."""
    outcomes = Counter(_outcome(each["detour"]) for each in results["sets"])
    found = [each["detour"] for each in results["sets"] if each["detour"] is not None]
    bends, times = (_quartiles([each[name] for each in found]) for name in ("bending", "time"))
    return (
        "A disc was painted as an obstacle on each free curve, and the table counts whether a new "
        "curve through the same points avoids it. The disc has weight 1 and a diameter of "
        f"{200 * results['radius']:g} % of the bounding box diagonal, around the point of the free "
        "curve that is farthest from its control points. A curve *enters* it if any part of the "
        "curve lies in faces with three painted corners; it is *faulty* if the independent checker "
        "finds that it is not one simple curve through its points in order. There are "
        f"{len(results['sets'])} sets of 3–5 random vertices, one per mesh (shortest order, seed "
        f"{results['seed']}).\n\n"
        + report.table(("outcome", "sets"), sorted(outcomes.items()))
        + f"\n\n{_finding(results['sets'])} Relative to the free curve, the quartiles of bending "
        f"are {bends}, and those of time {times}."
    )


def summary(results: Results) -> str:
    """What the documents say of it."""
    found = [each["detour"] for each in results["sets"] if each["detour"] is not None]
    good = sum(not each["entered"] and not each["faults"] for each in found)
    text = (
        "`python -m benchmarks obstacles` paints discs of "
        f"{200 * results['radius']:g} % of the diagonal on the free curve of "
        f"{len(results['sets'])} third-party meshes: {good} curves go around the disc, each as one "
        "simple loop without any length inside"
    )
    if good < len(found):
        text += f"; {len(found) - good} do not"
    text += "."
    if len(found) < len(results["sets"]):
        closed_off = len(results["sets"]) - len(found)
        text += f" On {closed_off} of the meshes the disc closes off a limb, and the error says so."
    return report.paragraph(text)


def _detour(name: str, mesh: Mesh, points: IntArray) -> Results | None:
    """Curve with a disc on the free one, relative to it; None if an error says there is none."""
    free = nicmm.design_curve(mesh, points, order="shortest")
    weights = _disc(mesh, free.curves[0])
    try:
        design = nicmm.design_curve(mesh, points, order="shortest", obstacles=weights)
    except nicmm.UnreachableError as error:
        print(f"  {name}: {error}", flush=True)
        return None
    curve = design.curves[0]
    faults = list(judge(mesh, design, points, True, "shortest").faults)
    entered = _length_inside(mesh, curve, weights) > 0.0
    print(f"  {name}: {'entered' if entered else 'kept out'} {faults or ''}", flush=True)
    bends = [bending(mesh, each, SAMPLES) for each in (curve, free.curves[0])]
    return {
        "entered": entered,
        "faults": faults,
        "bending": round(bends[0] / bends[1], 6),
        "time": round(design.seconds / free.seconds, 4),
    }


def _outcome(found: Results | None) -> str:
    if found is None:
        return "error: no way around"
    return "enters or is faulty" if found["entered"] or found["faults"] else AVOIDS


def _finding(sets: Sequence[Results]) -> str:
    """Whether the curves avoid their obstacles, as in Fig. 14."""
    found = [each["detour"] for each in sets if each["detour"] is not None]
    avoiding = sum(_outcome(each) == AVOIDS for each in found)
    verdict = (
        "agrees with the paper"
        if avoiding == len(found)
        else "agrees with the paper only on those"
        if avoiding
        else "contradicts the paper"
    )
    return (
        f"{avoiding} of the {len(found)} curves avoid their obstacle, which {verdict} (Fig. 14 "
        "shows one curve, without numbers)."
    )


def _disc(mesh: Mesh, curve: SurfaceCurve) -> FloatArray:
    controls = curve.points[curve.control_index]
    apart = np.linalg.norm(curve.points[:, None] - controls, axis=2).min(axis=1)
    away = np.linalg.norm(mesh.vertices - curve.points[apart.argmax()], axis=1)
    return (away < RADIUS * mesh.diagonal).astype(np.float64)


def _length_inside(mesh: Mesh, curve: SurfaceCurve, weights: FloatArray) -> float:
    lengths = np.linalg.norm(np.roll(curve.points, -1, axis=0) - curve.points, axis=1)
    faces: IntArray = mesh.faces[curve.faces]
    return float(lengths[(weights[faces] >= 1.0).all(axis=1)].sum())


def _quartiles(ratios: Sequence[float]) -> str:
    return " · ".join(f"{value:.2f}" for value in np.quantile(ratios, [0.25, 0.5, 0.75]))
