"""A dab of paint beside a curve: how far the rest of the curve moves when a design goes on."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from scipy.spatial import cKDTree

import nicmm_core as nicmm
from nicmm_core.geometry.array_types import FloatArray
from nicmm_core.geometry.curve import SurfaceCurve, resample
from nicmm_core.geometry.mesh import Mesh

from . import collections, report
from .evidence import DESIGN, Results
from .samples import random_sets
from .scale import Scale

TITLE = "A dab of paint beside a curve"
ROOMS = DESIGN

SEED = 25

RADIUS = 0.04
"""Radius of a dab, relative to the diagonal."""

BESIDE = {"alignment": 0.03, "obstacles": 0.05}
"""Distance of the centre of a dab from the curve: inside an obstacle no design can go on."""

FAR = 0.25
"""Distance from the centre of a dab, relative to the diagonal, from which the rest begins."""

UNMOVED = 0.005
"""Distance, relative to the diagonal, by which the rest may move."""

DABS = 2
"""Dabs of each kind beside each curve."""

SAMPLES = 2_000


def measure(scale: Scale) -> Results:
    """Paint beside curves, go on from them and see how far what is far away moves."""
    surfaces = collections.surfaces(scale, scale.choose(24, 4, 1))
    answers = []
    for name, mesh, points in random_sets(surfaces, 1, SEED):
        designer = nicmm.Designer(mesh)
        before = designer.design(points, order="shortest")
        generator = np.random.default_rng([SEED, len(answers)])
        for kind, centre in _centres(mesh, before.curves[0], generator):
            weights = _dab(mesh, centre)
            found = {"mesh": name, "kind": kind, "rest": None}
            try:
                after = designer.design(points, order="shortest", start=before, **{kind: weights})
            except nicmm.CurveError:
                answers.append({**found, "outcome": "refused"})
                continue
            moved = _moved(before.curves[0], after.curves[0], centre, mesh.diagonal)
            answers.append({**found, "outcome": "designed", **moved})
        print(f"  {name}: {[answer.get('rest') for answer in answers[-4:]]}", flush=True)
    return {"seed": SEED, "meshes": collections.label(scale), "answers": answers}


def section(results: Results) -> str:
    """How far the rest of the curves moved."""
    rows = []
    for kind in BESIDE:
        answers = [each for each in results["answers"] if each["kind"] == kind]
        rest = np.array([each["rest"] for each in answers if each["rest"] is not None])
        near = [each["near"] for each in answers if each["rest"] is not None]
        percentiles = np.percentile(rest, [50, 90, 100]) if len(rest) else []
        rows.append(
            (
                kind,
                len(answers),
                sum(each["outcome"] == "refused" for each in answers),
                f"{100 * np.mean(rest <= UNMOVED):.0f} %" if len(rest) else "–",
                *(f"{100 * value:.2g} %" for value in percentiles),
                f"{100 * np.median(near):.2g} %" if near else "–",
            )
        )
    header = (
        "dab of", "dabs", "refused", f"rest within {100 * UNMOVED:g} % (goal 95 %)",
        "rest: median", "90 %", "greatest", "near the dab: median",
    )  # fmt: skip
    return (
        "The table shows how much of a curve moves when a small region is painted far from it, "
        "starting from the curve before (`start=`). Each row is a kind of map. A round dab with a "
        f"radius of {100 * RADIUS:g} % of the diagonal is painted beside a closed curve through "
        "3–5 random vertices in the shortest order, with several dabs per mesh "
        f"({results['meshes']}; seed {results['seed']}). The *rest* is the part of the curve at "
        f"least {100 * FAR:g} % of the diagonal away from the dab. Distances are the greatest ones "
        "from the curve before to the curve after, relative to the diagonal. The paper has no "
        "corresponding measurement.\n\n" + report.table(header, rows)
    )


def _centres(
    mesh: Mesh, curve: SurfaceCurve, generator: np.random.Generator
) -> Iterator[tuple[str, FloatArray]]:
    """Kinds of dabs and their centres: vertices at about the wanted distance from the curve."""
    to_curve = cKDTree(resample(curve.points, SAMPLES, curve.closed)[0]).query(mesh.vertices)[0]
    for kind, beside in BESIDE.items():
        nearest = np.argsort(np.abs(to_curve - beside * mesh.diagonal), kind="stable")
        yield from (
            (kind, mesh.vertices[vertex])
            for vertex in generator.choice(nearest[: len(nearest) // 20], DABS, replace=False)
        )


def _dab(mesh: Mesh, centre: FloatArray) -> FloatArray:
    """Weights, (V,), that fall from 1 at the centre to 0 at the radius."""
    away = np.linalg.norm(mesh.vertices - centre, axis=1) / (RADIUS * mesh.diagonal)
    weights: FloatArray = np.clip(1.0 - away**2, 0.0, None)
    return weights


def _moved(
    before: SurfaceCurve, after: SurfaceCurve, centre: FloatArray, diagonal: float
) -> Results:
    """Greatest distances of the far and the near part to the curve after, over the diagonal."""
    old, new = (resample(each.points, SAMPLES, each.closed)[0] for each in (before, after))
    away = cKDTree(new).query(old)[0] / diagonal
    far = np.linalg.norm(old - centre, axis=1) >= FAR * diagonal
    greatest = [float(part.max()) if len(part) else None for part in (away[far], away[~far])]
    rest, near = (None if value is None else round(value, 6) for value in greatest)
    return {"rest": rest, "near": near}
