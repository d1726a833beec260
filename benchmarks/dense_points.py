"""Whether a curve through many points of a fair curve is as fair as that curve."""

from __future__ import annotations

import contextlib
from dataclasses import replace

import numpy as np

import nicmm_core as nicmm
from nicmm_core.geometry.curve import SurfaceCurve
from nicmm_core.geometry.surface_points import SurfacePoints

from . import report
from .course_requests import SEED, answered, energy, every_request
from .evidence import DESIGN, Results
from .scale import Scale

TITLE = "Many control points"
ROOMS = DESIGN

COUNTS = (6, 9, 14, 20)
"""Numbers of control points."""

JITTER = 0.25
"""Greatest distance of a point from its place between evenly spaced ones, relative to spacing."""

WORSE, FAR_WORSE = 1.02, 1.1
"""Relative energies above which curves are counted."""


def measure(scale: Scale) -> Results:
    """Design curves through points of designed curves, with and without these as the start."""
    designs = []
    for request in every_request(scale):
        designer = nicmm.Designer(request.mesh)
        with contextlib.suppress(nicmm.UnreachableError):
            first = designer.design(request.points, closed=request.closed, order="shortest")
            generator = np.random.default_rng([SEED, request.number, int(request.closed)])
            for count in COUNTS:
                curve = _with_points(first.curves[0], count, generator)
                found = {"points": count, **_compared(designer, curve)}
                designs.append({"curve": request.name, "closed": request.closed, **found})
                print(f"  {request.name}: {found}", flush=True)
    return {"seed": SEED, "designs": designs}


def _with_points(curve: SurfaceCurve, count: int, generator: np.random.Generator) -> SurfaceCurve:
    """A curve with another number of control points, about evenly spaced among its points."""
    n = len(curve.faces)
    even = np.linspace(0, n - 1, count, endpoint=not curve.closed)
    moved = even + generator.uniform(-JITTER, JITTER, count) * n / count
    at = np.unique(np.clip(np.round(moved), 0, n - 1).astype(np.int64))
    return replace(curve, control_index=at)


def _compared(designer: nicmm.Designer, curve: SurfaceCurve) -> Results:
    """Energy of the design through the control points of a curve, relative to this curve.

    The curve is relaxed before it is compared.
    """
    at = curve.control_index
    points = SurfacePoints(curve.faces[at], curve.barycentric[at])
    found = designer.design(points, closed=curve.closed)
    kept = designer.design(points, closed=curve.closed, start=curve)
    ours, other = answered(found), answered(kept)
    scale = other.length
    relative = energy(ours.bending, ours.length, scale) / energy(other.bending, scale, scale)
    return {"relative": round(relative, 4), "seconds": round(found.seconds, 3)}


def section(results: Results) -> str:
    """A row for each kind of curve and number of points."""
    rows = []
    for closed in (True, False):
        for count in COUNTS:
            chosen = [
                each
                for each in results["designs"]
                if each["closed"] == closed and each["points"] == count
            ]
            relative = np.array([each["relative"] for each in chosen])
            rows.append(
                (
                    "closed" if closed else "open",
                    count,
                    len(chosen),
                    f"{np.exp(np.log(relative).mean()):.3f}" if len(chosen) else "",
                    int((relative > WORSE).sum()),
                    int((relative > FAR_WORSE).sum()),
                    f"{relative.max():.2f}" if len(chosen) else "",
                )
            )
    header = (
        "curve", "points", "designs", "energy: geometric mean", f"above {WORSE}",
        f"above {FAR_WORSE}", "greatest",
    )  # fmt: skip
    return (
        "A curve through points of a fair curve should be as fair. Curves are designed through "
        "3–5 random vertices as in the measurement of courses. Points about evenly spaced on each "
        "of them, randomly moved by up to a quarter of their distance, are the control points of "
        "another design. Its energy is divided by that of the first curve, relaxed through the "
        "same points. A value below 1 means that the new curve is fairer. The paper has no "
        "corresponding measurement.\n\n" + report.table(header, rows)
    )


def summary(results: Results) -> str:
    """What the documents say of it."""
    parts = []
    for closed in (True, False):
        relative = np.array(
            [each["relative"] for each in results["designs"] if each["closed"] == closed]
        )
        worse = np.mean(relative > FAR_WORSE)
        parts.append(
            f"{100 * worse:.0f} % of {len(relative)} {'closed' if closed else 'open'} curves"
        )
    return report.item(
        f"Through {COUNTS[0]} to {COUNTS[-1]} points that lie on a fair curve, another course is "
        f"sometimes taken: the energy is more than {100 * (FAR_WORSE - 1):.0f} % above that of "
        f"the given curve for {' and '.join(parts)} "
        "([measured](../benchmarks/RESULTS.md#many-control-points))."
    )
