"""Measures how fair the course of a curve is, and whether it depends only on the surface.

The best curve known for a request is the one of least energy among the default, the default on
changed meshes, and the curves of `portfolio`.
"""

from __future__ import annotations

import os
from collections import defaultdict
from collections.abc import Callable, Sequence
from functools import partial
from itertools import chain

import numpy as np

import nicmm_core as nicmm
from nicmm_core.courses.comparison import farthest_between
from nicmm_core.geometry.array_types import IntArray
from nicmm_core.geometry.mesh import Mesh

from . import collections, evidence, portfolio, report
from .course_requests import (
    KIND,
    SEED,
    UNCHANGED,
    Answer,
    Asked,
    Similarity,
    answered,
    energy,
    every_request,
)
from .evidence import DESIGN, Results
from .parallel import in_processes
from .progress import resumed
from .scale import Scale

TITLE = "Which course a curve takes"
ROOMS = DESIGN

MOVED = 0.01
"""Distance, relative to the diagonal, from which a curve counts as moved."""

TIE = 0.02
"""Relative difference of two energies below which either course is a right answer."""

DEFAULT, RENUMBERED = "default", "renumbered"

WORKERS = os.cpu_count() or 1
"""Number of processes; a request is measured by one of them, so results do not depend on it."""


def measure(scale: Scale) -> Results:
    """Compare the default with the best curve known, and with itself on changed meshes."""
    renumberings = scale.choose(8, 2, 1)
    full = scale is Scale.FULL  # at other scales, these take less than a minute
    portfolio_of = evidence.load("portfolio")["results"] if full else portfolio.measure(scale)
    known = portfolio_of["requests"]
    requests = []
    workers = 1 if scale is Scale.SMOKE else WORKERS
    compared = partial(_compared, known, renumberings)
    for request in resumed(
        "courses", scale, every_request(scale), lambda rest: in_processes(compared, rest, workers)
    ):
        requests.append(request)
        ratio = request["energies"][DEFAULT][0] / min(map(min, request["energies"].values()))
        print(f"  {request['name']}: {ratio:.3f} of the best known", flush=True)
    return {
        "meshes": collections.label(scale),
        "renumberings": renumberings,
        "requests": requests,
    }


def section(results: Results) -> str:
    """Energies relative to the least known, and how far the default moves."""
    requests = results["requests"]
    header = ("start", "curves", "geometric mean", "median", "75 %", "90 %", "greatest")
    return (
        "Curves through the same points may take different courses; the first table shows how far "
        "the course that `elastic` chooses by default is from the best known one, in energy. Each "
        "row is a kind of start, for closed or open curves, with statistics over "
        f"{sum(each['closed'] for each in requests)} meshes ({results['meshes']}, and closed "
        "manifold meshes, people and animals as they are; one set of 3–5 random vertices per mesh, "
        f"shortest order, seed {SEED}). The values are the energies of the relaxed curves divided "
        "by the least energy of all starts for that request, with a common length scale, the least "
        "length of these curves. The starts are the default, the default on "
        f"{results['renumberings']} renumbered copies of the mesh, and those of the known curves "
        "above. For several starts of a kind the best one counts. The paper has no corresponding "
        "measurement.\n\n"
        + report.table(header, _ratio_rows(requests))
        + "\n\nThe goals for the default are a geometric mean of at most 1.02 for closed curves "
        "and 1.01 for open ones, 90 % at most 1.05 and 1.03, and a greatest value of at most 1.3 "
        "and 1.2.\n\nThe second table tests whether the course depends only on the surface: the "
        "default was computed again after the vertices and faces were renumbered, after the mesh "
        "was rotated, moved and scaled, and after it was mirrored. A curve, transformed back, "
        f"counts as moved if it is somewhere farther than {100 * MOVED:g} % of the diagonal from "
        "the default. It is a tie "
        f"if the energies differ by less than {100 * TIE:g} %: then either course is right.\n\n"
        + report.table(
            (
                "change",
                "curves",
                "moved",
                "moved, without ties (goal 5 %)",
                "moved by less than 1e-6 of the diagonal",
            ),  # fmt: skip
            _moved_rows(requests),
        )
    )


def summary(results: Results) -> str:
    """What the documents say of it."""
    ratios: dict[bool, list[float]] = defaultdict(list)
    moved: dict[str, list[bool]] = defaultdict(list)
    every: list[float] = []
    for request in results["requests"]:
        best = min(min(values) for values in request["energies"].values())
        ratios[request["closed"]].append(min(request["energies"][DEFAULT]) / best)
        for change, several in request["moved"].items():
            moved[change] += [is_moved(each) for each in several]
            every += [each["away"] for each in several]
    closed, open_ = (np.exp(np.log(ratios[kind]).mean()) for kind in (True, False))
    far = report.listed(f"{sum(each)} of {len(each)} {name}" for name, each in moved.items())
    return (
        report.item(
            "Relative to the lowest energy of all starts of `python -m benchmarks courses`, the "
            f"default has {closed:.2f} times as much for closed curves and {open_:.2f} times for "
            f"open ones (geometric means of {len(ratios[True])} each; at most "
            f"{max(ratios[True]):.2f} and {max(ratios[False]):.2f} times) "
            "([measured](../benchmarks/RESULTS.md#which-course-a-curve-takes))."
        )
        + "\n"
        + report.item(
            "The curve does not depend on the numbering, position, orientation or size of the "
            "mesh, because it is designed on a copy that is numbered by position in the principal "
            "frame. When the mesh is changed, a curve counts as another one if it moves by more "
            f"than {100 * MOVED:g} % of the diagonal and its energy changes by more than "
            f"{100 * TIE:g} %. This happens to {far} curves. "
            f"{(np.array(every) < 1e-6).sum()} of all {len(every)} curves stay the same within "
            "1e-6."
        )
    )


