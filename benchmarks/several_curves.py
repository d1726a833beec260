"""Several curves on one mesh that avoid each other, before and after the first one is edited."""

from __future__ import annotations

import time
from itertools import chain
from typing import Any

import numpy as np
from scipy.spatial import cKDTree

import nicmm_core as nicmm
from nicmm_core.geometry.array_types import FloatArray, IntArray
from nicmm_core.geometry.mesh import Mesh
from nicmm_core.geometry.segment_distances import SegmentDistances, segments_of
from nicmm_core.geometry.surface_points import SurfacePoints
from tests.oracles.checker import judge
from tests.oracles.curve_pairs import contacts
from tests.oracles.separation import proven_apart

from . import collections, report
from .evidence import DESIGN, Results
from .scale import Scale

TITLE = "Several curves on one mesh"
ROOMS = DESIGN

SEED = 46

CURVES = 5
"""Number of curves on each mesh, every second one closed."""

POINTS = 4
"""Number of control points of each curve."""

CLEARANCES = (0.01, 0.0)
"""Distances that the curves keep from each other, in diagonals; one set of curves for each."""

ROOM = 0.015
"""Least distance of control points from earlier curves, in diagonals."""

NEAR = (0.08, 0.4)
"""Least and greatest distance of the points of a curve from its first one, in diagonals."""

MOVED = 0.05
"""Distance by which a control point of the first curve is moved at most, in lengths of it."""

MOVES = 20
"""Number of places to which a point of the first curve is moved, until all curves can follow."""

DRAWS = 100
"""Number of sets of points that are tried for each curve; some are separated by other curves."""

Refusal = dict[str, Any]
"""Message of an error, and whether it was proven right."""


def measure(scale: Scale) -> Results:
    """Design all curves, edit the first one, and design the others again."""
    surfaces = collections.surfaces(scale, scale.choose(8, 2, 1))
    if scale is not Scale.SMOKE:
        clean, bodies = scale.choose(8, 1), scale.choose(4, 1)
        surfaces = chain(surfaces, collections.clean(clean), collections.bodies(bodies))
    sets = []
    for number, (name, mesh) in enumerate(surfaces):
        for share in CLEARANCES:
            generator = np.random.default_rng([SEED, number])
            found = _measured(mesh, share * mesh.diagonal, generator)
            sets.append({"mesh": name, "faces": len(mesh.faces), "clearance": share, **found})
            words = {key: sets[-1][key] for key in ("before", "edited")}
            refusals = found["refused"] + found["blocked"]
            words["refused"] = len(refusals)
            words["not proven"] = [each["message"] for each in refusals if not each["proven"]]
            print(f"  {name}, {share:g}: {words}", flush=True)
    return {"seed": SEED, "curves": CURVES, "sets": sets}


def _measured(mesh: Mesh, clearance: float, generator: np.random.Generator) -> dict[str, Any]:
    """The state of the curves on a mesh, and again after an edit of the first one."""
    designer = nicmm.Designer(mesh)
    designs: list[nicmm.Design] = []
    refused: list[Refusal] = []
    seconds = []
    for index in range(CURVES):
        closed = index % 2 == 1
        for _ in range(DRAWS):
            points = drawn(mesh, designs, generator)
            if points is None:
                continue
            begun = time.process_time()
            try:
                designs.append(
                    designer.design(
                        points,
                        closed=closed,
                        order="shortest",
                        avoid=designs or None,
                        clearance=clearance if designs else 0.0,
                    )
                )
            except (nicmm.UnreachableError, nicmm.ControlPointError) as error:
                refused.append(_refusal(mesh, designs, clearance, points, error))
                continue
            seconds.append(round(time.process_time() - begun, 3))
            break
    before = _state(mesh, designs, clearance)
    edited, kept, blocked = _edited(mesh, designer, designs, clearance, generator)
    return {
        "refused": refused,
        "seconds": seconds,
        "before": before,
        "edited": _state(mesh, edited, clearance),
        "blocked": blocked,
        "kept course": kept,
    }


def _refusal(
    mesh: Mesh,
    avoided: list[nicmm.Design],
    clearance: float,
    vertices: IntArray,
    error: nicmm.NicmmError,
) -> Refusal:
    """The message of an error, and whether an independent program proves that it is right."""
    curves = [design.curves[0] for design in avoided]
    proven = proven_apart(mesh, curves, clearance, vertices)
    return {"message": str(error), "proven": proven}


def drawn(
    mesh: Mesh, designs: list[nicmm.Design], generator: np.random.Generator
) -> IntArray | None:
    """Vertices near each other and away from earlier curves; None if there are not enough."""
    free = np.zeros(len(mesh.vertices), dtype=bool)
    free[mesh.faces] = True
    if designs:
        places = np.concatenate([design.curves[0].points for design in designs])
        free &= cKDTree(places).query(mesh.vertices)[0] > ROOM * mesh.diagonal
    first = int(generator.choice(np.flatnonzero(free)))
    away = np.linalg.norm(mesh.vertices - mesh.vertices[first], axis=1) / mesh.diagonal
    low, high = NEAR[0], generator.uniform(2.0 * NEAR[0], NEAR[1])
    others = np.flatnonzero(free & (away > low) & (away < high))
    if len(others) < POINTS - 1:
        return None
    return np.append(first, generator.choice(others, POINTS - 1, replace=False))


