"""Measures the time and the quality of curves that start from the last one, as in dragging."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import igl
import numpy as np

import nicmm_core as nicmm
from nicmm_core import shapes
from nicmm_core.geometry.array_types import IntArray
from nicmm_core.geometry.mesh import Mesh
from tests.oracles.checker import judge

from . import collections, report
from .evidence import EVERY_METHOD, Results, missing_packages
from .measures import bending
from .peer_systems import later_signed_heat, task_on
from .samples import random_sets
from .scale import Scale

TITLE = "Dragging a control point"
TIMED = True
ROOMS = EVERY_METHOD

SEED = 0
DRAGS = 5
"""Number of times that the first control point moves to a neighbouring vertex."""

FINE_SUBDIVISIONS = 4
SAMPLES = 240
PEER_BODY = (812, 2)
"""Faces and subdivisions of the body for the comparison with signed heat: 13,000 faces."""

PEER_SETS = 10
PEER_POINTS = 4


def measure(scale: Scale) -> Results:
    """Drag on meshes of the resolution in the paper, and with sixteen times as many faces."""
    coarse = _measured(collections.surfaces(scale, scale.choose(40, 4)), variational=True)
    if scale is Scale.SMOKE:
        fine = coarse
    else:
        meshes = collections.shrec16(scale.choose(8, 1), FINE_SUBDIVISIONS)
        fine = _measured(meshes, variational=False)
    return {
        "seed": SEED,
        "drags": DRAGS,
        "collection": collections.label(scale),
        "coarse": coarse,
        "fine_subdivisions": FINE_SUBDIVISIONS,
        "fine": fine,
        "signed_heat": _beside_signed_heat(scale),
    }


def section(results: Results) -> str:
    """Times of a dragged curve, of a first one, and of other methods."""
    coarse, fine = results["coarse"], results["fine"]
    header = (
        "meshes", "vertices", "first curve (ms)", "another curve (ms)", "dragged curve (ms)",
        "iterations, dragged", "variational (ms)", "bending, dragged / from scratch", "refused",
        "faults",
    )  # fmt: skip
    rows = [
        _row(f"{len(coarse)} meshes: {results['collection']}", coarse),
        _row(f"{len(fine)} meshes: {results['fine_subdivisions']} Loop subdivisions", fine),
    ]
    ratio = _median(coarse, "dragged") / _median(coarse, "variational")
    first = _median(coarse, "first") / _median(coarse, "variational")
    growth = _median(fine, "dragged") / _median(coarse, "dragged")
    return (
        "The table shows how long a curve takes while a control point is dragged, that is, when "
        "it starts from the curve before. On each mesh a first curve is designed through 3–5 "
        "random vertices (shortest order, seed "
        f"{results['seed']}); then its first point moves to a neighbouring vertex "
        f"{results['drags']} times. Each row is a group of meshes with medians over them, measured "
        "in one process. *Another curve* is one through other points on the same Designer. "
        "*Bending* compares the last dragged curve with a new design through the same points. "
        "*Refused* counts moves after which the start could not be used, for example because the "
        "curve would cross itself; the curve is then designed from scratch. *Faults* are those "
        "that the independent checker finds in the first and the dragged curves. The paper has no "
        "corresponding measurement.\n\n"
        + report.table(header, rows)
        + f"\n\nA dragged curve takes {ratio:.3f} times as long as a curve of the variational "
        f"method (goal: 0.10), and a first curve {first:.2f} times as long (goal: 0.25). With "
        f"sixteen times as many faces a dragged curve takes {growth:.1f} times as long (goal: "
        "4).\n\n" + _signed_heat_words(results["signed_heat"])
    )


def _beside_signed_heat(scale: Scale) -> Results | None:
    """Times of dragged curves and of later solves of potpourri3d's signed heat on one mesh."""
    if missing_packages(["potpourri3d"], scale):
        return None
    faces, subdivisions = (200, 1) if scale is Scale.SMOKE else PEER_BODY
    mesh = shapes.creature(SEED, faces=faces, subdivisions=subdivisions)
    generator = np.random.default_rng(SEED)
    ours, theirs = [], []
    for _ in range(scale.choose(PEER_SETS, 3)):
        points = generator.choice(len(mesh.vertices), PEER_POINTS, replace=False)
        ours.append(_dragged(mesh, points, variational=False)["dragged"])
        theirs.append(round(later_signed_heat(task_on(mesh, points))[1], 6))
    return {"faces": len(mesh.faces), "points": PEER_POINTS, "ours": ours, "theirs": theirs}


