"""Noisy strokes: how many control points follow them, how closely, and the time to find these."""

from __future__ import annotations

import time
from itertools import chain
from typing import Any

import numpy as np
from scipy.spatial import cKDTree

import nicmm_core as nicmm
from nicmm_core.geometry.array_types import FloatArray, IntArray
from nicmm_core.geometry.curve import resample
from nicmm_core.geometry.mesh import Mesh

from . import collections, report
from .evidence import DESIGN, Results
from .samples import random_sets
from .scale import Scale

TITLE = "Strokes"
ROOMS = (*DESIGN, "strokes")

SEED = 53

SAMPLES = 300
"""Points of a stroke."""

MOST = SAMPLES // 20
"""Control points that are allowed: half of those that every tenth sample would need."""

NOISE = 0.01
"""Greatest distance of a sample from its curve, relative to one of the lengths below."""

WITHIN = 2.0
"""Tolerance, relative to the noise."""

OF_DIAGONAL, OF_LENGTH = "diagonal of the mesh", "length of the curve"

FINE = 0.01
"""Distance of the points between which distances of lines are measured, in tolerances."""

FINEST = 100_000
"""Greatest number of these points on a line."""

FACES, SECONDS = 20_000, 1.0
"""Processor time that a stroke may take on a mesh with so many faces at most."""


def measure(scale: Scale) -> Results:
    """Fit noisy samples of designed curves, open and closed, on different meshes."""
    surfaces = collections.surfaces(scale, scale.choose(20, 4, 1))
    if scale is not Scale.SMOKE:
        others = (collections.clean(scale.choose(12, 1)), collections.bodies(scale.choose(8, 1)))
        surfaces = chain(surfaces, *others, collections.creatures(scale.choose(4, 1)))
    fits: list[dict[str, Any]] = []
    for number, (name, mesh, points) in enumerate(random_sets(surfaces, 1, SEED)):
        for closed in (False, True):
            for relative_to in (OF_DIAGONAL, OF_LENGTH):
                found = _fit(mesh, points, closed, relative_to, number)
                if found is not None:
                    fits.append({"mesh": name, "faces": len(mesh.faces), **found})
                    print(f"  {name}: {found}", flush=True)
    return {"seed": SEED, "fits": fits}


def _fit(
    mesh: Mesh, points: IntArray, closed: bool, relative_to: str, number: int
) -> dict[str, Any] | None:
    """Fit noisy samples of the curve through points; None if there is no such curve."""
    try:
        curve = nicmm.design_curve(mesh, points, closed=closed, order="shortest").curves[0]
    except (nicmm.UnreachableError, nicmm.ControlPointError):
        return None
    noise = NOISE * (mesh.diagonal if relative_to == OF_DIAGONAL else curve.length)
    tolerance = WITHIN * noise
    samples, _ = resample(curve.points, SAMPLES, closed)
    stroke = samples + noise * _in_ball(SAMPLES, np.random.default_rng([SEED, number]))
    found: dict[str, Any] = {"closed": closed, "noise": relative_to}
    fresh = Mesh(mesh.vertices, mesh.faces)  # without what has been computed for the curve
    begun = time.process_time()
    try:
        fitted = nicmm.fit_stroke(fresh, stroke, tolerance, closed=closed)
    except nicmm.NicmmError as error:
        return {**found, "error": str(error)}
    seconds = time.process_time() - begun
    design = nicmm.design_curve(mesh, fitted, closed=closed)
    return {
        **found,
        "points": len(fitted),
        "away": round(_farthest(design.curves[0], stroke, tolerance) / tolerance, 4),
        "seconds": round(seconds, 3),
        "again": round(design.seconds, 3),
    }


def _in_ball(count: int, generator: np.random.Generator) -> FloatArray:
    """Random points, evenly distributed in the unit ball, (count, 3)."""
    directions = generator.normal(size=(count, 3))
    radii = np.cbrt(generator.random((count, 1)))
    inside: FloatArray = radii * directions / np.linalg.norm(directions, axis=1, keepdims=True)
    return inside


