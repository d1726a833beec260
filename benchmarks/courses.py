"""How fair the course of a curve is, and whether the surface alone decides it.

The best curve known for a request is the one of least energy among the default, the start by the
network, paths over random smooth fields and hop graphs with random weights, all relaxed. None of
these is chosen by its result.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable, Iterator
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
from .samples import random_sets
from .scale import Scale

SEED = 23

FIELD, SMOOTHING = 0.6, 8
"""Standard deviation of the logarithm of lengths in a random field, and its averagings."""

WEIGHTS = 0.4
"""The same for the cells of a hop graph, without averaging."""

MOVED = 0.01
"""Distance, relative to the diagonal, from which a curve counts as moved."""

DEFAULT, NETWORK = "default", "start by the network alone"
FIELDS, GRAPHS = "paths over random fields", "hop graphs with random weights"


def run(scale: Scale) -> None:
    """Compare the default with the best known, and with itself on changed meshes."""
    starts = scale.choose(8, 4, 1)
    ratios: dict[tuple[str, str], list[float]] = defaultdict(list)
    moved: dict[tuple[str, str], list[float]] = defaultdict(list)
    surfaces = list(collections.surfaces(scale, scale.choose(12, 4, 1)))
    for number, (_, mesh, points) in enumerate(random_sets(surfaces, 1, SEED)):
        for kind, closed in (("closed", True), ("open", False)):
            every = _portfolio(mesh, points, closed, starts, number)
            energies = _energies(mesh, every)
            best = min(min(values) for values in energies.values())
            for name, values in energies.items():
                ratios[kind, name].append(min(values) / best)
            default = every[DEFAULT][0].curves[0].points
            for name, change in CHANGES.items():
                other = _on_changed(mesh, points, closed, change, number)
                away = farthest_between(default, other) / mesh.diagonal
                moved[kind, name].append(away)
    header = ("start", "curves", "geometric mean", "median", "75 %", "90 %", "greatest")
    rows = [
        (
            name,
            kind,
            f"{np.exp(np.log(values).mean()):.3f}",
            *(f"{value:.2f}" for value in np.percentile(values, [50, 75, 90, 100])),
        )
        for (kind, name), values in ratios.items()
    ]
    moves = [
        (
            name,
            kind,
            f"{100.0 * np.mean(np.array(values) > MOVED):.0f} %",
            f"{100.0 * np.mean(np.array(values) < 1e-6):.0f} %",
        )
        for (kind, name), values in moved.items()
    ]
    body = (
        f"Seed {SEED}, `nicmm`, one set of 3–5 random vertices a mesh, shortest order, on "
        f"{len(surfaces)} meshes ({collections.label(scale)}). Energies with one length scale, the "
        "least length among all curves of a request, relative to the least of all: of the default, "
        f"of the start by the network alone, of {starts} paths over random smooth fields "
        f"(exp({FIELD} x) times the lengths, x averaged {SMOOTHING} times), and of {starts} hop "
        f"graphs with random weights (exp({WEIGHTS} x) at the cells). The lines of several starts "
        "have their best.\n\n" + report.table(header, rows) + "\n\nThe default on the same "
        "surface with other numbers, rotated, moved and scaled, and mirrored, compared with the "
        "default, transformed in the same way.\n\n"
        + report.table(("changed", "curves", "moved by more than 1 %", "within 1e-6"), moves)
    )
    report.write_section("courses", "Which course a curve takes", body, scale)


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
        name: [float(comparable_energies(surface, each.nodes, 1.0, scale)[0]) for each in several]
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
