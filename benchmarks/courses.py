"""Measures how fair the course of a curve is, and whether it depends only on the surface.

The best curve known for a request is the one of least energy among many: the default, the default
on renumbered meshes, the initial path, paths over random smooth fields, and hop graphs with
random weights, each searched once, all relaxed. None of these is chosen by its result.
"""

from __future__ import annotations

import os
from collections import defaultdict
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from itertools import chain
from unittest import mock

import numpy as np

import nicmm_core as nicmm
from nicmm_core import improvement, start_search
from nicmm_core.courses import course_search, course_surface
from nicmm_core.courses.comparison import farthest_between
from nicmm_core.geometry.array_types import FloatArray, IntArray
from nicmm_core.geometry.mesh import Mesh
from nicmm_core.relaxation.curve_nodes import CurveSurface
from nicmm_core.relaxation.discrete_curve import DiscreteCurve
from nicmm_core.relaxation.elastic_energy import comparable_energies

from . import collections, report
from .evidence import DESIGN, Results
from .parallel import in_processes
from .progress import resumed
from .samples import random_sets
from .scale import Scale

TITLE = "Which course a curve takes"
ROOMS = DESIGN

SEED = 23

FIELD, SMOOTHING = 0.6, 8
"""Standard deviation of the logarithm of edge lengths in a random field, and the number of times
that the field is averaged over one-rings."""

WEIGHTS = 0.4
"""Standard deviation of the logarithm of the random weights of a hop graph, not averaged."""

MOVED = 0.01
"""Distance, relative to the diagonal, from which a curve counts as moved."""

TIE = 0.02
"""Relative difference of two energies below which either course is a right answer."""

DEFAULT, PATH, RENUMBERED = "default", "started by the initial path", "renumbered"
FIELDS, GRAPHS = "paths over random fields", "hop graphs with random weights"

KIND = {True: "closed", False: "open"}

WORKERS = os.cpu_count() or 1
"""Number of processes; a request is measured by one of them, so results do not depend on it."""


@dataclass(frozen=True)
class Similarity:
    """x ↦ factor · matrix x + shift, with an orthogonal matrix."""

    matrix: FloatArray
    factor: float = 1.0
    shift: FloatArray | float = 0.0

    def done(self, positions: FloatArray) -> FloatArray:
        """Positions, (n, 3), after it."""
        return self.factor * positions @ self.matrix.T + self.shift

    def undone(self, positions: FloatArray) -> FloatArray:
        """Positions, (n, 3), before it."""
        return (positions - self.shift) @ self.matrix / self.factor


UNCHANGED = Similarity(np.eye(3))


@dataclass(frozen=True)
class Answer:
    """A curve in units of its own, a factor for lengths on the unchanged mesh, and points there."""

    curve: DiscreteCurve
    factor: float
    points: FloatArray

    def energy(self, mesh: Mesh, scale: float) -> float:
        """Energy with a length scale in units of the unchanged mesh."""
        surface = CurveSurface(mesh, mesh.vertices)  # without maps only the nodes count
        return float(comparable_energies(surface, self.curve.nodes, 1.0, scale * self.factor)[0])


@dataclass(frozen=True)
class Job:
    """One request, with the number of random starts of each kind and of renumberings."""

    mesh_name: str
    mesh: Mesh
    points: IntArray
    closed: bool
    number: int
    starts: int
    renumberings: int


