"""Measures curves on meshes with nearly degenerate faces (section 4.6; Fig. 10, 11, 12 top)."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

import nicmm_core as nicmm
from nicmm_core.geometry.array_types import IntArray
from nicmm_core.geometry.curve import SurfaceCurve, is_one_curve
from nicmm_core.geometry.mesh import Mesh
from tests.oracles.distances import distances
from tests.oracles.perturbation import (
    GREATEST_FRACTION,
    LEAST_ANGLE,
    LEAST_FRACTION,
    angles,
    perturbed,
)

from . import collections, plots, renders, report
from .evidence import EVERY_METHOD, Results
from .measures import bending
from .methods import METHODS
from .resolution import REMARKABLE
from .samples import random_sets
from .scale import Scale

TITLE = "Degraded meshes (Fig. 10, 11, top of Fig. 12)"
ROOMS = EVERY_METHOD

SEED = 11

SEVERITIES = {Scale.FULL: (32, 8, 2, 1), Scale.QUICK: (8, 1), Scale.SMOKE: (8,)}
"""n in "one triangle for every n triangles" of the paper, from mild to severe."""

THIN = 5.0
"""Angle in degrees; faces with a smaller angle are counted."""

PLOT = "degraded.png"

CURVES = "degraded_curves.png"
"""File name of the picture of the first mesh."""


def measure(scale: Scale) -> Results:
    """Perturb meshes increasingly, and compare each method with its own curve on the clean mesh."""
    severities = (0, *SEVERITIES[scale])
    pictures: list[renders.Picture] = []
    names: list[str] = []
    sets = []
    surfaces = collections.surfaces(scale, scale.choose(12, 2))
    for name, clean_mesh, points in random_sets(surfaces, 1, SEED):
        names.append(name)
        clean: dict[str, SurfaceCurve | None] = {}
        for n in severities:
            mesh, moved = _mesh(clean_mesh, n, len(names), points)
            answers, shown = {}, {}
            for method in METHODS:
                status, curve = _asked(f"{name}, n = {n}", mesh, points, method)
                clean.setdefault(method, curve)
                answers[method] = _answer(status, mesh, curve, clean[method])
                shown[method] = curve
            sets.append({"mesh": name, "n": n, **_quality(mesh), "answers": answers})
            if len(names) == 1:
                pictures.append(_picture(n, moved, mesh, shown))
    return {
        "seed": SEED,
        "collection": collections.label(scale),
        "meshes": names,
        "methods": list(METHODS),
        "severities": list(severities),
        "fractions": [LEAST_FRACTION, GREATEST_FRACTION],
        "least_angle": LEAST_ANGLE,
        "thin": THIN,
        "sets": sets,
        "picture": _rendered(pictures, scale),
    }


def section(results: Results) -> str:
    """Outcome of each method at each severity, and whether it agrees with the paper."""
    names = results["meshes"]
    least, greatest = results["fractions"]
    return (
        "Meshes were degraded as in section 4.6 of the paper, to see whether each method still "
        "gives a curve and how far the curve moves. Each row is a severity and a method. Its "
        "columns are the smallest angle of the mesh and the share of thin faces; the number of "
        "meshes with one finite curve through all points; the number on which the method diverged; "
        "mean and greatest distance to the curve of the same method on the clean mesh, in percent "
        "of the bounding box diagonal; and the bending. Angles, shares, distances and bending are "
        f"medians over {len(names)} meshes, with one set of 3–5 random vertices per mesh (shortest "
        f"order, seed {results['seed']}). For the perturbation, one face in every n is chosen at "
        f"random, and one of its corners moves perpendicularly to the opposite edge, by {least:g} "
        f"to {greatest:g} of the length of that edge. A move that causes an angle below "
        f"{results['least_angle']:g}° or brings the vertex too close to another is discarded. "
        f"Control points do not move. Meshes ({results['collection']}): {report.listed(names)}."
        f"\n\n{_table(results)}\n\n{_findings(results)}\n\n"
        + report.figure(PLOT, "Greatest distance to the curve of the same method on the clean mesh")
        + f"\n\n{_shown_picture(results['picture'])}"
    )


def summary(results: Results) -> str:
    """What the documents say of it."""
    means = [
        np.median([s["answers"]["elastic"]["offset"][0] for s in results["sets"] if s["n"] == n])
        for n in results["severities"]
        if n
    ]
    return report.item(
        "The curve on a degraded mesh is smooth too, but not always the same: by severity, the "
        f"median of its mean distance from the clean mesh's curve is {min(means):.1f} to "
        f"{max(means):.1f} % of the diagonal "
        "([measured](../benchmarks/RESULTS.md#what-moves-a-curve-on-degraded-meshes))."
    )


def draw(results: Results, folder: Path) -> None:
    """Plot the distances to the curves on the clean meshes."""
    methods = results["methods"]
    figure, axes = plots.labelled(
        "Distance to the curve on the clean mesh",
        "perturbed faces",
        "greatest distance, % of the diagonal",
    )
    perturbations = [n for n in results["severities"] if n]
    width = 0.8 / len(methods)
    for number, method in enumerate(methods):
        colour = plots.METHOD_COLOURS[method]
        for place, n in enumerate(perturbations):
            offsets = _greatest(_answers(results, n, method))
            if offsets:
                axes.boxplot(
                    [offsets],
                    positions=[place + (number - 0.5 * (len(methods) - 1)) * width],
                    widths=0.8 * width,
                    patch_artist=True,
                    boxprops={"facecolor": colour, "alpha": 0.6},
                    medianprops={"color": "black"},
                )
        axes.plot([], [], color=colour, linewidth=8, alpha=0.6, label=method)
    axes.set_xticks(range(len(perturbations)), [_name(n) for n in perturbations])
    axes.set_xlim(-0.6, len(perturbations) - 0.4)
    axes.set_ylim(bottom=0.0)
    axes.legend()
    plots.save(figure, folder / PLOT)


def _mesh(clean: Mesh, n: int, number: int, points: IntArray) -> tuple[Mesh, int]:
    if n == 0:
        return clean, 0
    return perturbed(clean, n, np.random.default_rng([SEED, number, n]), points)


def _quality(mesh: Mesh) -> Results:
    """Smallest angle in degrees, and share of faces with an angle below `THIN`."""
    smallest = angles(mesh.vertices[mesh.faces]).min(axis=1)
    return {
        "smallest": round(float(smallest.min()), 4),
        "thin": round(float((smallest < THIN).mean()), 6),
    }


def _asked(
    label: str, mesh: Mesh, points: IntArray, method: str
) -> tuple[str, SurfaceCurve | None]:
    """Status of a design, and its curve if it is a single, finite one; otherwise None."""
    try:
        design = nicmm.design_curve(mesh, points, order="shortest", method=method)
    except nicmm.NicmmError as error:
        print(f"  {label}, {method}: {error}", flush=True)
        return "error", None
    status = design.status.name.lower()
    print(f"  {label}, {method}: {design.status.name}, {design.seconds:.1f} s", flush=True)
    if not is_one_curve(design.curves) or not np.isfinite(design.curves[0].points).all():
        return status, None
    return status, design.curves[0]


def _answer(
    status: str, mesh: Mesh, curve: SurfaceCurve | None, clean: SurfaceCurve | None
) -> Results:
    """Outcome of a method: its status, the bending, and the distances to the clean mesh's curve.

    "offset" is the mean and the greatest distance in percent of the diagonal.
    """
    answer: dict[str, Any] = {"status": status, "bending": None, "offset": None}
    if curve is not None:
        answer["bending"] = round(bending(mesh, curve), 4)
        if clean is not None:
            answer["offset"] = [
                round(100.0 * float(each) / mesh.diagonal, 6) for each in distances(curve, clean)
            ]
    return answer


def _name(n: int) -> str:
    return "clean" if n == 0 else f"1 in {n}"


def _answers(results: Results, n: int, method: str) -> list[Results]:
    """Outcomes of a method on all meshes of one severity."""
    return [each["answers"][method] for each in results["sets"] if each["n"] == n]


def _greatest(answers: Sequence[Results]) -> list[float]:
    """Greatest distances to the curves on the clean meshes, in percent of the diagonal."""
    return [each["offset"][1] for each in answers if each["offset"]]


def _succeeded(answers: Sequence[Results]) -> int:
    return sum(each["bending"] is not None for each in answers)


def _table(results: Results) -> str:
    rows = []
    for n in results["severities"]:
        of_severity = [each for each in results["sets"] if each["n"] == n]
        smallest = np.median([each["smallest"] for each in of_severity])
        thin = 100 * np.median([each["thin"] for each in of_severity])
        for method in results["methods"]:
            answers = _answers(results, n, method)
            rows.append(
                (
                    _name(n),
                    f"{smallest:.2f}°, {thin:.1f} %",
                    method,
                    f"{_succeeded(answers)} of {len(answers)}",
                    sum(each["status"] == "diverged" for each in answers),
                    _median([each["offset"][0] for each in answers if each["offset"]], 2),
                    _median(_greatest(answers), 2),
                    _median(
                        [each["bending"] for each in answers if each["bending"] is not None], 0
                    ),
                )
            )
    header = (
        "perturbed faces", f"smallest angle, faces below {results['thin']:g}°", "method",
        "one finite curve through all points", "diverged",
        "mean distance to the curve on the clean mesh, %", "greatest distance, %", "L ∮ κ_g² ds",
    )  # fmt: skip
    return report.table(header, rows)


def _median(values: Sequence[float], digits: int) -> str:
    return f"{np.median(values):.{digits}f}" if values else "–"


def _findings(results: Results) -> str:
    """What was measured at the worst severity, and whether it agrees with section 4.6."""
    worst = results["severities"][-1]
    at_worst = {method: _answers(results, worst, method) for method in results["methods"]}
    parts = []
    for method, answers in at_worst.items():
        share = 100 * _succeeded(answers) / len(answers)
        moved = _median(_greatest(answers), 1)
        parts.append(
            f"`{method}` gives a curve on {share:.0f} % of the meshes, and the curve moves by "
            f"{moved} % of the diagonal"
        )
    text = (
        f"At the worst severity ({_name(worst)}), {'; '.join(parts)} (greatest distance, median). "
    )
    greatest = _greatest(at_worst["nicmm"])
    if greatest:
        visible = np.median(greatest) > 100 * REMARKABLE
        text += (
            f"For `nicmm` that is {'more' if visible else 'not more'} than the "
            f"{100 * REMARKABLE:g} % from which a difference is obvious to the eye, which "
            f"{'contradicts' if visible else 'agrees with'} the paper's “nearly identical shapes” "
            "(Fig. 12). "
        )
    if "variational" not in at_worst:
        return text + "There are no curves of the variational method to compare with the paper."
    variational, paper = (_succeeded(at_worst[each]) for each in ("variational", "nicmm"))
    verdict = (
        "agrees with the paper, where the variational method fails on such meshes (Fig. 11)."
        if variational < paper
        else "contradicts the paper, where the variational method fails on such meshes (Fig. 11)."
    )
    return text + (
        f"`variational` succeeds on {variational} of {len(at_worst['variational'])} of these "
        f"meshes and `nicmm` on {paper}, which {verdict}"
    )


def _picture(
    n: int, moved: int, mesh: Mesh, shown: Mapping[str, SurfaceCurve | None]
) -> renders.Picture:
    curves = [
        (curve, renders.METHOD_COLOURS[method])
        for method, curve in shown.items()
        if curve is not None
    ]
    return renders.Picture(
        f"{_name(n)}: {moved} vertices moved", mesh, curves, smooth=False, edges=True
    )


def _rendered(pictures: Sequence[renders.Picture], scale: Scale) -> str | None:
    """Render all severities that have a curve, from the same view; return the file name or None."""
    shown = [picture for picture in pictures if picture.curves]
    if not shown:
        return None
    view = renders.best_view(shown[0])
    path = report.figures_folder(scale) / CURVES
    renders.render_sheet(shown, path, scale, columns=5, views=[view] * len(shown))
    return CURVES


def _shown_picture(name: str | None) -> str:
    if name is None:
        return "There is no picture, because no method gave a curve on the first mesh."
    return report.figure(
        name,
        "elastic (blue), nicmm (orange) and variational (green) on the first mesh at "
        "increasing severity (Fig. 11, top of Fig. 12)",
    )
