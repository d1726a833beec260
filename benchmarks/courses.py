"""How fair the course of a curve is, and whether the surface alone decides it.

The best curve known for a request is the one of least energy among the default, the start by the
network, paths over random smooth fields and hop graphs with random weights, all relaxed. None of
these is chosen by its result.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from unittest import mock

import numpy as np

import nicmm_core as nicmm
from nicmm_core.courses import course_search, course_surface
from nicmm_core.courses.course_search import farthest_between
from nicmm_core.geometry.array_types import FloatArray, IntArray
from nicmm_core.geometry.mesh import Mesh
from nicmm_core.level_set import problem
from nicmm_core.relaxation.curve_nodes import CurveSurface
from nicmm_core.relaxation.elastic_energy import comparable_energies

from . import collections, report
from .evidence import Results
from .samples import random_sets
from .scale import Scale

TITLE = "Which course a curve takes"
WITHOUT = ("outputs",)

SEED = 23

FIELD, SMOOTHING = 0.6, 8
"""Standard deviation of the logarithm of lengths in a random field, and its averagings."""

WEIGHTS = 0.4
"""The same for the cells of a hop graph, without averaging."""

MOVED = 0.01
"""Distance, relative to the diagonal, from which a curve counts as moved."""

DEFAULT, NETWORK = "default", "start by the network alone"
FIELDS, GRAPHS = "paths over random fields", "hop graphs with random weights"

KIND = {True: "closed", False: "open"}


def measure(scale: Scale) -> Results:
    """Compare the default with the best known, and with itself on changed meshes."""
    starts = scale.choose(8, 4, 1)
    surfaces = list(collections.surfaces(scale, scale.choose(12, 4, 1)))
    requests = []
    for number, (name, mesh, points) in enumerate(random_sets(surfaces, 1, SEED)):
        for closed in (True, False):
            every = _portfolio(mesh, points, closed, starts, number)
            default = every[DEFAULT][0].curves[0].points
            moved = {}
            for change_name, change in CHANGES.items():
                other = _on_changed(mesh, points, closed, change, number)
                away = farthest_between(default, other) / mesh.diagonal
                moved[change_name] = round(float(away), 9)
            energies = _energies(mesh, every)
            requests.append({"mesh": name, "closed": closed, "energies": energies, "moved": moved})
    return {
        "seed": SEED,
        "meshes": collections.label(scale),
        "starts": starts,
        "field": FIELD,
        "smoothing": SMOOTHING,
        "weights": WEIGHTS,
        "requests": requests,
    }


def section(results: Results) -> str:
    """Energies relative to the least known, and how far the default moves."""
    requests = results["requests"]
    header = ("start", "curves", "geometric mean", "median", "75 %", "90 %", "greatest")
    return (
        f"Seed {results['seed']}, `nicmm`, one set of 3–5 random vertices a mesh, shortest order, "
        f"on {sum(each['closed'] for each in requests)} meshes ({results['meshes']}). Energies "
        "with one length scale, the least length among all curves of a request, relative to the "
        "least of all: of the default, of the start by the network alone, of "
        f"{results['starts']} paths over random smooth fields (exp({results['field']} x) times "
        f"the lengths, x averaged {results['smoothing']} times), and of {results['starts']} hop "
        f"graphs with random weights (exp({results['weights']} x) at the cells). The lines of "
        "several starts have their best.\n\n"
        + report.table(header, _ratio_rows(requests))
        + "\n\nThe default on the same surface with other numbers, rotated, moved and scaled, and "
        "mirrored, compared with the default, transformed in the same way.\n\n"
        + report.table(
            ("changed", "curves", f"moved by more than {100 * MOVED:g} %", "within 1e-6"),
            _moved_rows(requests),
        )
    )


def _ratio_rows(requests: Sequence[Results]) -> list[tuple[str, ...]]:
    """Statistics of every start's least energy, relative to the least of all starts."""
    ratios: dict[tuple[str, str], list[float]] = defaultdict(list)
    for request in requests:
        best = min(min(values) for values in request["energies"].values())
        for name, values in request["energies"].items():
            ratios[KIND[request["closed"]], name].append(min(values) / best)
    return [
        (
            name,
            kind,
            f"{np.exp(np.log(values).mean()):.3f}",
            *(f"{value:.2f}" for value in np.percentile(values, [50, 75, 90, 100])),
        )
        for (kind, name), values in ratios.items()
    ]


def _moved_rows(requests: Sequence[Results]) -> list[tuple[str, ...]]:
    """How many curves moved on changed meshes."""
    moved: dict[tuple[str, str], list[float]] = defaultdict(list)
    for request in requests:
        for name, away in request["moved"].items():
            moved[KIND[request["closed"]], name].append(away)
    return [
        (
            name,
            kind,
            f"{100.0 * np.mean(np.array(values) > MOVED):.0f} %",
            f"{100.0 * np.mean(np.array(values) < 1e-6):.0f} %",
        )
        for (kind, name), values in moved.items()
    ]