def measure(scale: Scale) -> Results:
    """Compare the default with the best curve known, and with itself on changed meshes."""
    starts, renumberings = scale.choose(24, 4, 1), scale.choose(8, 2, 1)
    surfaces = collections.surfaces(scale, scale.choose(48, 4, 1))
    if scale is not Scale.SMOKE:
        others = (collections.clean(scale.choose(12, 2)), collections.bodies(scale.choose(8, 1)))
        surfaces = chain(surfaces, *others)
    jobs = (
        Job(name, mesh, points, closed, number, starts, renumberings)
        for number, (name, mesh, points) in enumerate(random_sets(surfaces, 1, SEED))
        for closed in (True, False)
    )
    requests = []
    workers = 1 if scale is Scale.SMOKE else WORKERS
    for request in resumed(
        "courses", scale, jobs, lambda rest: in_processes(_compared, rest, workers)
    ):
        requests.append(request)
        best = min(map(min, request["energies"].values()))
        ratio = request["energies"][DEFAULT][0] / best
        kind = KIND[request["closed"]]
        print(f"  {request['mesh']}, {kind}: {ratio:.3f} of the best known", flush=True)
    return {
        "seed": SEED,
        "meshes": collections.label(scale),
        "starts": starts,
        "renumberings": renumberings,
        "field": FIELD,
        "smoothing": SMOOTHING,
        "weights": WEIGHTS,
        "requests": requests,
    }


