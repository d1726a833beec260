"""What moves a curve on degraded meshes: the faces, or another course that is chosen there.

A curve on the clean mesh names faces and barycentrics, so it is a curve on the degraded one too.
Where relaxation begins with it, it can only be the faces that move it. On the clean mesh itself the
order of the vertices must not move it.
"""

from __future__ import annotations

from collections import defaultdict

import numpy as np

import nicmm_core as nicmm
from nicmm_core.geometry.array_types import FloatArray, IntArray
from nicmm_core.geometry.curve import SurfaceCurve, curve_on_mesh
from tests.oracles.distances import distances
from tests.oracles.perturbation import perturbed

from . import collections, report
from .samples import random_sets
from .scale import Scale

SEED = 11

SEVERITIES = (32, 8, 2, 1)
"""One face in every n is drawn, as in `degraded`."""

REORDERED = "clean mesh, vertices in another order"
FROM_NOTHING = "1 in {}, from nothing"
FROM_CLEAN = "1 in {}, begun with the clean mesh's curve"


def run(scale: Scale) -> None:
    """Compare every curve with that of the clean mesh, in percent of the diagonal."""
    severities = SEVERITIES if scale is not Scale.SMOKE else SEVERITIES[-1:]
    offsets: dict[str, list[FloatArray]] = defaultdict(list)  # mean and greatest
    lower = pairs = 0
    surfaces = collections.surfaces(scale, scale.choose(12, 6, 1))
    for number, (_, clean, points) in enumerate(random_sets(surfaces, 1, SEED)):
        curve = _design(clean, points).curves[0]
        found = {REORDERED: _in_another_order(clean, points, number)}
        for n in severities:
            mesh, _ = perturbed(clean, n, np.random.default_rng([SEED, number, n]), points)
            plain, carried = _design(mesh, points), _carried(mesh, curve)
            found[FROM_NOTHING.format(n)] = plain.curves[0]
            found[FROM_CLEAN.format(n)] = carried.curves[0]
            pairs += 1
            lower += carried.energy["smooth"] < plain.energy["smooth"]
        for name, other in found.items():
            offsets[name].append(100.0 * np.array(distances(other, curve)) / clean.diagonal)
    rows = []
    for name, both in offsets.items():
        means, greatest = np.array(both).T
        quartiles = " · ".join(f"{value:.2f}" for value in np.percentile(means, [25, 50, 75]))
        rows.append((name, quartiles, f"{np.median(greatest):.2f}"))
    header = ("curve", "mean distance, %, quartiles", "greatest distance, %, median")
    body = (
        f"Seed {SEED}, `nicmm`, one set of 3–5 random vertices a mesh, shortest order, on "
        f"{len(offsets[REORDERED])} meshes ({collections.label(scale)}), degraded as in "
        "`degraded`. Distances to the curve that the clean mesh gets, relative to the diagonal. "
        f"Of {pairs} degraded meshes {lower} get less bending energy begun with the clean "
        "mesh's curve than from nothing.\n\n" + report.table(header, rows)
    )
    report.write_section("degraded_start", "What moves a curve on degraded meshes", body, scale)


def _design(mesh: nicmm.Mesh, points: IntArray) -> nicmm.Design:
    return nicmm.design_curve(mesh, points, order="shortest")


def _in_another_order(mesh: nicmm.Mesh, points: IntArray, number: int) -> SurfaceCurve:
    """The curve on the same mesh with its vertices in a random order."""
    number_of = np.random.default_rng([SEED, number]).permutation(len(mesh.vertices))
    vertices = np.empty_like(mesh.vertices)
    vertices[number_of] = mesh.vertices
    return _design(nicmm.Mesh(vertices, number_of[mesh.faces]), number_of[points]).curves[0]


def _carried(mesh: nicmm.Mesh, curve: SurfaceCurve) -> nicmm.Design:
    """The design that goes on from the curve with the same faces and barycentrics."""
    start = curve_on_mesh(mesh, curve.closed, curve.faces, curve.barycentric, curve.control_index)
    index = np.asarray(curve.control_index)
    points = nicmm.SurfacePoints(curve.faces[index], curve.barycentric[index])
    return nicmm.Designer(mesh).design(points, start=start)
