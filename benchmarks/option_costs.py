"""Processor time of a curve with corners, a mirror, normal bending or curves to avoid."""

from __future__ import annotations

import time
from collections.abc import Callable
from itertools import chain
from typing import Any

import numpy as np

import nicmm_core as nicmm
from nicmm_core.geometry.array_types import IntArray
from nicmm_core.geometry.mesh import Mesh

from . import collections, report
from .evidence import DESIGN, Results
from .samples import random_sets
from .scale import Scale
from .several_curves import drawn
from .symmetry import symmetric_body

TITLE = "What options cost"
ROOMS = DESIGN

SEED = 461

REPEATS = 2
"""Times that each curve is designed; the least time counts."""

NORMAL_BENDING = 0.3
"""Weight of the normal bending, Blender's default."""

CLEARANCE = 0.01
"""Distance from the curve to avoid, in diagonals."""

DRAWS = 10
"""Sets of points that are tried for a curve that avoids another one."""

SIDE = 0.02
"""Least distance of points from the mirror, in diagonals."""

Options = dict[str, Any]


def measure(scale: Scale) -> Results:
    """Time each option beside a curve without it through the same points, on a new Designer."""
    surfaces = collections.surfaces(scale, scale.choose(24, 3, 1))
    if scale is not Scale.SMOKE:
        others = (collections.clean(scale.choose(12, 1)), collections.bodies(scale.choose(4, 1)))
        surfaces = chain(surfaces, *others)
    pairs: dict[str, list[tuple[float, float]]] = {}
    for number, (name, mesh, points) in enumerate(random_sets(surfaces, 1, SEED)):
        generator = np.random.default_rng([SEED, number])
        for closed in (True, False):
            plain: Options = {"closed": closed, "order": "shortest"}
            corners = np.sort(generator.choice(len(points), 2, replace=False))
            _compare(pairs, "corners", mesh, points, plain, {"corners": corners})
            bending = {"normal_bending": NORMAL_BENDING}
            _compare(pairs, "normal bending", mesh, points, plain, bending)
            _compare_avoiding(pairs, mesh, points, plain, generator)
        print(f"  {name}: {_last(pairs)}", flush=True)
    for number in range(scale.choose(30, 4, 1)):
        generator = np.random.default_rng([SEED, number])
        body = symmetric_body(generator, scale.choose(4, 4, 3))
        side = np.flatnonzero(body.vertices[:, 0] > SIDE * body.diagonal)
        points = generator.choice(side, 2, replace=False)
        image = body.vertices[points] * [-1.0, 1.0, 1.0]
        whole = np.concatenate([body.vertices[points], image[::-1]])
        mirror = {"mirror": ((0.0, 0.0, 0.0), (1.0, 0.0, 0.0))}
        with_images = _seconds(lambda body=body, whole=whole: _designed(body, whole, {}))
        symmetric = _seconds(
            lambda body=body, points=points: _designed(body, points, mirror)  # noqa: B023
        )
        if with_images and symmetric:
            pairs.setdefault("mirror", []).append((with_images, symmetric))
    return {"seed": SEED, "pairs": {name: np.round(p, 4).tolist() for name, p in pairs.items()}}


def _compare(
    pairs: dict[str, list[tuple[float, float]]],
    name: str,
    mesh: Mesh,
    points: IntArray,
    plain: Options,
    option: Options,
) -> None:
    """Add the times without an option and with it, unless one of the curves is impossible."""
    without = _seconds(lambda: _designed(mesh, points, plain))
    with_option = _seconds(lambda: _designed(mesh, points, plain | option))
    if without and with_option:
        pairs.setdefault(name, []).append((without, with_option))


def _compare_avoiding(
    pairs: dict[str, list[tuple[float, float]]],
    mesh: Mesh,
    points: IntArray,
    plain: Options,
    generator: np.random.Generator,
) -> None:
    """The same for a curve that avoids another one, through points that this does not separate."""
    try:
        other = _designed(mesh, points, plain)
    except nicmm.UnreachableError:
        return
    option = {"avoid": [other], "clearance": CLEARANCE * mesh.diagonal}
    for _ in range(DRAWS):
        beside = drawn(mesh, [other], generator)
        if beside is None:
            continue
        try:
            _designed(mesh, beside, plain | option)
        except nicmm.UnreachableError:
            continue
        _compare(pairs, "avoid", mesh, beside, plain, option)
        return


def _designed(mesh: Mesh, points: Any, options: Options) -> nicmm.Design:
    """A curve on a mesh of which nothing has been computed before."""
    return nicmm.design_curve(Mesh(mesh.vertices, mesh.faces), points, **options)


def _seconds(design: Callable[[], nicmm.Design]) -> float | None:
    """Processor time of a design; None if it is impossible."""
    times = []
    for _ in range(REPEATS):
        begun = time.process_time()
        try:
            design()
        except (nicmm.UnreachableError, nicmm.ControlPointError):
            return None
        times.append(time.process_time() - begun)
    return min(times)


def _last(pairs: dict[str, list[tuple[float, float]]]) -> str:
    return ", ".join(f"{name} {p[-1][1] / p[-1][0]:.2f}" for name, p in pairs.items())


def section(results: Results) -> str:
    """A row for each option."""
    rows = []
    for name, pairs in results["pairs"].items():
        without, with_option = np.array(pairs).T
        ratios = with_option / without
        rows.append(
            (
                name,
                len(ratios),
                f"{np.exp(np.log(ratios).mean()):.2f}",
                f"{np.median(ratios):.2f}",
                f"{np.percentile(ratios, 90):.2f}",
                f"{with_option.sum() / without.sum():.2f}",
            )
        )
    header = ("option", "curves", "geometric mean", "median", "90 %", "of the sums")
    return (
        "Processor time of a curve with an option, relative to that of the curve without it "
        "through the same points, in one run, each on a new Designer. The meshes are those of "
        "SHREC16 after two Loop subdivisions, clean ones, and bodies; the points are random. "
        "Corners: two of the control points. Normal bending: a weight of "
        f"{NORMAL_BENDING:g}. Avoid: another random curve of the same kind, with a clearance of "
        f"{100 * CLEARANCE:g} % of the diagonal. Mirror: two points of one side of generated "
        "symmetric bodies, compared with the curve through the same points and their mirror "
        f"images.\n\n{report.table(header, rows)}\n\nThe paper has no corresponding measurement."
    )