def section(results: Results) -> str:
    """Energies relative to the least known, and how far the default moves."""
    requests = results["requests"]
    alone = next(name for name in requests[0]["energies"] if name.startswith("started by"))
    header = ("start", "curves", "geometric mean", "median", "75 %", "90 %", "greatest")
    return (
        "Curves through the same points may take different courses; the first table shows how far "
        "the course that `elastic` chooses by default is from the best known one, in energy. Each "
        "row is a kind of start, for closed or open curves, with statistics over "
        f"{sum(each['closed'] for each in requests)} meshes ({results['meshes']}, and closed "
        "manifold meshes, people and animals as they are; one set of 3–5 random vertices per mesh, "
        f"shortest order, seed {results['seed']}). The values are the energies of the relaxed "
        "curves divided by the least energy of all starts for that request, with a common length "
        "scale, the least length of these curves. The starts are: the default; the default on "
        f"{results['renumberings']} renumbered copies of the mesh; a curve {alone}, "
        f"without a search for courses; {results['starts']} initial paths with edge lengths "
        f"multiplied by a random smooth field (exp({results['field']} x), x averaged "
        f"{results['smoothing']} times); and {results['starts']} hop graphs with random weights "
        f"(exp({results['weights']} x) at each cell), each searched once. For several starts of a "
        "kind the best one counts. The paper has no corresponding measurement.\n\n"
        + report.table(header, _ratio_rows(requests))
        + "\n\nThe goals for the default are a geometric mean of at most 1.05, 90 % at most 1.15 "
        f"and a greatest value of at most 1.6. {_declined_words(requests)}\n\nThe second table "
        "tests whether the course depends only on the surface: the default was computed again "
        "after the vertices and faces were renumbered, after the mesh was rotated, moved and "
        "scaled, and after it was mirrored. A curve, transformed back, counts as moved if it is "
        f"somewhere farther than {100 * MOVED:g} % of the diagonal from the default. It is a tie "
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


def _declined_words(requests: Sequence[Results]) -> str:
    declined = sum(request["declined"] for request in requests)
    return f"{declined} of the random starts ended in a typed error and do not count."


def _compared(job: Job) -> Results:
    """Energies of all answers to a request, and how far the default is from itself."""
    answers, declined = _portfolio(job)
    changed = {name: [_on_changed(job, name, 0)] for name in CHANGES}
    changed[RENUMBERED] += [_on_changed(job, RENUMBERED, n) for n in range(1, job.renumberings)]
    answers[RENUMBERED] = changed[RENUMBERED]
    every = [*chain(*answers.values()), *chain(*changed.values())]
    scale = min(answer.curve.length / answer.factor for answer in every)
    default = answers[DEFAULT][0]
    least = default.energy(job.mesh, scale)
    return {
        "mesh": job.mesh_name,
        "closed": job.closed,
        "energies": {
            name: [round(answer.energy(job.mesh, scale), 6) for answer in several]
            for name, several in answers.items()
            if several
        },
        "declined": declined,
        "moved": {
            name: [
                {
                    "away": round(_distance(answer, default) / job.mesh.diagonal, 9),
                    "energy": round(answer.energy(job.mesh, scale) / least, 6),
                }
                for answer in several
            ]
            for name, several in changed.items()
        },
    }


def _distance(one: Answer, other: Answer) -> float:
    return float(farthest_between(one.points, other.points))


def _portfolio(job: Job) -> tuple[dict[str, list[Answer]], int]:
    """Answers by the kind of their start, and the number of starts that were declined."""
    designer = nicmm.Designer(job.mesh)
    default = _answer(designer.design(job.points, order="shortest", closed=job.closed))
    found: dict[str, list[Answer]] = {DEFAULT: [default], PATH: [], FIELDS: [], GRAPHS: []}
    declined = 0

    def add(kind: str) -> None:
        nonlocal declined
        try:
            design = designer.design(job.points, order="shortest", closed=job.closed)
            found[kind].append(_answer(design))
        except nicmm.NicmmError:
            declined += 1

    with without_courses():
        add(PATH)
    for start in range(job.starts):
        generator = np.random.default_rng([SEED, job.number, start])
        with without_courses(), _random_field(generator):
            add(FIELDS)
        with _random_weights(generator):
            add(GRAPHS)
    return found, declined


def _answer(design: nicmm.Design, change: Similarity = UNCHANGED) -> Answer:
    """A design on a mesh after a similarity."""
    assert design.resumable is not None  # `elastic` relaxes every curve
    curve, whole = design.resumable.curve, design.curves[0]
    factor = curve.length / whole.length * change.factor
    return Answer(curve, factor, change.undone(whole.points))


@contextmanager
def without_courses() -> Iterator[None]:
    """Designs start from the initial path."""
    with mock.patch.object(course_surface, "find_courses", lambda *arguments, **named: iter(())):
        yield


@contextmanager
def _random_field(generator: np.random.Generator) -> Iterator[None]:
    """Multiply the lengths of initial paths by a smooth random field."""
    build = start_search.find_initial_path

    def with_field(mesh: Mesh, *arguments: object, **named: object) -> object:
        field = generator.standard_normal(len(mesh.vertices))
        for _ in range(SMOOTHING):
            total = np.zeros(len(field))
            np.add.at(total, mesh.edges, field[mesh.edges[:, ::-1]])
            degree = np.bincount(mesh.edges.ravel(), minlength=len(field))
            field = 0.5 * (field + total / np.maximum(degree, 1))
        field = (field - field.mean()) / field.std()
        # The initial path multiplies lengths by the square of this weight.
        given = list(arguments)
        given[2:3] = [np.exp(0.5 * FIELD * field)]
        return build(mesh, *given, **named)  # type: ignore[arg-type]

    with mock.patch.object(start_search, "find_initial_path", with_field):
        yield


@contextmanager
def _random_weights(generator: np.random.Generator) -> Iterator[None]:
    """Multiply the lengths in hop graphs by random factors, and search only once, without parts."""
    build = course_search.with_control_points

    def with_weights(  # type: ignore[no-untyped-def]
        graph, points, corners, along, legs, factor, tension, normal_bending
    ):
        weights = np.exp(WEIGHTS * generator.standard_normal(len(graph.surface.mesh.vertices)))
        factor = weights if factor is None else factor * weights
        return build(graph, points, corners, along, legs, factor, tension, normal_bending)

    with (
        mock.patch.object(course_search, "with_control_points", with_weights),
        mock.patch.object(improvement, "FURTHER_SEEDS", ()),
        mock.patch.object(improvement, "SEARCHES_FOR_PARTS", 0),
    ):
        yield


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


def _on_changed(job: Job, name: str, number: int) -> Answer:
    """The default on a changed mesh, brought back."""
    generator = np.random.default_rng([SEED, job.number, number])
    mesh, points, change = CHANGES[name](job.mesh, job.points, generator)
    design = nicmm.design_curve(mesh, points, order="shortest", closed=job.closed)
    return _answer(design, change)
