"""Measures how the curve through given points depends on the mesh resolution (Fig. 12 bottom)."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from itertools import groupby
from pathlib import Path

import igl
import numpy as np
from matplotlib.ticker import NullLocator

import nicmm_core as nicmm
from nicmm_core import shapes
from nicmm_core.geometry.array_types import IntArray
from nicmm_core.geometry.curve import SurfaceCurve, is_one_curve
from nicmm_core.geometry.mesh import Mesh
from tests.oracles.distances import distances

from . import collections, plots, renders, report
from .evidence import EVERY_METHOD, Results
from .measures import bending
from .methods import METHODS
from .polylines import NearestPoints
from .samples import random_sets
from .scale import Scale

TITLE = "Resolution (bottom of Fig. 12)"
ROOMS = EVERY_METHOD
TIMED = True

SEED = 4

REMARKABLE = 0.02
"""Distance, relative to the diagonal, above which a difference is obvious to the eye."""

PLOT = "resolution.png"

CURVES = "resolution_curves.png"
"""File name of the picture of the first mesh."""


def measure(scale: Scale) -> Results:
    """Design curves through the same points at several subdivisions; compare with the finest."""
    names, answers = [], []
    picture = None
    for number, (name, coarse, points) in enumerate(_sets(scale)):
        # 64,000 vertices take minutes, so only one mesh is that fine, as in the paper.
        levels = scale.choose(4 if number == 0 else 3, 3, 1)
        meshes = [_subdivided(coarse, level) for level in range(levels + 1)]
        names.append(f"{name} (up to {len(meshes[-1].vertices)} vertices)")
        for method in METHODS:
            designs = dict(_designs(name, meshes, points, method))
            answers += [
                {"mesh": name, "method": method, **answer} for answer in _compared(meshes, designs)
            ]
            if number == 0 and method == METHODS[0]:
                picture = _rendered(meshes, designs, scale)
    return {
        "seed": SEED,
        "collection": _source(scale),
        "meshes": names,
        "methods": list(METHODS),
        "answers": answers,
        "picture": picture,
    }


def section(results: Results) -> str:
    """Distances of curves on coarser meshes to those on the finest, and the paper's claim."""
    return (
        "Curves through the same control points were computed on Loop subdivisions of the same "
        "meshes, to see how much they depend on the resolution, as in the lower row of Fig. 12 of "
        "the paper. Each row is a number of subdivisions and a method, with medians over the "
        "meshes. Distances are mean and greatest distances from the curve, projected to the finest "
        "mesh, to the curve on that mesh, in percent of its diagonal. The control points are 3–5 "
        "random vertices of each coarse mesh (one set, shortest order, seed "
        f"{results['seed']}); Loop subdivision keeps their indices but moves them slightly. Meshes "
        f"({results['collection']}): {report.listed(results['meshes'])}.\n\n"
        f"{_table(results['answers'])}\n\n{_findings(results)}\n\n"
        + report.figure(PLOT, "Distances and times of every mesh and method, by number of vertices")
        + f"\n\n{_shown_picture(results)}"
    )


def draw(results: Results, folder: Path) -> None:
    """Plot distances and times against the number of vertices."""
    answers = results["answers"]
    figure, (left, right) = plots.labelled_pair(
        ("Distance to the curve on the finest mesh", "Time"),
        "vertices",
        ("greatest distance, % of the diagonal", "seconds"),
    )
    for method in results["methods"]:
        of_method = [each for each in answers if each["method"] == method]
        compared = [each for each in of_method if each["offset"] is not None]
        for axes, shown, values in (
            (left, compared, [each["offset"][1] for each in compared]),
            (right, of_method, [each["seconds"] for each in of_method]),
        ):
            vertices = [each["vertices"] for each in shown]
            colour = plots.METHOD_COLOURS[method]
            axes.plot(vertices, values, "o", alpha=0.7, color=colour, label=method)
    left.set_ylim(bottom=0.0)
    right.set_yscale("log")
    plots.plain_ticks(right.yaxis)
    for axes in (left, right):
        axes.set_xscale("log")
        sizes = sorted({each["vertices"] for each in answers})
        axes.set_xticks(sizes, [f"{size:,}" for size in sizes])
        axes.tick_params(axis="x", which="major", labelrotation=30)
        axes.xaxis.set_minor_locator(NullLocator())
        axes.legend()
    plots.save(figure, folder / PLOT)


def _sets(scale: Scale) -> list[tuple[str, Mesh, IntArray]]:
    if scale is Scale.SMOKE:
        creature = shapes.creature(0, resolution=32, faces=200, subdivisions=0)
        return list(random_sets([("creature 0", creature)], 1, SEED))
    meshes = collections.shrec16(scale.choose(4, 1), subdivisions=0)
    return list(random_sets(meshes, 1, SEED))


def _source(scale: Scale) -> str:
    return "A generated creature" if scale is Scale.SMOKE else "SHREC16"


def _subdivided(coarse: Mesh, level: int) -> Mesh:
    return Mesh(*igl.loop(coarse.vertices, coarse.faces, level)) if level else coarse


