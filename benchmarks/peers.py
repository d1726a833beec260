"""Other systems and ours through the same points (Fig. 9)."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

import nicmm_core as nicmm
from nicmm_core.geometry.array_types import FloatArray, IntArray
from nicmm_core.geometry.curve import SurfaceCurve
from nicmm_core.geometry.mesh import Mesh
from nicmm_core.geometry.surface_points import locate_control_points
from nicmm_core.level_set.problem import build_problem

from . import collections, renders, report
from .measures import bending
from .methods import METHODS
from .peer_systems import SYSTEMS, SystemsProcess, Task, missing_packages
from .polylines import NearestPoints, misses
from .samples import random_sets
from .scale import Scale

SEED = 7

PASSES = 1e-3
"""Distance, relative to the diagonal, at which a curve still counts as through a point."""

ON_SURFACE = 1e-4
"""Distance of a polyline, relative to the diagonal, at which it still counts as on the surface."""

PATIENCE = 120.0
"""Seconds that a system may take."""

PEER_COLOURS = dict(
    zip(SYSTEMS, (renders.YELLOW, renders.BLACK, renders.OBSTACLE, renders.WHITE), strict=True)
)


@dataclass
class Marks:
    """What one system did on all sets.

    Attributes
    ----------
    outcomes : list of str
        "one curve" or what there is instead.
    miss : list of float
        Greatest distance of a control point to all that was drawn, relative to the diagonal.
    off : list of float
        Greatest distance of single curves to the surface, relative to the diagonal.
    bend : dict of int to float
        L ∮ κ_g² ds of single curves, by the number of the set.
    seconds : list of float
    """

    outcomes: list[str] = field(default_factory=list)
    miss: list[float] = field(default_factory=list)
    off: list[float] = field(default_factory=list)
    bend: dict[int, float] = field(default_factory=dict)
    seconds: list[float] = field(default_factory=list)


def run(scale: Scale) -> None:
    """Ask every system for a curve through the same points in the same order."""
    systems = _available()
    marks = {name: Marks() for name in (*METHODS, *systems)}
    pictures: list[renders.Picture] = []
    names = []
    process = SystemsProcess()
    surfaces = collections.surfaces(scale, scale.choose(40, 3))
    for name, mesh, points in random_sets(surfaces, 1, SEED):
        try:
            task = task_on(mesh, points)
        except nicmm.UnreachableError as error:
            print(f"  {name}: {error}", flush=True)
            continue
        names.append(name)
        curves: dict[str, SurfaceCurve] = {}
        for method in METHODS:
            _ask_ours(mesh, points, method, marks[method], curves)
        for system in systems:
            reply = process.ask(system, task, PATIENCE)
            if isinstance(reply, str):
                print(f"  {name}: {system}: {reply}", flush=True)
                marks[system].outcomes.append("failed")
                continue
            polylines, seconds = reply
            curve = _marked(mesh, polylines, task, marks[system])
            marks[system].seconds.append(seconds)
            if curve is not None:
                curves[system] = curve
        if len(pictures) < min(4, len(names)):
            pictures.append(_picture(name, mesh, curves))
    process.end()
    body = (
        f"Seed {SEED}, one set of 3–5 random vertices a mesh on {len(names)} meshes "
        f"({collections.label(scale)}: {report.listed(names)}), visited by all in the same order. "
        "Systems that start from a path of edges get ours, on our split mesh. Seconds include "
        f"every system's preparation of the mesh.{_missing()}\n\n"
        f"{_table(marks)}\n\n{_findings(marks, systems)}\n\n{_stills(pictures, scale)}"
    )
    report.write_section("peers", "Other systems (Fig. 9)", body, scale)


def _available() -> list[str]:
    missing = missing_packages()
    return [name for name, (package, _) in SYSTEMS.items() if package not in missing]


def _missing() -> str:
    missing = missing_packages()
    return f" Not installed, so left out: {report.listed(missing)}." if missing else ""


def task_on(mesh: Mesh, points: IntArray) -> Task:
    """What other systems are asked for through some vertices in the shortest order."""
    problem = build_problem(mesh, locate_control_points(mesh, points, True), "shortest")
    working, loop = problem.working, problem.loop
    return Task(
        working.vertices,
        working.faces,
        loop.vertices,
        loop.control_vertices,
        mesh.mean_edge_length,
    )


def _ask_ours(
    mesh: Mesh, points: IntArray, method: str, marks: Marks, curves: dict[str, SurfaceCurve]
) -> None:
    design = nicmm.design_curve(mesh, points, order="shortest", method=method)
    marks.outcomes.append("one curve" if len(design.curves) == 1 else "in pieces")
    drawn = [curve.points for curve in design.curves]
    marks.miss.append(_greatest_miss(drawn, mesh.vertices[points]) / mesh.diagonal)
    marks.seconds.append(design.seconds)
    if len(design.curves) == 1:
        curves[method] = design.curves[0]
        off = NearestPoints(mesh).greatest_distance(design.curves[0].points)
        marks.off.append(off / mesh.diagonal)
        marks.bend[len(marks.outcomes)] = bending(mesh, design.curves[0])


def _marked(
    mesh: Mesh, polylines: Sequence[FloatArray], task: Task, marks: Marks
) -> SurfaceCurve | None:
    """Note what a system drew; its curve where it is a single one."""
    polylines = [line for line in polylines if len(line)]
    if not polylines:
        marks.outcomes.append("nothing")
        return None
    marks.miss.append(_greatest_miss(polylines, task.vertices[task.controls]) / mesh.diagonal)
    if len(polylines) > 1 or len(polylines[0]) < 3:
        marks.outcomes.append("in pieces" if len(polylines) > 1 else "shrunk to a point")
        return None
    marks.outcomes.append("one curve")
    surface = NearestPoints(mesh)
    marks.off.append(surface.greatest_distance(polylines[0]) / mesh.diagonal)
    curve = surface.curve(polylines[0], np.zeros(0, dtype=np.int64))
    marks.bend[len(marks.outcomes)] = bending(mesh, curve)
    return curve


def _greatest_miss(polylines: Sequence[FloatArray], places: FloatArray) -> float:
    each = np.array([[misses(line, place[None]) for place in places] for line in polylines])
    return float(each.min(axis=0).max())


def _table(marks: Mapping[str, Marks]) -> str:
    rows = []
    for name, mark in marks.items():
        sets = len(mark.outcomes)
        others = sorted(set(mark.outcomes) - {"one curve"})
        rows.append(
            (
                name,
                f"{mark.outcomes.count('one curve')} of {sets}",
                report.listed(f"{mark.outcomes.count(o)} {o}" for o in others) or "–",
                f"{sum(value <= PASSES for value in mark.miss)} of {sets}",
                _percent(mark.miss),
                f"{sum(value <= ON_SURFACE for value in mark.off)} of {sets}",
                _percent(mark.off),
                f"{np.median(list(mark.bend.values())):.0f}" if mark.bend else "–",
                f"{np.median(mark.seconds):.3f}" if mark.seconds else "–",
            )
        )
    header = (
        "system", "one curve", "otherwise", "through all points", "misses by, %",
        "on the surface", "leaves it by, %", "L ∮ κ_g² ds", "seconds",
    )  # fmt: skip
    return report.table(header, rows) + (
        f"\n\nMedians over the sets; lengths relative to the diagonal. Through a point means "
        f"within {100 * PASSES:g} %, on the surface within {100 * ON_SURFACE:g} %. Bending and "
        "distance to the surface are those of single curves."
    )


def _percent(values: Sequence[float]) -> str:
    return f"{100 * np.median(values):.3f}" if values else "–"


def _findings(marks: Mapping[str, Marks], systems: Sequence[str]) -> str:
    """Who bends less and who is faster, as measured."""
    ours = marks[METHODS[0]]
    text = (
        "B/surf, which the paper compares with, is an interactive program whose segments are "
        "joined by hand, and is not measured here. "
    )
    if not ours.bend:
        return text + f"`{METHODS[0]}` gave no single curve to compare with."
    for system in systems:
        mark = marks[system]
        complete = sum(value <= PASSES for value in mark.miss)
        faster = np.median(ours.seconds) / np.median(mark.seconds) if mark.seconds else np.nan
        text += f"{system} passes all points in {complete} of {len(mark.outcomes)} sets"
        ratios = [mark.bend[one] / ours.bend[one] for one in mark.bend.keys() & ours.bend.keys()]
        if ratios:
            text += f", bends {np.median(ratios):.2f} times as much as `{METHODS[0]}`"
            if np.median(ratios) < 1.0:
                text += " (less than ours)"
        text += f" and takes 1/{faster:.0f} of its time. " if faster > 1.0 else ". "
    return text.strip()


def _picture(name: str, mesh: Mesh, curves: Mapping[str, SurfaceCurve]) -> renders.Picture:
    colours = {**PEER_COLOURS, **renders.METHOD_COLOURS}
    # Ours is first, since its control points are those that are shown.
    shown = [(curves[label], colours[label]) for label in curves]
    return renders.Picture(name, mesh, shown)


def _stills(pictures: Sequence[renders.Picture], scale: Scale) -> str:
    shown = [picture for picture in pictures if picture.curves]
    if not shown:
        return "No system gave a single curve, so there is no picture."
    path = report.output_folder(scale) / "peers.png"
    renders.render_sheet(shown, path, scale)
    return report.figure(
        path,
        "nicmm (blue), nicmm-paper (orange), variational (green), MeshLib's projected spline "
        "(yellow), edge-flip loop (black) and signed heat (red) through the same points (Fig. 9)",
    )
