"""Alignment: how much closer a curve runs to a painted lane, and what that costs.

A lane is a painted strip beside the free curve, that is, beside the curve without maps.
"""

from __future__ import annotations

import itertools
import time
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.spatial import cKDTree

import nicmm_core as nicmm
from nicmm_core.geometry.array_types import FloatArray, IntArray
from nicmm_core.geometry.curve import SurfaceCurve, resample
from nicmm_core.geometry.mesh import Mesh
from nicmm_core.geometry.normals import vertex_normals
from nicmm_core.geometry.surface_points import SurfacePoints
from nicmm_core.relaxation.curve_nodes import curve_surface, nodes_at
from nicmm_core.relaxation.discrete_curve import shifted
from tests.oracles.checker import judge

from . import collections, report
from .evidence import DESIGN, Results
from .measures import bending
from .samples import random_sets
from .scale import Scale

TITLE = "Lanes to follow"
ROOMS = DESIGN

SEED = 4

OFFSET = 0.045
"""Distance of a lane from the free curve along the surface, in diagonals."""

LEAST_OFFSET = 0.03
"""Least mean distance of a lane from the free curve in space, in diagonals.

A lane that leads around a limb may come back to the curve.
"""

WIDTH = 0.01
"""Half the width of a lane, as a distance in space from its line, in diagonals."""

LEAST_WIDTH = 0.75
"""Least half-width in mean edge lengths; a narrower lane would be a row of separate spots."""

STRETCH = (0.25, 0.75)
"""Part of the longest leg of the free curve that has a lane beside it, as fractions."""

SAMPLES = 256


@dataclass(frozen=True)
class Lane:
    """A painted lane.

    Attributes
    ----------
    line : (n, 3) float array
        Surface points of the middle line, at even steps along the free curve.
    weights : (V,) float array
        Alignment map: 1 in the lane, 0 elsewhere.
    """

    line: FloatArray
    weights: FloatArray

    def distance(self, curve: SurfaceCurve) -> float:
        """Mean distance from the middle line to a curve."""
        even, _ = resample(curve.points, 2048, curve.closed)
        return float(cKDTree(even).query(self.line)[0].mean())


def measure(scale: Scale) -> Results:
    """Compare curves with and without a lane of weight 1, on closed meshes, people and animals."""
    if scale is Scale.SMOKE:
        meshes = collections.creatures(2)
    else:
        some = collections.bodies(scale.choose(6, 2))
        meshes = itertools.chain(collections.clean(scale.choose(18, 4)), some)
    return {
        "seed": SEED,
        "width": WIDTH,
        "least_width": LEAST_WIDTH,
        "offset": OFFSET,
        "sets": [
            {"mesh": name, "aligned": _aligned(name, mesh, points)}
            for name, mesh, points in random_sets(meshes, 1, SEED)
        ],
    }


def section(results: Results) -> str:
    """The aligned curve relative to the free one."""
    sets = results["sets"]
    aligned = [each["aligned"] for each in sets if each["aligned"] is not None]
    kept = sum(not each["faults"] for each in aligned)
    rows = [
        ("distance of the lane to the curve", *_quartiles(aligned, "distance")),
        ("bending L ∮ κ_g² ds", *_quartiles(aligned, "bending")),
        ("length", *_quartiles(aligned, "length")),
        ("CPU time", *_quartiles(aligned, "time")),
    ]
    return (
        "The table shows how far a painted lane attracts a curve (Eq. 7). Each row is a quantity "
        "of the curve with the lane, divided by that of the free curve through the same points. "
        "Lanes have weight 1 and a width of "
        f"{200 * results['width']:.0f} % of the diagonal or {2 * results['least_width']:g} edges. "
        "They lie beside the middle half of the longest part of the free curve between two control "
        f"points, {100 * results['offset']:.1f} % of the diagonal away on the surface; "
        f"{len(sets) - len(aligned)} of {len(sets)} meshes have no space for one. There is one set "
        f"of 3–5 random vertices per mesh, in the shortest order (seed {results['seed']}). The "
        "time includes the computation of the map.\n\n"
        + report.table(("with the lane / free", "25 %", "median", "75 %", "90 %"), rows)
        + f"\n\n{kept} of {len(aligned)} curves are one simple loop through their points in "
        "order, according to the independent checker. The paper shows alignment in Fig. 13, "
        "without numbers; that curves follow lanes agrees with the paper."
    )