def _designs(
    name: str, meshes: Sequence[Mesh], points: IntArray, method: str
) -> Iterator[tuple[int, nicmm.Design]]:
    """Designs by level, finest first; levels without a single curve are left out."""
    for level in range(len(meshes) - 1, -1, -1):
        mesh = meshes[level]
        label = f"{name}, {len(mesh.vertices)} vertices, {method}"
        try:
            design = nicmm.design_curve(mesh, points, order="shortest", method=method)
        except nicmm.NicmmError as error:
            print(f"  {label}: {error}", flush=True)
            continue
        print(f"  {label}: {design.status.name}, {design.seconds:.1f} s", flush=True)
        if is_one_curve(design.curves):
            yield level, design


def _compared(meshes: Sequence[Mesh], designs: Mapping[int, nicmm.Design]) -> Iterator[Results]:
    """Summaries of the designs, coarse to fine, with distances to the curve on the finest mesh."""
    finest = len(meshes) - 1
    for level, design in sorted(designs.items()):
        curve = design.curves[0]
        offset = None
        if level != finest and finest in designs:
            offset = _offset(meshes[finest], curve, designs[finest].curves[0])
        yield {
            "level": level,
            "vertices": len(meshes[level].vertices),
            "offset": offset,
            "bending": round(bending(meshes[level], curve), 4),
            "iterations": int(design.iterations),
            "seconds": round(design.seconds, 4),
        }


def _offset(finest: Mesh, curve: SurfaceCurve, reference: SurfaceCurve) -> list[float]:
    """Mean and greatest distance, projected to the finest mesh, in percent of its diagonal."""
    projected = NearestPoints(finest).curve(curve.points, curve.control_index)
    return [
        round(100.0 * float(each) / finest.diagonal, 6) for each in distances(projected, reference)
    ]


def _table(answers: Sequence[Results]) -> str:
    rows = []
    for (level, method), grouped in groupby(sorted(answers, key=_level_method), key=_level_method):
        of_level = list(grouped)
        offsets = [each["offset"] for each in of_level if each["offset"] is not None]
        mean, greatest = np.median(offsets, axis=0) if offsets else (None, None)
        rows.append(
            (
                level,
                f"{_median(of_level, 'vertices'):.0f}",
                method,
                len(of_level),
                f"{mean:.2f}, {greatest:.2f}" if offsets else "–",
                f"{_median(of_level, 'bending'):.0f}",
                f"{_median(of_level, 'iterations'):.0f}",
                f"{_median(of_level, 'seconds'):.2f}",
            )
        )
    header = (
        "subdivisions", "vertices", "method", "curves",
        "distance to the finest curve: mean, greatest, %", "L ∮ κ_g² ds", "iterations", "seconds",
    )  # fmt: skip
    return report.table(header, rows)


def _level_method(answer: Results) -> tuple[int, str]:
    return answer["level"], answer["method"]


def _median(answers: Sequence[Results], name: str) -> float:
    return float(np.median([each[name] for each in answers]))


def _findings(results: Results) -> str:
    """What the table shows, in words, and whether it agrees with the paper."""
    text = ""
    for method in results["methods"]:
        greatest = [
            each["offset"][1]
            for each in results["answers"]
            if each["method"] == method and each["offset"] is not None
        ]
        if not greatest:
            text += f"There are no curves of `{method}` to compare. "
            continue
        apart = sum(value > 100 * REMARKABLE for value in greatest)
        text += (
            f"Of {len(greatest)} curves of `{method}` on coarser meshes, {apart} differ by more "
            f"than {100 * REMARKABLE:g} % of the diagonal from the curve on the finest mesh"
        )
        text += (
            ", so the curve does depend on the resolution, which contradicts the paper's "
            "“remarkable insensitivity to mesh vertex density”. "
            if apart > 0.25 * len(greatest)
            else ", which agrees with the paper's “remarkable insensitivity to mesh vertex "
            "density”. "
        )
    return text.strip()


def _rendered(
    meshes: Sequence[Mesh], designs: Mapping[int, nicmm.Design], scale: Scale
) -> str | None:
    """Render one method on one mesh, coarse to fine; return the file name, None without curves."""
    if not designs:
        return None
    pictures = [
        renders.Picture(
            f"{len(meshes[level].vertices)} vertices",
            meshes[level],
            [(design.curves[0], renders.METHOD_COLOURS[METHODS[0]])],
        )
        for level, design in sorted(designs.items())
    ]
    path = report.figures_folder(scale) / CURVES
    view = renders.best_view(pictures[-1])
    renders.render_sheet(pictures, path, scale, columns=5, views=[view] * len(pictures))
    return CURVES


def _shown_picture(results: Results) -> str:
    if results["picture"] is None:
        return "There is no picture, because the first mesh has no curve."
    return report.figure(
        results["picture"],
        f"Curves of {results['methods'][0]} on the first mesh, coarse to fine (bottom of Fig. 12)",
    )