def _ratio_rows(requests: Sequence[Results]) -> list[tuple[str, ...]]:
    """Statistics of every start's least energy, relative to the least of all starts."""
    ratios: dict[tuple[str, str], list[float]] = defaultdict(list)
    for request in requests:
        best = min(map(min, request["energies"].values()))
        for name, values in request["energies"].items():
            ratios[KIND[request["closed"]], name].append(min(values) / best)
    return [
        (
            name,
            kind,
            f"{np.exp(np.log(values).mean()):.3f}",
            *(f"{value:.2f}" for value in np.percentile(values, [50, 75, 90, 100])),
        )
        for (kind, name), values in sorted(ratios.items(), key=lambda item: item[0][0])
    ]


def _moved_rows(requests: Sequence[Results]) -> list[tuple[str, ...]]:
    """How many curves moved on changed meshes."""
    moved: dict[tuple[str, str], list[Results]] = defaultdict(list)
    for request in requests:
        for name, several in request["moved"].items():
            moved[name, KIND[request["closed"]]] += several
    rows = []
    for (name, kind), several in sorted(moved.items()):
        away = np.array([each["away"] for each in several])
        shares = (away > MOVED, np.array(list(map(is_moved, several))), away < 1e-6)
        rows.append((name, kind, *(f"{100.0 * share.mean():.1f} %" for share in shares)))
    return rows


def is_moved(answer: Results) -> bool:
    """Whether an answer on a changed mesh is another curve and no tie."""
    return bool(answer["away"] > MOVED and abs(np.log(answer["energy"])) > np.log1p(TIE))


def _compared(known: Results, renumberings: int, asked: Asked) -> Results:
    """Energies of all answers to a request, and how far the default is from itself."""
    default = answered(nicmm.design_curve(asked.mesh, asked.points, **_options(asked)))
    changed = {name: [_on_changed(asked, name, 0)] for name in CHANGES}
    changed[RENUMBERED] += [_on_changed(asked, RENUMBERED, n) for n in range(1, renumberings)]
    curves = {
        DEFAULT: [_terms(default)],
        RENUMBERED: [_terms(each) for each in changed[RENUMBERED]],
    }
    curves |= known[asked.name]["curves"]
    of_changed = [_terms(each) for each in chain(*changed.values())]
    scale = min(length for _, length in chain(of_changed, *curves.values()))
    least = energy(*_terms(default), scale)
    return {
        "name": asked.name,
        "closed": asked.closed,
        "energies": {
            name: [round(energy(*each, scale), 6) for each in several]
            for name, several in curves.items()
            if several
        },
        "moved": {
            name: [
                {
                    "away": round(_distance(answer, default) / asked.mesh.diagonal, 9),
                    "energy": round(energy(*_terms(answer), scale) / least, 6),
                }
                for answer in several
            ]
            for name, several in changed.items()
        },
    }


def _options(asked: Asked) -> dict[str, object]:
    return {"order": "shortest", "closed": asked.closed}


def _terms(answer: Answer) -> tuple[float, float]:
    return answer.bending, answer.length


def _distance(one: Answer, other: Answer) -> float:
    return float(farthest_between(one.points, other.points))


Change = Callable[[Mesh, IntArray, np.random.Generator], tuple[Mesh, IntArray, Similarity]]
"""Makes a changed mesh with its points, and the similarity between the surfaces."""


def _renumbered(
    mesh: Mesh, points: IntArray, generator: np.random.Generator
) -> tuple[Mesh, IntArray, Similarity]:
    number = generator.permutation(len(mesh.vertices))
    vertices = np.empty_like(mesh.vertices)
    vertices[number] = mesh.vertices
    faces = number[mesh.faces][generator.permutation(len(mesh.faces))]
    return Mesh(vertices, faces), number[points], UNCHANGED


def _rotated(
    mesh: Mesh, points: IntArray, generator: np.random.Generator
) -> tuple[Mesh, IntArray, Similarity]:
    matrix = np.linalg.qr(generator.standard_normal((3, 3)))[0]
    matrix *= np.linalg.det(matrix)
    shift = mesh.diagonal * generator.standard_normal(3)
    change = Similarity(matrix, float(generator.uniform(0.1, 10.0)), shift)
    return Mesh(change.done(mesh.vertices), mesh.faces), points, change


def _mirrored(
    mesh: Mesh, points: IntArray, generator: np.random.Generator
) -> tuple[Mesh, IntArray, Similarity]:
    change = Similarity(np.diag([-1.0, 1.0, 1.0]))
    return Mesh(change.done(mesh.vertices), mesh.faces[:, ::-1]), points, change


CHANGES: dict[str, Change] = {
    RENUMBERED: _renumbered,
    "rotated, moved and scaled": _rotated,
    "mirrored": _mirrored,
}


def _on_changed(asked: Asked, name: str, number: int) -> Answer:
    """The default on a changed mesh, brought back."""
    generator = np.random.default_rng([SEED, asked.number, number])
    mesh, points, change = CHANGES[name](asked.mesh, asked.points, generator)
    return answered(nicmm.design_curve(mesh, points, **_options(asked)), change)