def _signed_heat_words(beside: Results | None) -> str:
    if beside is None:
        return "potpourri3d is not installed, so its signed heat method was not measured."
    ours, theirs = np.median(beside["ours"]), np.median(beside["theirs"])
    return (
        f"On a generated body with {beside['faces']:,} faces and {len(beside['ours'])} sets of "
        f"{beside['points']} points, a dragged curve takes {1000 * ours:.0f} ms by the median. A "
        "later solve of potpourri3d's signed heat method, which reuses its factorisations, takes "
        f"{1000 * theirs:.0f} ms, so the ratio is {ours / theirs:.2f} (goal: 1.0)."
    )


def _measured(meshes: Iterable[tuple[str, Mesh]], variational: bool) -> list[Results]:
    found = []
    for name, mesh, points in random_sets(meshes, 1, SEED):
        drag = _dragged(mesh, points, variational)
        found.append({"mesh": name, "vertices": len(mesh.vertices), **drag})
        print(
            f"  {name}: first {1000 * drag['first']:.0f} ms, dragged {1000 * drag['dragged']:.0f}",
            flush=True,
        )
    return found


def _dragged(mesh: Mesh, points: IntArray, variational: bool) -> Results:
    """Times in seconds, iterations, bending and faults on one mesh.

    "first" is the first curve on the mesh, "another" a curve through other points on the same
    Designer, "dragged" the median of the curves after small moves, and "variational" the curve of
    the variational method.
    """
    neighbours = igl.adjacency_list(mesh.faces)
    mesh = Mesh(mesh.vertices, mesh.faces)  # a copy without cached values
    designer = nicmm.Designer(mesh)
    designs = [designer.design(points, order="shortest")]
    faults = len(judge(mesh, designs[0], points, True, "shortest").faults)
    refused, dragged = 0, []
    for _ in range(DRAGS):
        points = points.copy()
        points[0] = next(v for v in neighbours[points[0]] if v not in points)
        try:
            designs.append(designer.design(points, order="shortest", start=designs[-1]))
            dragged.append(designs[-1])
        except nicmm.CurveError:  # as a caller would, design from scratch
            designs.append(designer.design(points, order="shortest"))
            refused += 1
        faults += len(judge(mesh, designs[-1], points, True, "shortest").faults)
    anew = nicmm.Designer(mesh).design(points, order="shortest")
    generator = np.random.default_rng(SEED)
    others = generator.choice(np.flatnonzero(mesh.referenced), len(points), replace=False)
    another = designer.design(others, order="shortest")
    slow = None
    if variational:
        design = nicmm.design_curve(mesh, points, order="shortest", method="variational")
        slow = round(design.seconds, 6)
    bends = [bending(mesh, each.curves[0], SAMPLES) for each in (designs[-1], anew)]
    return {
        "first": round(designs[0].seconds, 6),
        "another": round(another.seconds, 6),
        "dragged": round(float(np.median([design.seconds for design in dragged])), 6),
        "variational": slow,
        "iterations": float(np.median([design.iterations for design in dragged])),
        "bending": round(bends[0] / bends[1], 6),
        "refused": refused,
        "faults": faults,
    }


def _median(drags: Sequence[Results], name: str) -> float:
    return float(np.median([drag[name] for drag in drags]))


def _row(label: str, drags: Sequence[Results]) -> tuple[object, ...]:
    names = ["first", "another", "dragged"]
    solved_variational = all(drag["variational"] is not None for drag in drags)
    return (
        label,
        f"{_median(drags, 'vertices'):.0f}",
        *(f"{1000 * _median(drags, name):.0f}" for name in names),
        f"{_median(drags, 'iterations'):.0f}",
        f"{1000 * _median(drags, 'variational'):.0f}" if solved_variational else "–",
        f"{_median(drags, 'bending'):.2f}",
        sum(drag["refused"] for drag in drags),
        sum(drag["faults"] for drag in drags),
    )
