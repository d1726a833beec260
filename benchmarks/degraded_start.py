"""Measures why a curve moves on a degraded mesh: because of its faces, or of another course.

A curve on the clean mesh is given by faces and barycentric coordinates, so it is also a curve on
the degraded mesh. If the relaxation starts from it, its course is fixed, and only the shape of the
faces can move it. As a control, the order of the vertices must not move a curve on the clean mesh.
"""

from __future__ import annotations

from collections import defaultdict

import numpy as np

import nicmm_core as nicmm
from nicmm_core.geometry.array_types import IntArray
from nicmm_core.geometry.curve import SurfaceCurve, curve_on_mesh
from tests.oracles.distances import distances
from tests.oracles.perturbation import perturbed

from . import collections, report
from .evidence import DESIGN, Results
from .samples import random_sets
from .scale import Scale

TITLE = "What moves a curve on degraded meshes"
ROOMS = DESIGN

SEED = 11

SEVERITIES = (32, 8, 2, 1)
"""n in "one perturbed face in every n faces", as in `degraded`."""

REORDERED = "clean mesh, vertices in another order"
FROM_NOTHING = "1 in {}, new search for the course"
FROM_CLEAN = "1 in {}, started from the clean mesh's curve"


def measure(scale: Scale) -> Results:
    """Measure distances to the curve on the clean mesh, in percent of the diagonal."""
    severities = SEVERITIES if scale is not Scale.SMOKE else SEVERITIES[-1:]
    found = []
    surfaces = collections.surfaces(scale, scale.choose(12, 6, 1))
    for number, (name, clean, points) in enumerate(random_sets(surfaces, 1, SEED)):
        curve = _design(clean, points).curves[0]
        reordered = _in_another_order(clean, points, number)
        degraded = []
        for n in severities:
            mesh, _ = perturbed(clean, n, np.random.default_rng([SEED, number, n]), points)
            plain, carried = _design(mesh, points), _carried(mesh, curve)
            degraded.append(
                {
                    "n": n,
                    "from_nothing": _offset(plain.curves[0], curve, clean),
                    "from_clean": _offset(carried.curves[0], curve, clean),
                    "lower": bool(carried.energy["smooth"] < plain.energy["smooth"]),
                }
            )
        offset = _offset(reordered, curve, clean)
        found.append({"mesh": name, "reordered": offset, "degraded": degraded})
    return {"seed": SEED, "collection": collections.label(scale), "meshes": found}


def section(results: Results) -> str:
    """Distances by what was changed on the mesh and by the start."""
    meshes = results["meshes"]
    pairs = [pair for mesh in meshes for pair in mesh["degraded"]]
    offsets: dict[str, list[list[float]]] = defaultdict(list)  # mean and greatest
    for mesh in meshes:
        offsets[REORDERED].append(mesh["reordered"])
        for pair in mesh["degraded"]:
            offsets[FROM_NOTHING.format(pair["n"])].append(pair["from_nothing"])
            offsets[FROM_CLEAN.format(pair["n"])].append(pair["from_clean"])
    rows = []
    for name, both in offsets.items():
        means, greatest = np.array(both).T
        quartiles = " · ".join(f"{value:.2f}" for value in np.percentile(means, [25, 50, 75]))
        rows.append((name, quartiles, f"{np.median(greatest):.2f}"))
    header = ("mesh and start", "mean distance, %, quartiles", "greatest distance, %, median")
    return (
        "Curves of `elastic` on degraded meshes were computed twice, with a new search for the "
        "course and started from the curve on the clean mesh, to see whether the faces or another "
        "course move them. Each row is a mesh and a start; its distances are those to the curve on "
        "the clean mesh, in percent of the diagonal. The first row is a control, which should be "
        f"zero. There are {len(meshes)} meshes ({results['collection']}) with one set of 3–5 "
        f"random vertices per mesh (shortest order, seed {results['seed']}), degraded as in the "
        "section on degraded meshes. On "
        f"{sum(pair['lower'] for pair in pairs)} of {len(pairs)} degraded meshes the start from "
        "the clean mesh's curve gives the lower bending energy. The paper shows nearly identical "
        "curves on such meshes (top of Fig. 12) and does not separate these two causes.\n\n"
        + report.table(header, rows)
    )


def summary(results: Results) -> str:
    """What the documents say of it."""
    pairs = [pair for mesh in results["meshes"] for pair in mesh["degraded"]]
    medians = {
        start: [
            np.median([pair[start][0] for pair in pairs if pair["n"] == n])
            for n in sorted({pair["n"] for pair in pairs})
        ]
        for start in ("from_nothing", "from_clean")
    }
    near, far = min(medians["from_nothing"]), max(medians["from_nothing"])
    return report.item(
        "The course depends on how the surface is triangulated, though not on the numbering: on "
        f"degraded meshes the curve is {near:.1f} to {far:.1f} % of the diagonal away from that of "
        f"the clean mesh, by severity (mean distance, median of {len(results['meshes'])} meshes). "
        f"Started from the clean mesh's curve, it stays within {max(medians['from_clean']):.1f} % "
        "(`python -m benchmarks degraded_start`). So there are several courses of about the same "
        "energy."
    )


def _offset(curve: SurfaceCurve, reference: SurfaceCurve, mesh: nicmm.Mesh) -> list[float]:
    """Mean and greatest distance of two curves, in percent of the diagonal."""
    return [round(100.0 * float(each) / mesh.diagonal, 6) for each in distances(curve, reference)]


def _design(mesh: nicmm.Mesh, points: IntArray) -> nicmm.Design:
    return nicmm.design_curve(mesh, points, order="shortest")


def _in_another_order(mesh: nicmm.Mesh, points: IntArray, number: int) -> SurfaceCurve:
    """Curve on the same mesh with its vertices in a random order."""
    number_of = np.random.default_rng([SEED, number]).permutation(len(mesh.vertices))
    vertices = np.empty_like(mesh.vertices)
    vertices[number_of] = mesh.vertices
    return _design(nicmm.Mesh(vertices, number_of[mesh.faces]), number_of[points]).curves[0]


def _carried(mesh: nicmm.Mesh, curve: SurfaceCurve) -> nicmm.Design:
    """Design that starts from the curve with the same faces and barycentric coordinates."""
    start = curve_on_mesh(mesh, curve.closed, curve.faces, curve.barycentric, curve.control_index)
    index = np.asarray(curve.control_index)
    points = nicmm.SurfacePoints(curve.faces[index], curve.barycentric[index])
    return nicmm.Designer(mesh).design(points, start=start)