def _portfolio(
    mesh: Mesh, points: IntArray, closed: bool, starts: int, number: int
) -> dict[str, list[nicmm.Design]]:
    def design() -> nicmm.Design:
        return nicmm.design_curve(mesh, points, order="shortest", closed=closed)

    found = {DEFAULT: [design()], FIELDS: [], GRAPHS: []}
    with _without_courses():
        found[NETWORK] = [design()]
    for start in range(starts):
        generator = np.random.default_rng([SEED, number, start])
        with _without_courses(), _random_field(generator):
            found[FIELDS].append(design())
        with _random_weights(generator):
            found[GRAPHS].append(design())
    return found


def _energies(mesh: Mesh, every: dict[str, list[nicmm.Design]]) -> dict[str, list[float]]:
    """Energies with one length scale."""
    curves = {
        name: [each.resumable.curve for each in designs if each.resumable is not None]
        for name, designs in every.items()
    }
    scale = min(curve.length for several in curves.values() for curve in several)
    surface = CurveSurface(mesh, mesh.vertices)  # without maps only the nodes count
    return {
        name: [
            round(float(comparable_energies(surface, each.nodes, 1.0, scale)[0]), 6)
            for each in several
        ]
        for name, several in curves.items()
    }


@contextmanager
def _without_courses() -> Iterator[None]:
    with mock.patch.object(course_surface, "find_courses", lambda *arguments, **named: iter(())):
        yield


@contextmanager
def _random_field(generator: np.random.Generator) -> Iterator[None]:
    """Initial paths with lengths times a smooth random field."""
    build = problem.build_initial_loop

    def with_field(mesh: Mesh, *arguments: object, **named: object) -> object:
        field = generator.standard_normal(len(mesh.vertices))
        for _ in range(SMOOTHING):
            total = np.zeros(len(field))
            np.add.at(total, mesh.edges, field[mesh.edges[:, ::-1]])
            degree = np.bincount(mesh.edges.ravel(), minlength=len(field))
            field = 0.5 * (field + total / np.maximum(degree, 1))
        field = (field - field.mean()) / field.std()
        # Lengths are weighted by the square.
        given = list(arguments)
        given[2:3] = [np.exp(0.5 * FIELD * field)]
        return build(mesh, *given, **named)  # type: ignore[arg-type]

    with mock.patch.object(problem, "build_initial_loop", with_field):
        yield


@contextmanager
def _random_weights(generator: np.random.Generator) -> Iterator[None]:
    """Hop graphs with random factors of the lengths."""
    build = course_search.with_control_points

    def with_weights(graph, points, along, legs, factor, tension):  # type: ignore[no-untyped-def]
        weights = np.exp(WEIGHTS * generator.standard_normal(len(graph.surface.mesh.vertices)))
        factor = weights if factor is None else factor * weights
        return build(graph, points, along, legs, factor, tension)

    with mock.patch.object(course_search, "with_control_points", with_weights):
        yield


Change = Callable[[Mesh, IntArray, np.random.Generator], tuple[Mesh, IntArray, FloatArray, float]]
"""A changed mesh with its points, and the matrix and factor of the change."""


def _renumbered(
    mesh: Mesh, points: IntArray, generator: np.random.Generator
) -> tuple[Mesh, IntArray, FloatArray, float]:
    number = generator.permutation(len(mesh.vertices))
    vertices = np.empty_like(mesh.vertices)
    vertices[number] = mesh.vertices
    faces = number[mesh.faces][generator.permutation(len(mesh.faces))]
    return Mesh(vertices, faces), number[points], np.eye(3), 1.0


def _rotated(
    mesh: Mesh, points: IntArray, generator: np.random.Generator
) -> tuple[Mesh, IntArray, FloatArray, float]:
    matrix = np.linalg.qr(generator.standard_normal((3, 3)))[0]
    matrix *= np.linalg.det(matrix)
    factor = float(generator.uniform(0.1, 10.0))
    return Mesh(factor * mesh.vertices @ matrix.T, mesh.faces), points, matrix, factor


def _mirrored(
    mesh: Mesh, points: IntArray, generator: np.random.Generator
) -> tuple[Mesh, IntArray, FloatArray, float]:
    matrix = np.diag([-1.0, 1.0, 1.0])
    return Mesh(mesh.vertices @ matrix, mesh.faces[:, ::-1]), points, matrix, 1.0


CHANGES: dict[str, Change] = {
    "renumbered": _renumbered,
    "rotated and scaled": _rotated,
    "mirrored": _mirrored,
}


def _on_changed(
    mesh: Mesh, points: IntArray, closed: bool, change: Change, number: int
) -> FloatArray:
    """Points of the default on a changed mesh, brought back."""
    generator = np.random.default_rng([SEED, number])
    changed, there, matrix, factor = change(mesh, points, generator)
    design = nicmm.design_curve(changed, there, order="shortest", closed=closed)
    return design.curves[0].points @ matrix / factor