def _edited(
    mesh: Mesh,
    designer: nicmm.Designer,
    designs: list[nicmm.Design],
    clearance: float,
    generator: np.random.Generator,
) -> tuple[list[nicmm.Design], int, list[Refusal]]:
    """All curves after a point of the first one has moved.

    Also how many have kept their courses, and refusals: a point moved to where it closes the way of
    another curve is moved again.
    """
    first, others = designs[0], designs[1:]
    points = first.curves[0].points[first.curves[0].control_index]
    fixed = [each.curves[0].points[each.curves[0].control_index] for each in others]
    away = cKDTree(np.concatenate(fixed)).query(mesh.vertices)[0]
    allowed = np.linalg.norm(mesh.vertices - points[0], axis=1) < MOVED * first.curves[0].length
    choices = np.flatnonzero(allowed & (away > ROOM * mesh.diagonal))
    blocked: list[Refusal] = []
    edited: list[nicmm.Design] = []
    kept = 0
    for place in generator.permutation(choices)[:MOVES]:
        points[0] = mesh.vertices[place]
        edited, kept = [_again(designer, points, first)[0]], 0
        for before, through in zip(others, fixed, strict=True):
            try:
                found, is_kept = _again(designer, through, before, list(edited), clearance)
            except (nicmm.UnreachableError, nicmm.ControlPointError) as error:
                vertices = cKDTree(mesh.vertices).query(through)[1]
                blocked.append(_refusal(mesh, edited, clearance, vertices, error))
                break
            edited.append(found)
            kept += is_kept
        if len(edited) == len(designs):
            break
    return edited, kept, blocked


def _again(
    designer: nicmm.Designer,
    points: FloatArray,
    before: nicmm.Design,
    avoid: list[nicmm.Design] | None = None,
    clearance: float = 0.0,
) -> tuple[nicmm.Design, bool]:
    """A curve designed again, and whether it has kept its course."""
    closed = before.curves[0].closed

    def design(**options: Any) -> nicmm.Design:
        return designer.design(points, closed=closed, avoid=avoid, clearance=clearance, **options)

    try:
        return design(start=before), True
    except nicmm.CurveError:
        return design(), False


def _state(mesh: Mesh, designs: list[nicmm.Design], clearance: float) -> dict[str, Any]:
    """Faults of the curves, contacts between them, and their least distance in clearances."""
    faults, crossings, least = [], 0, np.inf
    for index, design in enumerate(designs):
        curve = design.curves[0]
        through = curve.points[curve.control_index]
        verdict = judge(mesh, design, through, closed=curve.closed, order="given")
        faults += verdict.faults
        for other in designs[:index]:
            crossings += int(contacts(mesh, curve, other.curves[0]) > 0)
            if clearance > 0.0:
                least = min(least, _distance(mesh, curve, other.curves[0], clearance))
    distance = None if np.isinf(least) else round(least / clearance, 4)
    return {"curves": len(designs), "faults": faults, "contacts": crossings, "distance": distance}


def _distance(
    mesh: Mesh, curve: nicmm.SurfaceCurve, other: nicmm.SurfaceCurve, clearance: float
) -> float:
    """Least distance of the points of a curve from another one; infinite if it is large."""
    distances = SegmentDistances(mesh, segments_of(mesh, other), 1.5 * clearance)
    found: FloatArray = distances.at(SurfacePoints(curve.faces, curve.barycentric))
    least = float(found.min())
    return least if least < 1.5 * clearance else np.inf


def section(results: Results) -> str:
    """A row for each clearance and state of the curves."""
    rows = []
    for share in CLEARANCES:
        sets = [each for each in results["sets"] if each["clearance"] == share]
        for words, key in (("designed", "before"), ("after an edit of the first curve", "edited")):
            states = [each[key] for each in sets]
            nearest = [state["distance"] for state in states if state["distance"] is not None]
            rows.append(
                (
                    f"{100 * share:g} %" if share else "none",
                    words,
                    sum(state["curves"] for state in states),
                    sum(len(state["faults"]) for state in states),
                    sum(state["contacts"] for state in states),
                    f"{min(nearest):.3f}" if nearest else "–",
                )
            )
    header = (
        "clearance", "curves", "number", "with a fault", "pairs that meet",
        "least distance, in clearances",
    )  # fmt: skip
    sets = results["sets"]
    refused = sum(len(each["refused"]) for each in sets)
    refusals = [every for each in sets for every in each["refused"] + each["blocked"]]
    unproven = sum(not every["proven"] for every in refusals)
    blocked = sum(len(each["blocked"]) for each in sets)
    kept = sum(each["kept course"] for each in sets)
    again = len(sets) * (results["curves"] - 1)
    return (
        f"On each of {len({each['mesh'] for each in sets})} third-party meshes, "
        f"{results['curves']} curves are designed one after another through random points, open "
        "and closed in turn. Each avoids those before it, with a clearance relative to the "
        f"diagonal or without one. Sets of points that other curves separate are refused "
        f"({refused}), and others are drawn. Then a point of the first curve is moved, and the "
        f"others are designed again: {kept} of {again} keep their courses, "
        f"the others take another one. {blocked} moves close the way of another curve; they are "
        "refused, and other places are drawn. `tests/oracles/separation.py` cuts the mesh along "
        "the avoided curves and bounds distances from them by exact geodesics: it proves that no "
        f"curve exists for {len(refusals) - unproven} of all {len(refusals)} refusals.\n\n"
        + report.table(header, rows)
        + "\n\nThe paper has no corresponding measurement."
    )