def _farthest(curve: nicmm.SurfaceCurve, stroke: FloatArray, tolerance: float) -> float:
    """Greatest distance between a curve and a stroke, in both directions."""
    lines = []
    for line in (curve.points, stroke):
        ends = np.concatenate([line, line[:1]]) if curve.closed else line
        length = np.linalg.norm(np.diff(ends, axis=0), axis=1).sum()
        count = int(np.clip(length / (FINE * tolerance), len(line), FINEST))
        lines.append(resample(line, count, curve.closed)[0])
    one, other = lines
    return float(max(cKDTree(one).query(other)[0].max(), cKDTree(other).query(one)[0].max()))


def section(results: Results) -> str:
    """A row for each kind of stroke, and the fits that fail."""
    rows = []
    for relative_to in (OF_DIAGONAL, OF_LENGTH):
        for closed in (False, True):
            chosen = [
                each
                for each in results["fits"]
                if each["noise"] == relative_to and each["closed"] == closed
            ]
            rows.append((relative_to, "closed" if closed else "open", *_row(chosen)))
    header = (
        "noise: 1 % of",
        "strokes",
        "number",
        "not fitted",
        "beyond the tolerance",
        f"more than {MOST} points",
        "points: median",
        "greatest",
        f"seconds, up to {FACES:,} faces: median",
        "greatest",
        f"above {SECONDS:g} s",
    )
    return (
        f"Designed curves through 3 to 5 random points, sampled at {SAMPLES} points, each of which "
        "is moved by a random vector no longer than the noise. The tolerance is twice the noise. "
        f"At most {MOST} control points should be found, half of every tenth sample. The distance "
        "to the stroke is measured on the curve that `design_curve` then makes, in both "
        "directions. Processor time includes everything that depends on the mesh.\n\n"
        + report.table(header, rows)
        + "\n\nThe paper has no corresponding measurement."
    )


def summary(results: Results) -> str:
    """What the documents say of it."""
    fits = results["fits"]
    done = [each for each in fits if "error" not in each]
    within = [each for each in done if each["away"] <= 1.0]
    small = [each["seconds"] for each in done if each["faces"] <= FACES]
    slow = sum(each > SECONDS for each in small)
    points, seconds = (
        report.listed(
            f"{np.median([each[name] for each in done if each['closed'] is closed]):.{digits}f} "
            f"for {kind} ones"
            for kind, closed in (("open", False), ("closed", True))
        )
        for name, digits in (("points", 0), ("seconds", 1))
    )
    return report.paragraph(
        f"`python -m benchmarks strokes` fits {SAMPLES} samples of random designed curves, each "
        f"moved by up to {100 * NOISE:g} % of the curve's length or of the mesh's diagonal, with a "
        f"tolerance of twice that: {len(within)} of {len(fits)} strokes are fitted. The median "
        f"number of points is {points}, and the median time in seconds {seconds}. Below "
        f"{FACES:,} faces {slow} of {len(small)} strokes take more than {SECONDS:g} s, at most "
        f"{max(small):.0f} s. Most of the time is that of designing the curve, so strokes that "
        "wind around limbs, or lie on rough surfaces, take longest."
    )


def _row(fits: list[dict[str, Any]]) -> tuple[str | int, ...]:
    """The columns of a row after its name."""
    done = [each for each in fits if "error" not in each]
    points = [each["points"] for each in done] or [0]
    seconds = [each["seconds"] for each in done if each["faces"] <= FACES] or [0.0]
    return (
        len(fits),
        len(fits) - len(done),
        sum(each["away"] > 1.0 for each in done),
        sum(each["points"] > MOST for each in done),
        f"{np.median(points):g}",
        max(points),
        f"{np.median(seconds):.2f}",
        f"{max(seconds):.2f}",
        sum(each > SECONDS for each in seconds),
    )
