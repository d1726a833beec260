"""Offsets of curves: their error on surfaces with closed forms, and their time."""

from __future__ import annotations

import time
from itertools import chain
from typing import Any

import igl
import numpy as np

import nicmm_core as nicmm
from nicmm_core import shapes
from nicmm_core.geometry.array_types import FloatArray
from nicmm_core.geometry.mesh import Mesh
from nicmm_core.geometry.segment_distances import SegmentDistances, segments_of
from nicmm_core.geometry.surface_points import SurfacePoints, nearest_points

from . import collections, report
from .evidence import DESIGN, Results
from .samples import random_sets
from .scale import Scale

TITLE = "Offsets"
ROOMS = (*DESIGN, "offsets")

SEED = 47

SHARES = (0.01, -0.02, 0.05)
"""Distances, in bounding-box diagonals."""

REPEATS = 2
"""Times that each curve is computed; the least time counts."""

RADIUS = 0.5
"""Distance of the offset of a great circle of the unit sphere, in radians."""

NORMAL = np.array([0.3, 0.5, 0.8]) / np.linalg.norm([0.3, 0.5, 0.8])
"""Normal of the plane of the great circle, which is in no special position to the mesh."""


def measure(scale: Scale) -> Results:
    """Measure offsets of great circles, and of random curves beside the time of these."""
    circles = [_great_circle(level) for level in range(3, scale.choose(7, 6, 5))]
    surfaces = collections.surfaces(scale, scale.choose(24, 3, 1))
    if scale is not Scale.SMOKE:
        others = (collections.clean(scale.choose(12, 1)), collections.bodies(scale.choose(4, 1)))
        surfaces = chain(surfaces, *others)
    curves: list[dict[str, Any]] = []
    for number, (name, mesh, points) in enumerate(random_sets(surfaces, 1, SEED)):
        found = _beside_first_curve(mesh, points, closed=number % 2 == 0)
        if found is not None:
            curves.append({"mesh": name, "faces": len(mesh.faces), **found})
            print(f"  {name}: {found}", flush=True)
    return {"seed": SEED, "circles": circles, "curves": curves}


def _great_circle(level: int) -> dict[str, float]:
    """Error of the offset of a great circle, relative to the distance."""
    mesh = shapes.sphere(level)
    first = np.cross(NORMAL, [1.0, 0.0, 0.0])
    first /= np.linalg.norm(first)
    angle = np.linspace(0.0, 2.0 * np.pi, 7)[:-1, None]
    places = np.cos(angle) * first + np.sin(angle) * np.cross(NORMAL, first)
    curve = nicmm.design_curve(mesh, nearest_points(mesh, places)[0]).curves[0]
    [found] = nicmm.offset_curve(mesh, curve, RADIUS)
    latitude = np.arcsin((found.points @ NORMAL) / np.linalg.norm(found.points, axis=1))
    edge = float(igl.avg_edge_length(mesh.vertices, mesh.faces))
    return {
        "edges": round(RADIUS / edge, 1),
        "error": float(np.abs(latitude / RADIUS - 1.0).max()),
    }


def _beside_first_curve(mesh: Mesh, points: Any, closed: bool) -> dict[str, Any] | None:
    """Times of a first curve and of its offsets, each on a new mesh, and their greatest error."""
    options = {"closed": closed, "order": "shortest"}
    first = []
    for _ in range(REPEATS):
        begun = time.process_time()
        try:
            design = nicmm.design_curve(Mesh(mesh.vertices, mesh.faces), points, **options)
        except (nicmm.UnreachableError, nicmm.ControlPointError):
            return None
        first.append(time.process_time() - begun)
    curve = design.curves[0]
    seconds, errors, number = [], [], []
    for share in SHARES:
        distance, times, found = share * mesh.diagonal, [], []
        for _ in range(REPEATS):
            begun = time.process_time()
            try:
                found = nicmm.offset_curve(Mesh(mesh.vertices, mesh.faces), curve, distance)
            except nicmm.ArgumentError:
                break  # the offset reaches over too many faces
            times.append(time.process_time() - begun)
        seconds.append(round(min(times), 4) if times else None)
        errors.append(_error(mesh, curve, found, abs(distance)) if times else None)
        number.append(len(found))
    return {"first": round(min(first), 4), "seconds": seconds, "error": errors, "number": number}


def _error(
    mesh: Mesh, curve: nicmm.SurfaceCurve, found: list[nicmm.SurfaceCurve], distance: float
) -> float:
    """Greatest error of points and of the middles of segments, relative to the distance."""
    distances = SegmentDistances(mesh, segments_of(mesh, curve), 1.2 * distance)
    greatest = 0.0
    for each in found:
        segments = segments_of(mesh, each)
        middle = SurfacePoints(segments.faces, 0.5 * (segments.start + segments.end))
        for places in (SurfacePoints(each.faces, each.barycentric), middle):
            away: FloatArray = distances.at(places)
            greatest = max(greatest, float(np.abs(away / distance - 1.0).max()))
    return greatest


def section(results: Results) -> str:
    """The errors of great circles, and a row for each distance."""
    circles = [(each["edges"], f"{100 * each['error']:.3f} %") for each in results["circles"]]
    rows = []
    for place, share in enumerate(SHARES):
        done = [each for each in results["curves"] if each["seconds"][place] is not None]
        ratios = np.array([each["seconds"][place] / each["first"] for each in done])
        errors = [each["error"][place] for each in done]
        rows.append(
            (
                f"{100 * share:g} %",
                len(results["curves"]),
                len(results["curves"]) - len(done),
                f"{np.exp(np.log(ratios).mean()):.2f}",
                f"{np.median(ratios):.2f}",
                f"{np.percentile(ratios, 90):.2f}",
                f"{ratios.max():.2f}",
                f"{100 * max(errors):.3f} %",
            )
        )
    header = (
        *("distance", "curves", "too many faces"),
        *("geometric mean", "median", "90 %", "greatest", "error"),
    )
    return (
        f"The offset of a great circle of the unit sphere at a distance of {RADIUS:g}, compared "
        "with the circle of latitude. The error is relative to the distance:\n\n"
        + report.table(("edges to the offset", "greatest error"), circles)
        + "\n\nOffsets of random curves, closed and open in turn, on SHREC16 after two Loop "
        "subdivisions, clean meshes and bodies. Processor time relative to that of the first curve "
        "on a new mesh, including everything that depends on the mesh, in one run; the distance is "
        "relative to the diagonal, and negative to the right. The error is the greatest of all "
        "points and middles of segments, as a fraction of the distance:\n\n"
        + report.table(header, rows)
        + "\n\nThe paper has no corresponding measurement."
    )
