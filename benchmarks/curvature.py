"""Geodesic curvature of the methods' curves (Fig. 7, 8, Eq. 10), and how far from fair they are.

The yardstick is a slow explicit curve through the same points, see `elastic_curve`.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

import nicmm_core as nicmm
from nicmm_core.geometry.array_types import FloatArray, IntArray
from nicmm_core.geometry.curve import SurfaceCurve, is_one_curve
from nicmm_core.geometry.mesh import Mesh
from nicmm_core.geometry.surface_points import locate_control_points
from nicmm_core.level_set.problem import build_problem

from . import collections, plots, renders, report
from .elastic_curve import NODES, elastic_curve
from .measures import SAMPLES, bending, curvature_along
from .methods import METHODS
from .polylines import initial_path
from .samples import random_sets
from .scale import Scale

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

Bends = Mapping[str, tuple[float, ...]]
"""Of each curve through the points of one set, with each number of samples."""

PICTURED = 4
"""Sets that the picture shows."""


def run(scale: Scale) -> None:
    """Measure the curvature of all methods on the same sets of points."""
    curvatures: dict[str, list[FloatArray]] = {}
    bends: list[Bends] = []
    pictures: list[renders.Picture] = []
    names = []
    left_out = 0
    meshes = collections.surfaces(scale, scale.choose(48, 3))
    for name, mesh, points in random_sets(meshes, 1, SEED):
        curves = _curves(name, mesh, points)
        if curves is None:
            left_out += 1
            continue
        names.append(name)
        for label, curve in curves.items():
            scale_free = curvature_along(mesh, curve) * curve.length
            curvatures.setdefault(label, []).append(scale_free)
        bends.append(
            {
                label: tuple(bending(mesh, curve, samples) for samples in SAMPLINGS)
                for label, curve in curves.items()
            }
        )
        print(
            f"  {name}: " + ", ".join(f"{k} {v[0]:.0f}" for k, v in bends[-1].items()), flush=True
        )
        if len(pictures) < min(PICTURED, scale.choose(PICTURED, 1)):
            pictures.append(_picture(name, mesh, curves))
    if not bends:
        raise SystemExit("No set gave one curve with every method; there is nothing to compare")
    body = (
        f"Seed {SEED}, one set of 3–5 random vertices a mesh, shortest order, on "
        f"{len(bends)} meshes ({collections.label(scale)}: {report.listed(names)}); "
        f"{left_out} sets where a method did not give one curve are left out.\n\n"
        f"{_table(bends)}\n\n{_findings(bends)}\n\n"
        f"{_histogram(curvatures, scale)}\n\n{_stills(pictures, scale)}"
    )
    report.write_section("curvature", "Geodesic curvature (Fig. 7, 8, Eq. 10)", body, scale)


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


def _quartiles(values: Sequence[float], digits: int) -> str:
    return " · ".join(f"{value:.{digits}f}" for value in np.quantile(values, [0.25, 0.5, 0.75]))


def _ratios(bends: Sequence[Bends], label: str, sampling: int) -> list[float]:
    return [bend[label][sampling] / bend[ELASTIC][sampling] for bend in bends]


def _table(bends: Sequence[Bends]) -> str:
    rows = []
    for label in bends[0]:
        row = [label]
        for sampling in range(len(SAMPLINGS)):
            row.append(_quartiles([bend[label][sampling] for bend in bends], 0))
            row.append(_quartiles(_ratios(bends, label, sampling), 2))
        rows.append(row)
    header = ["curve"]
    for samples in SAMPLINGS:
        header += [f"L ∮ κ_g² ds, {samples} samples", "relative to the elastic curve"]
    return report.table(header, rows) + "\n\nQuartiles over the sets."


def _findings(bends: Sequence[Bends]) -> str:
    """What the table says, in words."""
    text = (
        f"The {ELASTIC} is the best of those that start from the initial path and from each "
        "method's curve. Its topology is free, so it may cross itself, and it is a local optimum. "
        "A circle in the plane has 4 π² ≈ 39. "
    )
    for method in METHODS:
        medians = [float(np.median(_ratios(bends, method, s))) for s in range(len(SAMPLINGS))]
        both = " and ".join(
            f"{median:.2f} times ({samples} samples)"
            for median, samples in zip(medians, SAMPLINGS, strict=True)
        )
        text += f"`{method}` bends {both} as much as it, by the median. "
    if "variational" in METHODS:
        text += _against_the_paper(bends)
    else:
        text += "The paper's comparison with the variational method is not possible yet."
    return text


def _against_the_paper(bends: Sequence[Bends]) -> str:
    relative = [bend["nicmm-paper"][0] / bend["variational"][0] for bend in bends]
    middle = float(np.median(relative))
    verdict = "which agrees with" if 0.8 <= middle <= 1.25 else "which contradicts"
    return (
        f"`nicmm-paper` bends {middle:.2f} times as much as `variational` ({SAMPLES} samples, "
        f"median), {verdict} the paper's “comparable distributions of geodesic curvature”."
    )


def _histogram(curvatures: Mapping[str, Sequence[FloatArray]], scale: Scale) -> str:
    """Shares of the length by curvature; the samples of a curve are evenly spaced along it."""
    figure, axes = plots.labelled(
        "Geodesic curvature, weighted by length (Fig. 8)",
        "geodesic curvature times the curve's length",
        "share of the length",
    )
    bins = np.arange(-CURVATURE_RANGE, CURVATURE_RANGE + BIN_WIDTH, BIN_WIDTH).tolist()
    for label, of_curves in curvatures.items():
        values = np.concatenate(of_curves)
        beyond = float((np.abs(values) > CURVATURE_RANGE).mean())
        axes.hist(
            values,
            bins,
            weights=np.full(len(values), 1.0 / len(values)),
            histtype="step",
            linewidth=1.6,
            color=plots.METHOD_COLOURS[label],
            label=f"{label} ({100 * beyond:.1f} % outside)",
        )
    axes.set_yscale("log")
    axes.legend(fontsize=8)
    path = plots.save(figure, report.output_folder(scale) / "curvature.png")
    return report.figure(path, "Geodesic curvature of all curves, weighted by length (Fig. 8)")


def _picture(name: str, mesh: Mesh, curves: Mapping[str, SurfaceCurve]) -> renders.Picture:
    colours = {**renders.METHOD_COLOURS, ELASTIC: renders.WHITE}
    shown = [(curves[label], colours[label]) for label in (*METHODS, ELASTIC)]
    return renders.Picture(name, mesh, shown)


def _stills(pictures: Sequence[renders.Picture], scale: Scale) -> str:
    path = report.output_folder(scale) / "curvature_curves.png"
    renders.render_sheet(pictures, path, scale)
    return report.figure(
        path,
        "The curves of nicmm (blue), nicmm-paper (orange), variational (green) and the elastic "
        "curve (white) through the same points (Fig. 7)",
    )
