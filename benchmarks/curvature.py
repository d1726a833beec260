"""Measures the geodesic curvature of the curves of all methods (Fig. 7, 8, Eq. 10).

The reference for fairness is an explicit curve through the same points, which takes long to
compute; see `elastic_curve`.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

import nicmm_core as nicmm
from nicmm_core.geometry.array_types import FloatArray, IntArray
from nicmm_core.geometry.curve import SurfaceCurve, is_one_curve
from nicmm_core.geometry.mesh import Mesh
from nicmm_core.geometry.surface_points import locate_control_points
from nicmm_core.paper.problem import build_problem

from . import collections, plots, renders, report
from .elastic_curve import NODES, elastic_curve
from .evidence import EVERY_METHOD, Results
from .measures import SAMPLES, bending, curvature_along
from .methods import METHODS
from .polylines import initial_path
from .samples import random_sets
from .scale import Scale

TITLE = "Geodesic curvature (Fig. 7, 8, Eq. 10)"
ROOMS = EVERY_METHOD

SEED = 0
INITIAL, REFERENCE = "initial path", "reference curve"

BIN_WIDTH = 2.0
CURVATURE_RANGE = 60.0
"""Range of the histogram of κ_g times the length of the curve; a circle in the plane has 2π."""

SAMPLINGS = (SAMPLES, NODES)
"""Numbers of samples at which bending is measured.