def summary(results: Results) -> str:
    """What the documents say of it."""
    aligned = [each["aligned"] for each in results["sets"] if each["aligned"] is not None]
    half, nearly_all = np.percentile([each["distance"] for each in aligned], [50, 90])
    return report.item(
        f"A curve follows a painted lane that is {100 * results['offset']:g} % of the diagonal "
        "away from it: the median distance of the lane to the curve falls to "
        f"{half:.2f} of the distance without the lane, and to {nearly_all:.2f} or less for nine "
        "curves of ten. A curve goes around an obstacle wherever a path exists."
    )


def _aligned(name: str, mesh: Mesh, points: IntArray) -> Results | None:
    """The aligned curve relative to the free one; None if there is no room for a lane."""
    free, _ = _timed(mesh, points, None)
    lane = lane_beside(mesh, free.curves[0])
    if lane is None:
        print(f"  {name}: no room for a lane", flush=True)
        return None
    free, before = _timed(mesh, points, None)
    aligned, after = _timed(mesh, points, lane.weights)
    curve, other = free.curves[0], aligned.curves[0]
    found = {
        "distance": round(lane.distance(other) / lane.distance(curve), 6),
        "bending": round(bending(mesh, other, SAMPLES) / bending(mesh, curve, SAMPLES), 6),
        "length": round(other.length / curve.length, 6),
        "time": round(after / before, 4),
        "faults": list(judge(mesh, aligned, points, True, "shortest").faults),
    }
    print(
        f"  {name}: lane {found['distance']:.2f}, bending {found['bending']:.2f}, "
        f"time {found['time']:.2f} ({before:.2f} s) {found['faults'] or ''}",
        flush=True,
    )
    return found


def _timed(mesh: Mesh, points: IntArray, weights: FloatArray | None) -> tuple[nicmm.Design, float]:
    """A design and its CPU time in seconds."""
    started = time.process_time()
    design = nicmm.design_curve(mesh, points, order="shortest", alignment=weights)
    return design, time.process_time() - started


def lane_beside(mesh: Mesh, curve: SurfaceCurve) -> Lane | None:
    """A lane on one side of a closed curve; None if it is too close in space on either side."""
    even, segment = resample(curve.points, 4 * SAMPLES, True)
    bounds = np.sort([int((segment < index).sum()) for index in curve.control_index])
    counts = np.diff([*bounds, bounds[0] + len(even)])
    longest = int(counts.argmax())
    span = (bounds[longest] + (np.array(STRETCH) * counts[longest])).astype(int)
    stretch = np.arange(*span) % len(even)
    surface = curve_surface(mesh)
    here = SurfacePoints(curve.faces[segment[stretch]], curve.barycentric[segment[stretch]])
    nodes = nodes_at(surface, here, closed=False)
    along = np.gradient(even, axis=0)[stretch]
    across = np.cross(mesh.face_normals[here.faces], along)
    across /= np.linalg.norm(across, axis=1, keepdims=True)
    every = cKDTree(even)
    for side in (1.0, -1.0):
        length = np.full(len(stretch), OFFSET * mesh.diagonal)
        there, stuck, _ = shifted(surface, nodes, side * across, length)
        line = there.positions[~stuck]
        if len(line) > 1 and every.query(line)[0].mean() > LEAST_OFFSET * mesh.diagonal:
            return Lane(line, _painted(mesh, line, mesh.face_normals[there.places.faces[~stuck]]))
    return None


def _painted(mesh: Mesh, line: FloatArray, normals: FloatArray) -> FloatArray:
    """Map that is 1 at vertices near a line, but not on an opposite side of a thin part."""
    width = max(WIDTH * mesh.diagonal, LEAST_WIDTH * mesh.mean_edge_length)
    distance, nearest = cKDTree(line).query(mesh.vertices)
    facing = (vertex_normals(mesh.vertices, mesh.faces) * normals[nearest]).sum(axis=1) > 0.0
    return ((distance < width) & facing).astype(np.float64)


def _quartiles(aligned: Sequence[Results], name: str) -> list[str]:
    ratios = [each[name] for each in aligned]
    return [f"{value:.2f}" for value in np.quantile(ratios, [0.25, 0.5, 0.75, 0.9])]
