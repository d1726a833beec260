"""Geodesic curvature of the methods' curves (Fig. 7, 8, Eq. 10), and how far from fair they are.

The yardstick is a slow explicit curve through the same points, see `elastic_curve`.
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
from nicmm_core.level_set.problem import build_problem

from . import collections, plots, renders, report
from .elastic_curve import NODES, elastic_curve
from .evidence import Results
from .measures import SAMPLES, bending, curvature_along
from .methods import METHODS
from .polylines import initial_path
from .samples import random_sets
from .scale import Scale

TITLE = "Geodesic curvature (Fig. 7, 8, Eq. 10)"
WITHOUT = ("outputs", "splines")

SEED = 0
INITIAL, ELASTIC = "initial path", "elastic curve"

BIN_WIDTH = 2.0
CURVATURE_RANGE = 60.0
"""Of the histogram, for κ_g times the curve's length; a circle in the plane has 2 π."""

SAMPLINGS = (SAMPLES, NODES)
"""Numbers of samples that bending is measured with.

The first is that of all other measurements. Curves round thin limbs turn within a few of its
steps, so its values are too rough there; the second sees also the corners at the mesh's edges.
"""

DIGITS = 4
"""Decimals of bending that results keep."""

STILLS = "curvature_curves.png"
PICTURED = 4
"""Sets that the picture shows."""


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
    """How much the curves bend, and how that compares with the paper."""
    sets = results["sets"]
    histogram = report.figure(
        "curvature.png", "Geodesic curvature of all curves, weighted by length (Fig. 8)"
    )
    stills = report.figure(
        results["stills"],
        "The curves of nicmm (blue), nicmm-paper (orange), variational (green) and the elastic "
        "curve (white) through the same points (Fig. 7)",
    )
    return (
        f"Seed {results['seed']}, one set of 3–5 random vertices a mesh, shortest order, on "
        f"{len(sets)} meshes ({results['collection']}: "
        f"{report.listed(each['mesh'] for each in sets)}); "
        f"{results['left_out']} sets where a method did not give one curve are left out.\n\n"
        f"{_table(results)}\n\n{_findings(results)}\n\n{histogram}\n\n{stills}"
    )


def draw(results: Results, folder: Path) -> None:
    """Draw shares of the length by curvature."""
    figure, axes = plots.labelled(
        "Geodesic curvature, weighted by length (Fig. 8)",
        "geodesic curvature times the curve's length",
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
    """Initial path, the curve of each method and the elastic curve; None if a method has none."""
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
    return {INITIAL: path, **ways, ELASTIC: min(fair, key=lambda one: one.energies[-1]).curve}


def _bends(mesh: Mesh, curve: SurfaceCurve) -> list[float]:
    """L ∮ κ_g² ds with each number of samples."""
    return [round(bending(mesh, curve, samples), DIGITS) for samples in SAMPLINGS]


def _histogram(curvatures: Mapping[str, Sequence[FloatArray]]) -> Results:
    """Samples by curvature, of all curves; those of a curve are evenly spaced along it."""
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
    colours = {**renders.METHOD_COLOURS, ELASTIC: renders.WHITE}
    shown = [(curves[label], colours[label]) for label in (*METHODS, ELASTIC)]
    return renders.Picture(name, mesh, shown)


def _quartiles(values: Sequence[float], digits: int) -> str:
    return " · ".join(f"{value:.{digits}f}" for value in np.quantile(values, [0.25, 0.5, 0.75]))


def _ratios(results: Results, label: str, base: str, sampling: int) -> list[float]:
    """Bending relative to that of another curve, of each set."""
    bends = [each["bending"] for each in results["sets"]]
    return [bend[label][sampling] / bend[base][sampling] for bend in bends]


def _table(results: Results) -> str:
    rows = []
    bends = [each["bending"] for each in results["sets"]]
    for label in bends[0]:
        row = [label]
        for sampling in range(len(results["samplings"])):
            row.append(_quartiles([bend[label][sampling] for bend in bends], 0))
            row.append(_quartiles(_ratios(results, label, ELASTIC, sampling), 2))
        rows.append(row)
    header = ["curve"]
    for samples in results["samplings"]:
        header += [f"L ∮ κ_g² ds, {samples} samples", "relative to the elastic curve"]
    return report.table(header, rows) + "\n\nQuartiles over the sets."


def _findings(results: Results) -> str:
    """What the table says, in words."""
    samplings = results["samplings"]
    text = (
        f"The {ELASTIC} is the best of those that start from the initial path and from each "
        "method's curve. Its topology is free, so it may cross itself, and it is a local optimum. "
        "A circle in the plane has 4 π² ≈ 39. "
    )
    for method in results["methods"]:
        both = " and ".join(
            f"{np.median(_ratios(results, method, ELASTIC, place)):.2f} times ({samples} samples)"
            for place, samples in enumerate(samplings)
        )
        text += f"`{method}` bends {both} as much as it, by the median. "
    if "variational" not in results["methods"]:
        return text + "The paper's comparison with the variational method is not possible yet."
    middle = float(np.median(_ratios(results, "nicmm-paper", "variational", 0)))
    verdict = "which agrees with" if 0.8 <= middle <= 1.25 else "which contradicts"
    return text + (
        f"`nicmm-paper` bends {middle:.2f} times as much as `variational` ({samplings[0]} samples, "
        f"median), {verdict} the paper's “comparable distributions of geodesic curvature”."
    )