The first number is the default of `bending`. It is too coarse around thin limbs, where curves turn
within a few samples. The second number also resolves the corners of a curve at mesh edges.
"""

DIGITS = 4
"""Decimals of bending that are kept in results."""

STILLS = "curvature_curves.png"
PICTURED = 4
"""Number of sets that the picture shows."""


def measure(scale: Scale) -> Results:
    """Measure the curvature of all methods on the same sets of points."""
    curvatures: dict[str, list[FloatArray]] = {}
    sets: list[Results] = []
    pictures: list[renders.Picture] = []
    left_out = 0
    meshes = collections.surfaces(scale, scale.choose(48, 3))
    for name, mesh, points in random_sets(meshes, 1, SEED):
        curves = _curves(name, mesh, points)
        if curves is None:
            left_out += 1
            continue
        for label, curve in curves.items():
            scale_free = curvature_along(mesh, curve) * curve.length
            curvatures.setdefault(label, []).append(scale_free)
        bends = {label: _bends(mesh, curve) for label, curve in curves.items()}
        sets.append({"mesh": name, "bending": bends})
        print(f"  {name}: " + ", ".join(f"{k} {v[0]:.0f}" for k, v in bends.items()), flush=True)
        if len(pictures) < min(PICTURED, scale.choose(PICTURED, 1)):
            pictures.append(_picture(name, mesh, curves))
    if not sets:
        raise SystemExit("No set gave one curve with every method; there is nothing to compare")
    renders.render_sheet(pictures, report.figures_folder(scale) / STILLS, scale)
    return {
        "seed": SEED,
        "collection": collections.label(scale),
        "methods": list(METHODS),
        "samplings": list(SAMPLINGS),
        "sets": sets,
        "left_out": left_out,
        "histogram": _histogram(curvatures),
        "stills": STILLS,
    }


def section(results: Results) -> str:
    """Bending of the curves, and whether it agrees with the paper."""
    sets = results["sets"]
    histogram = report.figure(
        "curvature.png", "Distribution of geodesic curvature, weighted by length (Fig. 8)"
    )
    stills = report.figure(
        results["stills"],
        "The curves of elastic (blue), nicmm (orange), variational (green) and the "
        "reference curve (white) through the same points (Fig. 7)",
    )
    return (
        "The table compares how much the curves of the methods bend through the same control "
        "points. Each row is a kind of curve: the initial path along edges, the curve of each "
        "method, and an explicit elastic curve as the reference. The values are quartiles over "
        f"{len(sets)} sets of the bending L ∮ κ_g² ds, with κ_g by Eq. 10 at "
        f"{' or '.join(str(samples) for samples in results['samplings'])} evenly spaced points, "
        "and of its ratio to the bending of the reference. A set has 3–5 random vertices, one "
        f"set per mesh, in the shortest order (seed {results['seed']}); {results['left_out']} "
        "sets for which a method did not give one curve are left out. Meshes "
        f"({results['collection']}): {report.listed(each['mesh'] for each in sets)}.\n\n"
        f"{_table(results)}\n\n{_findings(results)}\n\n{histogram}\n\n{stills}"
    )


def draw(results: Results, folder: Path) -> None:
    """Plot the distribution of curvature, weighted by length."""
    figure, axes = plots.labelled(
        "Geodesic curvature, weighted by length (Fig. 8)",
        "geodesic curvature times the length of the curve",
        "share of the length",
    )
    bounds = results["histogram"]["bounds"]
    middles = 0.5 * (np.array(bounds[:-1]) + np.array(bounds[1:]))
    for label, of_label in results["histogram"]["curves"].items():
        share = 1.0 / of_label["samples"]
        axes.hist(
            middles,
            bounds,
            weights=share * np.array(of_label["counts"]),
            histtype="step",
            linewidth=1.6,
            color=plots.METHOD_COLOURS[label],
            label=f"{label} ({100 * share * of_label['beyond']:.1f} % outside)",
        )
    axes.set_yscale("log")
    axes.legend(fontsize=8)
    plots.save(figure, folder / "curvature.png")


def _curves(name: str, mesh: Mesh, points: IntArray) -> dict[str, SurfaceCurve] | None:
    """Initial path, curve of each method and reference curve; None if a method gives no curve."""
    try:
        designs = {
            method: nicmm.design_curve(mesh, points, order="shortest", method=method)
            for method in METHODS
        }
    except nicmm.UnreachableError as error:
        print(f"  {name}: {error}", flush=True)
        return None
    several = [method for method, design in designs.items() if not is_one_curve(design.curves)]
    if several:
        print(f"  {name}: not one curve: {report.listed(several)}", flush=True)
        return None
    problem = build_problem(mesh, locate_control_points(mesh, points, True), "shortest")
    ways = {method: design.curves[0] for method, design in designs.items()}
    path = initial_path(mesh, problem)
    fair = [elastic_curve(mesh, start) for start in (path, *ways.values())]
    return {INITIAL: path, **ways, REFERENCE: min(fair, key=lambda one: one.energies[-1]).curve}


def _bends(mesh: Mesh, curve: SurfaceCurve) -> list[float]:
    """L ∮ κ_g² ds for each number of samples."""
    return [round(bending(mesh, curve, samples), DIGITS) for samples in SAMPLINGS]


def _histogram(curvatures: Mapping[str, Sequence[FloatArray]]) -> Results:
    """Histogram of curvature at evenly spaced samples of all curves, by kind of curve."""
    bounds = np.arange(-CURVATURE_RANGE, CURVATURE_RANGE + BIN_WIDTH, BIN_WIDTH).tolist()
    counted = {}
    for label, of_curves in curvatures.items():
        values = np.concatenate(of_curves)
        counted[label] = {
            "samples": len(values),
            "beyond": int((np.abs(values) > CURVATURE_RANGE).sum()),
            "counts": np.histogram(values, bounds)[0].tolist(),
        }
    return {"bounds": bounds, "curves": counted}


def _picture(name: str, mesh: Mesh, curves: Mapping[str, SurfaceCurve]) -> renders.Picture:
    colours = {**renders.METHOD_COLOURS, REFERENCE: renders.WHITE}
    shown = [(curves[label], colours[label]) for label in (*METHODS, REFERENCE)]
    return renders.Picture(name, mesh, shown)


def _quartiles(values: Sequence[float], digits: int) -> str:
    return " · ".join(f"{value:.{digits}f}" for value in np.quantile(values, [0.25, 0.5, 0.75]))


def _ratios(results: Results, label: str, base: str, sampling: int) -> list[float]:
    """Bending relative to that of another kind of curve, for each set."""
    bends = [each["bending"] for each in results["sets"]]
    return [bend[label][sampling] / bend[base][sampling] for bend in bends]


def _table(results: Results) -> str:
    rows = []
    bends = [each["bending"] for each in results["sets"]]
    for label in bends[0]:
        row = [label]
        for sampling in range(len(results["samplings"])):
            row.append(_quartiles([bend[label][sampling] for bend in bends], 0))
            row.append(_quartiles(_ratios(results, label, REFERENCE, sampling), 2))
        rows.append(row)
    header = ["curve"]
    for samples in results["samplings"]:
        header += [
            f"L ∮ κ_g² ds, {samples} samples",
            f"relative to the reference, {samples} samples",
        ]
    return report.table(header, rows)


def _findings(results: Results) -> str:
    """What the table shows, in words, and whether it agrees with the paper."""
    samplings = results["samplings"]
    text = (
        f"The {REFERENCE} is the fairest of the elastic curves that start from the initial path "
        "and from the curve of each method. It is a local optimum, and it may cross itself. "
    )
    for method in results["methods"]:
        both = " and ".join(
            f"{np.median(_ratios(results, method, REFERENCE, place)):.2f} times ({samples} samples)"
            for place, samples in enumerate(samplings)
        )
        text += f"By the median, `{method}` bends {both} as much as the reference. "
    if "variational" not in results["methods"]:
        return text + "There are no curves of the variational method to compare with the paper."
    middle = float(np.median(_ratios(results, "nicmm", "variational", 0)))
    verdict = "which agrees with" if 0.8 <= middle <= 1.25 else "which contradicts"
    return text + (
        f"By the median, `nicmm` bends {middle:.2f} times as much as `variational` "
        f"({samplings[0]} samples), {verdict} the paper's “comparable distributions of geodesic "
        "curvature”."
    )
