"""Finds the best known curve of each request, among many random starts.

The starts are the initial path, paths over random smooth fields, and hop graphs with random
weights, each searched once, all relaxed. None of these is chosen by its result. A known curve stays
one when the search changes, so this is measured again only if the starts or the requests change.
"""

from __future__ import annotations

import os
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from functools import partial
from unittest import mock

import numpy as np

import nicmm_core as nicmm
from nicmm_core import improvement, start_search
from nicmm_core.courses import course_search, course_surface
from nicmm_core.geometry.mesh import Mesh

from .course_requests import SEED, Asked, answered, every_request
from .evidence import Results
from .parallel import in_processes
from .progress import resumed
from .scale import Scale

TITLE = "Known curves"
ROOMS = None

FIELD, SMOOTHING = 0.6, 8
"""Standard deviation of the logarithm of edge lengths in a random field, and the number of times
that the field is averaged over one-rings."""

WEIGHTS = 0.4
"""Standard deviation of the logarithm of the random weights of a hop graph, not averaged."""

PATH = "started by the initial path"
FIELDS, GRAPHS = "paths over random fields", "hop graphs with random weights"

WORKERS = os.cpu_count() or 1
"""Number of processes; a request is measured by one of them, so results do not depend on it."""


def measure(scale: Scale) -> Results:
    """Relax curves from random starts."""
    starts = scale.choose(24, 4, 1)
    requests = {}
    workers = 1 if scale is Scale.SMOKE else WORKERS
    known = partial(_known, starts)
    for name, found in resumed(
        "portfolio", scale, every_request(scale), lambda rest: in_processes(known, rest, workers)
    ):
        requests[name] = found
        print(f"  {name}", flush=True)
    return {"starts": starts, "requests": requests}


def section(results: Results) -> str:
    """What the starts are."""
    requests = results["requests"].values()
    declined = sum(request["declined"] for request in requests)
    found = sum(len(curves) for request in requests for curves in request["curves"].values())
    return (
        "For the comparison of courses below, curves through the same points were relaxed from "
        f"many starts ({len(requests)} requests, seed {SEED}): a curve {PATH}, without a search "
        f"for courses; {results['starts']} initial paths with edge lengths multiplied by a random "
        f"smooth field (exp({FIELD} x), x averaged {SMOOTHING} times); and {results['starts']} hop "
        f"graphs with random weights (exp({WEIGHTS} x) at each cell), each searched once. They "
        f"gave {found} curves; {declined} starts ended in a typed error and do not count. The "
        "length and the bending of a known curve do not depend on the search that is compared "
        "with them, so this is not measured again when the search changes. The paper has no "
        "corresponding measurement."
    )


def _known(starts: int, asked: Asked) -> tuple[str, Results]:
    """Name of a request, and ∮ κ_g² ds and the length of all curves by the kind of their start."""
    designer = nicmm.Designer(asked.mesh)
    found: dict[str, list[Sequence[float]]] = {PATH: [], FIELDS: [], GRAPHS: []}
    declined = 0

    def add(kind: str) -> None:
        nonlocal declined
        try:
            design = designer.design(asked.points, order="shortest", closed=asked.closed)
        except nicmm.NicmmError:
            declined += 1
            return
        curve = answered(design)
        found[kind].append((curve.bending, curve.length))

    with without_courses():
        add(PATH)
    for start in range(starts):
        generator = np.random.default_rng([SEED, asked.number, start])
        with without_courses(), _random_field(generator):
            add(FIELDS)
        with _random_weights(generator):
            add(GRAPHS)
    return asked.name, {"curves": found, "declined": declined}


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
        graph, points, corners, length, factor, tension, normal_bending
    ):
        weights = np.exp(WEIGHTS * generator.standard_normal(len(graph.surface.mesh.vertices)))
        factor = weights if factor is None else factor * weights
        return build(graph, points, corners, length, factor, tension, normal_bending)

    with (
        mock.patch.object(course_search, "with_control_points", with_weights),
        mock.patch.object(improvement, "FURTHER_SEEDS", ()),
        mock.patch.object(improvement, "SEARCHES_FOR_PARTS", 0),
    ):
        yield
