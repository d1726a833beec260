"""Compares this package with other systems: curves through the same points (Fig. 9)."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence

import numpy as np

import nicmm_core as nicmm
from nicmm_core.geometry.array_types import FloatArray, IntArray
from nicmm_core.geometry.curve import SurfaceCurve
from nicmm_core.geometry.mesh import Mesh

from . import collections, renders, report
from .evidence import EVERY_METHOD, Results, missing_packages
from .measures import bending
from .methods import METHODS
from .peer_sizes import measured_sizes, sizes_section
from .peer_systems import PACKAGES, SYSTEMS, Answer, SystemsProcess, Task, task_on
from .polylines import NearestPoints, misses
from .samples import random_sets
from .scale import Scale

TITLE = "Other systems (Fig. 9)"
TIMED = True
ROOMS = EVERY_METHOD

SEED = 7

PASSES = 1e-3
"""Distance, relative to the diagonal, up to which a curve counts as passing a point."""

ON_SURFACE = 1e-4
"""Distance, relative to the diagonal, up to which a polyline counts as lying on the surface."""

PATIENCE = 120.0
"""Time limit of a system in seconds."""

PEER_COLOURS = dict(
    zip(SYSTEMS, (renders.YELLOW, renders.BLACK, renders.OBSTACLE, renders.WHITE), strict=True)
)

CURVES = "peers.png"
"""File name of the picture of the first meshes."""

ONE_CURVE = "one curve"
"""Outcome that every system is asked for; the other outcomes are words as well."""


def measure(scale: Scale) -> Results:
    """Compute a curve through the same points in the same order with every system."""
    missing = missing_packages(PACKAGES, scale)
    systems = [name for name, (package, _) in SYSTEMS.items() if package not in missing]
    sets: list[Results] = []
    pictures: list[renders.Picture] = []
    process = SystemsProcess()
    surfaces = collections.surfaces(scale, scale.choose(40, 3))
    for name, mesh, points in random_sets(surfaces, 1, SEED):
        try:
            task = task_on(mesh, points)
        except nicmm.UnreachableError as error:
            print(f"  {name}: {error}", flush=True)
            continue
        curves: dict[str, SurfaceCurve] = {}
        answers = {method: _ours(mesh, points, method, curves) for method in METHODS}
        for system in systems:
            reply = process.ask(system, task, PATIENCE)
            if isinstance(reply, str):
                print(f"  {name}: {system}: {reply}", flush=True)
                answers[system] = {"outcome": "failed"}
            else:
                answers[system] = _theirs(mesh, task, system, reply, curves)
        sets.append({"mesh": name, "answers": answers})
        if len(pictures) < min(4, len(sets)):
            pictures.append(_picture(name, mesh, curves))
    process.end()
    return {
        "seed": SEED,
        "collection": collections.label(scale),
        "methods": list(METHODS),
        "systems": systems,
        "missing": missing,
        "sets": sets,
        "sizes": measured_sizes(scale, systems),
        "picture": _rendered(pictures, scale),
    }


def section(results: Results) -> str:
    """Quality and time of the curves of every system."""
    names = [each["mesh"] for each in results["sets"]]
    missing = ""
    if results["missing"]:
        missing = f" Left out, because not installed: {report.listed(results['missing'])}."
    return (
        "The table compares closed curves of this package with those of other systems through the "
        "same control points in the same order. Each row is a method or system. Its columns are "
        "the number of sets on which it gives exactly one curve, and what it gives otherwise; the "
        f"number on which it passes all points (within {100 * PASSES:g} % of the diagonal), and "
        "its greatest distance from a point; the number on which the curve lies on the surface "
        f"(within {100 * ON_SURFACE:g} %), and its greatest distance from the surface; its "
        "bending; and its time, which includes the preparation of the mesh. Distances, bending and "
        "times "
        "are medians over the sets; distance to the surface and bending are those of single "
        f"curves. There are {len(names)} sets of 3–5 random vertices, one per mesh (seed "
        f"{results['seed']}). Systems that start from a path of edges get the initial path of this "
        "package, on a mesh with the same virtual splits. Meshes "
        f"({results['collection']}): {report.listed(names)}.{missing}\n\n"
        f"{systems_table(results)}\n\n{_findings(results)}\n\n"
        "The second table shows how the times grow with the mesh; each row is a number of "
        "vertices. *Another* is a further curve on the same Designer, and *later* is a further "
        "signed distance with stored factorisations.\n\n"
        f"{sizes_section(results['sizes'])}\n\n"
        f"{_shown_picture(results['picture'])}"
    )


def summary(results: Results) -> str:
    """What the documents say of the measured systems."""
    return f"{systems_table(results)}\n\n{sizes_section(results['sizes'])}"


def _ours(mesh: Mesh, points: IntArray, method: str, curves: dict[str, SurfaceCurve]) -> Results:
    """Answer of one of our methods; if it is a single curve, it is added to ``curves``.

    "miss" is the greatest distance from a control point to the curves, and "off" the greatest
    distance from a single curve to the surface, both relative to the diagonal. "bending" is
    L ∮ κ_g² ds of a single curve.
    """
    design = nicmm.design_curve(mesh, points, order="shortest", method=method)
    one = len(design.curves) == 1
    drawn = [curve.points for curve in design.curves]
    answer = {
        "outcome": ONE_CURVE if one else "in pieces",
        "seconds": round(design.seconds, 6),
        "miss": _relative(_greatest_miss(drawn, mesh.vertices[points]), mesh),
    }
    if one:
        curves[method] = design.curves[0]
        off = NearestPoints(mesh).greatest_distance(design.curves[0].points)
        answer["off"] = _relative(off, mesh)
        answer["bending"] = round(bending(mesh, design.curves[0]), 4)
    return answer


def _theirs(
    mesh: Mesh, task: Task, system: str, reply: Answer, curves: dict[str, SurfaceCurve]
) -> Results:
    """Answer of another system, in the form of `_ours`."""
    polylines = [line for line in reply[0] if len(line)]
    answer: Results = {"outcome": "nothing", "seconds": round(reply[1], 6)}
    if not polylines:
        return answer
    answer["miss"] = _relative(_greatest_miss(polylines, task.vertices[task.controls]), mesh)
    if len(polylines) > 1 or len(polylines[0]) < 3:
        answer["outcome"] = "in pieces" if len(polylines) > 1 else "shrunk to a point"
        return answer
    surface = NearestPoints(mesh)
    answer["outcome"] = ONE_CURVE
    answer["off"] = _relative(surface.greatest_distance(polylines[0]), mesh)
    curves[system] = surface.curve(polylines[0], np.zeros(0, dtype=np.int64))
    answer["bending"] = round(bending(mesh, curves[system]), 4)
    return answer


def _relative(length: float, mesh: Mesh) -> float:
    return float(f"{length / mesh.diagonal:.6g}")


def _greatest_miss(polylines: Sequence[FloatArray], places: FloatArray) -> float:
    each = np.array([[misses(line, place[None]) for place in places] for line in polylines])
    return float(each.min(axis=0).max())


def _values(results: Results, system: str, name: str) -> list[float]:
    """Known values of one measure for one system, over the sets."""
    answers = [each["answers"][system] for each in results["sets"]]
    return [answer[name] for answer in answers if name in answer]


def systems_table(results: Results) -> str:
    """What each system gives, one row for each."""
    rows = []
    sets = len(results["sets"])
    for system in (*results["methods"], *results["systems"]):
        outcomes = Counter(each["answers"][system]["outcome"] for each in results["sets"])
        others = sorted(set(outcomes) - {ONE_CURVE})
        miss, off, bends, seconds = (
            _values(results, system, name) for name in ("miss", "off", "bending", "seconds")
        )
        rows.append(
            (
                system,
                f"{outcomes[ONE_CURVE]} of {sets}",
                report.listed(f"{outcomes[other]} {other}" for other in others) or "–",
                f"{sum(value <= PASSES for value in miss)} of {sets}",
                _percent(miss),
                f"{sum(value <= ON_SURFACE for value in off)} of {sets}",
                _percent(off),
                f"{np.median(bends):.0f}" if bends else "–",
                f"{np.median(seconds):.3f}" if seconds else "–",
            )
        )
    header = (
        "system", "one curve", "otherwise", "through all points", "distance to a point, %",
        "on the surface", "distance to the surface, %", "L ∮ κ_g² ds", "seconds",
    )  # fmt: skip
    return report.table(header, rows)


def _percent(values: Sequence[float]) -> str:
    return f"{100 * np.median(values):.3f}" if values else "–"


def _findings(results: Results) -> str:
    """Comparison of passing the points, bending and time, in words."""
    ours = results["methods"][0]
    text = (
        "The paper compares with B/surf in Fig. 9, by eye. B/surf is an interactive program whose "
        "segments are joined by hand and was not measured here, so Fig. 9 is neither confirmed nor "
        "contradicted. "
    )
    if not _values(results, ours, "bending"):
        return text + f"`{ours}` gave no single curve to compare the others with."
    for system in results["systems"]:
        complete = sum(value <= PASSES for value in _values(results, system, "miss"))
        text += f"“{system}” passes all points on {complete} of {len(results['sets'])} sets"
        ratios = _bending_ratios(results, system, ours)
        if ratios:
            text += f", bends {np.median(ratios):.2f} times as much as `{ours}` by the median"
        seconds = _values(results, system, "seconds")
        faster = np.median(_values(results, ours, "seconds")) / np.median(seconds) if seconds else 0
        text += f", and takes 1/{faster:.0f} of its time. " if faster > 1.0 else ". "
    return text.strip()


def _bending_ratios(results: Results, system: str, ours: str) -> list[float]:
    """Bending of a system's curve relative to ours, on the sets where both have a single curve."""
    pairs = [(each["answers"][system], each["answers"][ours]) for each in results["sets"]]
    return [
        theirs["bending"] / own["bending"]
        for theirs, own in pairs
        if "bending" in theirs and "bending" in own
    ]


def _picture(name: str, mesh: Mesh, curves: Mapping[str, SurfaceCurve]) -> renders.Picture:
    colours = {**PEER_COLOURS, **renders.METHOD_COLOURS}
    # Our curve is first, because a picture shows the control points of its first curve.
    shown = [(curves[label], colours[label]) for label in curves]
    return renders.Picture(name, mesh, shown)


def _rendered(pictures: Sequence[renders.Picture], scale: Scale) -> str | None:
    """Render the picture and return its file name; None if there is no curve."""
    shown = [picture for picture in pictures if picture.curves]
    if not shown:
        return None
    renders.render_sheet(shown, report.figures_folder(scale) / CURVES, scale)
    return CURVES


def _shown_picture(name: str | None) -> str:
    if name is None:
        return "There is no picture, because no system gave a single curve."
    return report.figure(
        name,
        "elastic (blue), nicmm (orange), variational (green), MeshLib's projected spline "
        "(yellow), edge-flip loop (black) and signed heat (red) through the same points (Fig. 9)",
    )
