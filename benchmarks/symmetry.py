"""Symmetric requests: whether the curve through mirror pairs of points is its own mirror image."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from scipy.spatial import cKDTree

import nicmm_core as nicmm
from nicmm_core import shapes
from nicmm_core.courses.comparison import farthest_between
from nicmm_core.geometry.array_types import FloatArray, IntArray
from nicmm_core.geometry.curve import resample
from nicmm_core.geometry.mesh import Mesh

from . import report
from .evidence import Results
from .scale import Scale

TITLE = "Symmetric requests"
WITHOUT = ("outputs",)

SEED = 19

SETS = 2
"""Sets of points on each body, each asked for as a closed and as an open curve."""

LIMBS = (2, 5)
"""Least and greatest number of pairs of limbs."""

SAME = 0.01
"""Distance, relative to the diagonal, up to which a curve is its own mirror image."""

SAMPLES = 2_000

MIRROR = np.array([-1.0, 1.0, 1.0])


def measure(scale: Scale) -> Results:
    """Ask for curves through mirror pairs of points on generated symmetric bodies."""
    requests = []
    for number in range(scale.choose(20, 4, 1)):
        generator = np.random.default_rng([SEED, number])
        mesh = symmetric_body(generator, scale.choose(4, 4, 3))
        designer = nicmm.Designer(mesh)
        for points in _mirror_pairs(mesh, generator, SETS):
            for closed in (True, False):
                # Visited in this order, an open curve is its own mirror image reversed.
                order = "shortest" if closed else "given"
                design = designer.design(points, closed=closed, order=order)
                away = _distance_to_mirror_image(design) / mesh.diagonal
                requests.append({"body": number, "closed": closed, "away": round(away, 9)})
        print(f"  body {number}: {[r['away'] for r in requests[-2 * SETS :]]}", flush=True)
    return {"seed": SEED, "limbs": list(LIMBS), "requests": requests}


def section(results: Results) -> str:
    """How many curves are their own mirror images."""
    rows = []
    for kind, closed in (("closed", True), ("open", False)):
        away = np.array([r["away"] for r in results["requests"] if r["closed"] is closed])
        rows.append(
            (
                kind,
                len(away),
                f"{100 * np.mean(away <= SAME):.0f} %",
                *(f"{100 * value:.2g} %" for value in np.percentile(away, [50, 75, 90, 100])),
            )
        )
    bodies = len({each["body"] for each in results["requests"]})
    header = (
        "curves", "requests", f"within {100 * SAME:g} % (goal 95 %)",
        "median", "75 %", "90 %", "greatest",
    )  # fmt: skip
    return (
        "The table shows whether symmetric requests on symmetric bodies have symmetric curves. "
        "Each row is a kind of curve; the distance is the greatest one between a curve and its "
        f"mirror image, relative to the diagonal. There are {bodies} generated bodies (seed "
        f"{results['seed']}) that are symmetric about a plane, with {results['limbs'][0]}–"
        f"{results['limbs'][1]} pairs of limbs. Closed curves pass two mirror pairs of vertices in "
        "the shortest order; open ones visit them from one side to the other.\n\n"
        + report.table(header, rows)
        + "\n\nThe fairest curve need not be its own mirror image; it and its mirror image then "
        "have the same energy. The paper has no corresponding measurement."
    )


def symmetric_body(generator: np.random.Generator, subdivisions: int) -> Mesh:
    """A body about the origin with pairs of limbs, symmetric about the plane x = 0."""
    ball = shapes.sphere(subdivisions)
    radius = np.ones(len(ball.vertices))
    for _ in range(generator.integers(LIMBS[0], LIMBS[1] + 1)):
        direction = generator.standard_normal(3)
        direction /= np.linalg.norm(direction)
        length, sharpness = generator.uniform(0.5, 1.5), generator.uniform(6.0, 20.0)
        for limb in (direction, direction * MIRROR):
            radius += length * np.exp(sharpness * (ball.vertices @ limb - 1.0))
    return Mesh(ball.vertices * radius[:, None], ball.faces)


def _mirror_pairs(mesh: Mesh, generator: np.random.Generator, count: int) -> Iterator[IntArray]:
    """Sets of four vertices a, b, b', a', where a' is the mirror image of a."""
    distance, image = cKDTree(mesh.vertices).query(mesh.vertices * MIRROR)
    assert distance.max() < 1e-9 * mesh.diagonal
    beside = np.flatnonzero(mesh.vertices[:, 0] > 0.02 * mesh.diagonal)
    for _ in range(count):
        first, second = generator.choice(beside, 2, replace=False)
        yield np.array([first, second, image[second], image[first]])


def _distance_to_mirror_image(design: nicmm.Design) -> float:
    curve = design.curves[0]
    samples: FloatArray = resample(curve.points, SAMPLES, curve.closed)[0]
    return float(farthest_between(samples, samples * MIRROR))
