"""Symmetric requests: whether the curve through mirror pairs of points is its own mirror image."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
from scipy.spatial import cKDTree

import nicmm_core as nicmm
from nicmm_core import shapes
from nicmm_core.courses.comparison import farthest_between
from nicmm_core.geometry.array_types import FloatArray, IntArray
from nicmm_core.geometry.curve import resample
from nicmm_core.geometry.mesh import Mesh
from nicmm_core.geometry.surface_points import nearest_points
from nicmm_core.relaxation.curve_energies import energies_of
from nicmm_core.relaxation.curve_nodes import CurveSurface, curve_surface
from nicmm_core.relaxation.discrete_curve import DiscreteCurve
from nicmm_core.relaxation.relaxing import relax
from nicmm_core.relaxation.simple_curve import simple_curve
from nicmm_core.relaxation.warm_start import WARM

from . import report
from .evidence import DESIGN, Results
from .scale import Scale

TITLE = "Symmetric requests"
ROOMS = DESIGN

SEED = 19

SETS = 2
"""Sets of points on each body, each asked for as a closed and as an open curve."""

LIMBS = (2, 5)
"""Least and greatest number of pairs of limbs."""

SAME = 0.01
"""Distance, relative to the diagonal, up to which a curve is its own mirror image."""

TIE = 0.02
"""Relative difference of energies below which two curves are equally good."""

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
                answer = {"body": number, "closed": closed, "away": round(away, 9)}
                if away > SAME:
                    answer["symmetric"] = _energy_of_symmetric_curve(design)
                requests.append(answer)
        print(f"  body {number}: {[r['away'] for r in requests[-2 * SETS :]]}", flush=True)
    return {"seed": SEED, "limbs": list(LIMBS), "requests": requests}


def section(results: Results) -> str:
    """How many curves are their own mirror images."""
    rows = []
    for kind, closed in (("closed", True), ("open", False)):
        of_kind = [r for r in results["requests"] if r["closed"] is closed]
        away = np.array([r["away"] for r in of_kind])
        rows.append(
            (
                kind,
                len(away),
                f"{100 * np.mean(away <= SAME):.0f} %",
                f"{100 * np.mean([not _fails(r) for r in of_kind]):.0f} %",
                *(f"{100 * value:.2g} %" for value in np.percentile(away, [50, 75, 90, 100])),
            )
        )
    bodies = len({each["body"] for each in results["requests"]})
    header = (
        "curves", "requests", f"within {100 * SAME:g} %",
        f"within {100 * SAME:g} % or fairer than any symmetric curve found (goal 95 %)",
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
        "have the same energy. So a curve farther than "
        f"{100 * SAME:g} % from its mirror image was compared with symmetric curves: each of its "
        "halves with the mirror image of this half, joined and relaxed. The energies of the better "
        f"of them, relative to that of the default: {_energies(results)}. The default counts as "
        f"fairer unless a symmetric curve has less than {1.0 - TIE:g} times its energy. "
        "The paper has no corresponding measurement."
    )


def _fails(answer: dict[str, Any]) -> bool:
    """Whether a curve is not its own mirror image, and not known to be fairer than such a curve."""
    return answer["away"] > SAME and (answer["symmetric"] or 0.0) < 1.0 - TIE


def _energies(results: Results) -> str:
    """The energies of the symmetric curves in a sentence."""
    energies = [r["symmetric"] for r in results["requests"] if "symmetric" in r]
    return ", ".join("no simple one" if e is None else f"{e:.3g}" for e in energies) or "none"


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


def _energy_of_symmetric_curve(design: nicmm.Design) -> float | None:
    """Energy of the fairest symmetric curve made of one half, relative to that of the curve.

    None if the curve crosses the plane more often than necessary, or if no symmetric curve is
    simple.
    """
    assert design.resumable is not None
    curve, request = design.resumable.curve, design.resumable.request
    surface = curve_surface(design.resumable.mesh)
    relaxed = [
        relax(surface, symmetric, request.smoothness, WARM).discrete_curve
        for side in (1.0, -1.0)
        if (symmetric := _with_mirrored_half(surface, curve, side)) is not None
    ]
    if not relaxed:
        return None
    own, *others = energies_of(surface, [curve, *relaxed], request.smoothness)
    return round(min(others) / own, 4)


def _with_mirrored_half(
    surface: CurveSurface, curve: DiscreteCurve, side: float
) -> DiscreteCurve | None:
    """The half of a curve on one side of the plane x = 0, joined to its mirror image."""
    positions = curve.nodes.positions
    inside = side * positions[:, 0] > 0.0
    if curve.closed:
        first = int(np.argmax(inside & ~np.roll(inside, 1)))
        order = np.roll(np.arange(len(inside)), -first)
    else:
        order = np.arange(len(inside)) if inside[0] else np.arange(len(inside))[::-1]
    order = order[: inside.sum()]
    if not inside[order].all():
        return None
    half = positions[order]
    controls = np.flatnonzero(np.isin(order, curve.control_nodes))
    if 2 * len(controls) != len(curve.control_nodes):
        return None
    # The first node of a curve is a control point.
    first, count = int(controls[0]), 2 * len(half)
    loop = np.roll(np.concatenate([half, half[::-1] * MIRROR]), -first, axis=0)
    at_controls = np.concatenate([controls, count - 1 - controls[::-1]]) - first
    places = nearest_points(surface.mesh, loop)[0]
    return simple_curve(surface, places, at_controls, places[at_controls], curve.closed)
