"""Generates random non-manifold meshes ("messes") with a request on each, and judges the answers.

A mess is identified by a number. `answer` generates it and lists the faults of the answer, which
must be a good curve according to `checker`, or an error that is due according to `feasibility`.
"""

from __future__ import annotations

import functools
import re
import warnings
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from scipy import sparse
from scipy.sparse import csgraph

import nicmm_core as nicmm
from nicmm_core import shapes
from nicmm_core.geometry.array_types import FloatArray, IntArray

from .checker import judge
from .feasibility import edge_connected_parts, every_order_possible, why_impossible
from .untyped import place_of

SEED = 17

MOST_WELDED = 40
"""Greatest number of welded pairs of vertices per operation."""

MOST_POINTS = 12

NEAR = 3
"""Greatest number of edges between two vertices that count as near each other."""

GOOD, DUE, CAPPED = "good curve", "error where due", "work limit"
ORDER = "another order named"
WRONG = "wrong"

CAP_WORDS = "winds around itself too often"
"""Part of the message for a path that reaches the cap on splits, the only cap that declines."""


@dataclass
class Answer:
    """Kind of a mess, and outcome and faults of the answer."""

    kind: str
    outcome: str = ""
    faults: list[str] = field(default_factory=list)


@dataclass(frozen=True)
class Mess:
    """A mesh, and the request on it."""

    kind: str
    mesh: nicmm.Mesh
    points: nicmm.SurfacePoints
    arguments: dict[str, Any]


def answer(number: int) -> Answer:
    """Answer to the mess with a number."""
    return judged(mess(number))


def judged(asked: Mess) -> Answer:
    """Request the curve and judge the answer."""
    mesh, points, arguments = asked.mesh, asked.points, asked.arguments
    result = Answer(asked.kind)
    with warnings.catch_warnings():
        warnings.simplefilter("always")
        try:
            design = nicmm.design_curve(mesh, points, **arguments)
        except nicmm.NicmmError as error:
            result.outcome, fault = _of_error(asked, error)
            result.faults += fault
            return result
        # Any other exception is a finding.
        except Exception as error:
            result.outcome = WRONG
            result.faults.append(f"{type(error).__name__} at {place_of(error)}: {error}"[:300])
            return result
    result.faults += judge(mesh, design, points, arguments["closed"], arguments["order"]).faults
    if design.status is nicmm.Status.NOT_ONE_CURVE:
        result.faults.append("the status is NOT_ONE_CURVE")
    if not np.isfinite(design.field).all():
        result.faults.append("the field is not finite")
    result.outcome = WRONG if result.faults else GOOD
    return result


def _of_error(asked: Mess, error: nicmm.NicmmError) -> tuple[str, list[str]]:
    """Outcome that an error means, and its faults."""
    obstacles = asked.arguments.get("obstacles")
    if why_impossible(asked.mesh, asked.points, obstacles):
        return DUE, []
    words = f"{type(error).__name__}: {error}"
    if CAP_WORDS in str(error):
        return CAPPED, []
    given = asked.arguments["order"] == "given"
    if given and not every_order_possible(asked.mesh, asked.points, obstacles):
        return _of_order(asked, str(error))
    return WRONG, [f"declined though possible: {words}"[:400]]


def _of_order(asked: Mess, message: str) -> tuple[str, list[str]]:
    """Whether the message about a refused order names another order that gives a good curve.

    Such an order always exists. Whether the refused order is impossible is not decided here.
    """
    named = re.search(r"in the order \[([\d, ]+)\], which works", message)
    if named is None:
        return WRONG, [f"no order is named though there is one: {message}"[:400]]
    order = np.array([int(number) for number in named.group(1).split(",")])
    found = judged(replace(asked, points=asked.points[order]))
    if found.outcome != GOOD:
        faults = "; ".join(found.faults) or found.outcome
        return WRONG, [f"the order that the message names does not work: {faults}"[:400]]
    return ORDER, []


def mess(number: int) -> Mess:
    """Mess with a number."""
    generator = np.random.default_rng([SEED, number])
    name, base = _bases()[generator.integers(len(_bases()))]
    vertices, faces = base.vertices.copy(), base.faces.copy()
    if generator.random() < 0.3:
        vertices, faces = _with_loose_parts(generator, vertices, faces)
    kinds = [name]
    for _ in range(_count(generator, 1, 4)):
        operation = _OPERATIONS[generator.integers(len(_OPERATIONS))]
        vertices, changed = operation(generator, vertices, faces)
        if len(changed):
            faces = changed
            kinds.append(operation.__name__.strip("_"))
    mesh = nicmm.Mesh(vertices, faces)
    points, arguments = _request(generator, mesh)
    return Mess(" ".join(kinds), mesh, points, arguments)


def most_faces() -> int:
    """Greatest number of faces of the surfaces that messes are made from."""
    return max(len(mesh.faces) for _, mesh in _bases())


@functools.cache
def _bases() -> tuple[tuple[str, nicmm.Mesh], ...]:
    """Closed and open surfaces of 40 to 400 vertices; most have limbs."""
    creatures = [
        (f"creature {seed}", shapes.creature(seed, resolution=32, faces=faces, subdivisions=0))
        for seed in range(8)
        for faces in (120, 500)
    ]
    plain = {
        "sphere": shapes.sphere(1),
        "large sphere": shapes.sphere(2),
        "disc": shapes.disc(6),
        "torus": shapes.torus(around=12, across=6),
        "annulus": shapes.annulus(5),
        "Möbius strip": shapes.moebius_strip(16, 3),
        "double torus": shapes.double_torus(400, 0),
        "strip": shapes.moebius_strip(12, 1),
    }
    return (*creatures, *plain.items())


Operation = Callable[[np.random.Generator, FloatArray, IntArray], tuple[FloatArray, IntArray]]


def _welded(
    generator: np.random.Generator, vertices: FloatArray, faces: IntArray
) -> tuple[FloatArray, IntArray]:
    """Weld random pairs of vertices."""
    used = np.unique(faces)
    pairs = generator.choice(used, (_count(generator, 1, MOST_WELDED), 2))
    return vertices, _merged(len(vertices), faces, pairs)


def _welded_nearby(
    generator: np.random.Generator, vertices: FloatArray, faces: IntArray
) -> tuple[FloatArray, IntArray]:
    """Weld vertices to others a few edges away, which gives fins, fans and pinched vertices."""
    edges = np.unique(np.sort(faces[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2), axis=1), axis=0)
    size = len(vertices)
    graph = sparse.csr_array((np.ones(len(edges)), edges.T), shape=(size, size))
    pairs = []
    for start in generator.choice(np.unique(faces), _count(generator, 1, MOST_WELDED)).tolist():
        hops = csgraph.dijkstra(graph, directed=False, indices=start, limit=NEAR)
        near = np.flatnonzero(np.isfinite(hops) & (hops > 0))
        if len(near):
            pairs.append((start, int(generator.choice(near))))
    return vertices, _merged(size, faces, np.array(pairs, dtype=np.int64).reshape(-1, 2))


def _extra_faces(
    generator: np.random.Generator, vertices: FloatArray, faces: IntArray
) -> tuple[FloatArray, IntArray]:
    """Add faces between random vertices."""
    used = np.unique(faces)
    if len(used) < 3:
        return vertices, faces
    added = [generator.choice(used, 3, replace=False) for _ in range(_count(generator, 1, 20))]
    return vertices, np.concatenate([faces, added])


def _fins(
    generator: np.random.Generator, vertices: FloatArray, faces: IntArray
) -> tuple[FloatArray, IntArray]:
    """Add faces between existing edges and random vertices."""
    used = np.unique(faces)
    chosen = faces[generator.integers(len(faces), size=_count(generator, 1, 12))][:, :2]
    added = np.column_stack([chosen, generator.choice(used, len(chosen))])
    return vertices, _without_repetition(np.concatenate([faces, added]))


def _doubled(
    generator: np.random.Generator, vertices: FloatArray, faces: IntArray
) -> tuple[FloatArray, IntArray]:
    """Duplicate faces, with the same or the opposite orientation."""
    again = faces[generator.integers(len(faces), size=_count(generator, 1, 12))]
    return vertices, np.concatenate([faces, again[:, generator.permutation(3)]])


def _turned(
    generator: np.random.Generator, vertices: FloatArray, faces: IntArray
) -> tuple[FloatArray, IntArray]:
    """Reverse the orientation of faces."""
    turned = generator.random((len(faces), 1)) < generator.uniform(0.02, 0.5)
    return vertices, np.where(turned, faces[:, ::-1], faces)


def _dropped(
    generator: np.random.Generator, vertices: FloatArray, faces: IntArray
) -> tuple[FloatArray, IntArray]:
    """Remove faces, so that some vertices may belong to no face."""
    return vertices, faces[generator.random(len(faces)) > generator.uniform(0.0, 0.25)]


def _with_loose_parts(
    generator: np.random.Generator, vertices: FloatArray, faces: IntArray
) -> tuple[FloatArray, IntArray]:
    """Add vertices without faces, and a second surface."""
    loose = generator.standard_normal((_count(generator, 1, 5), 3))
    other = _bases()[generator.integers(len(_bases()))][1]
    first = len(vertices) + len(loose)
    shift = generator.choice([0.0, 0.5, 3.0])
    return (
        np.concatenate([vertices, loose, other.vertices + shift]),
        np.concatenate([faces, other.faces + first]),
    )


_OPERATIONS: tuple[Operation, ...] = (
    *[_welded] * 4,
    *[_welded_nearby] * 3,
    _extra_faces,
    _fins,
    _doubled,
    _turned,
    _dropped,
)
"""Operations to choose from at random; frequent ones are repeated."""


def _request(
    generator: np.random.Generator, mesh: nicmm.Mesh
) -> tuple[nicmm.SurfacePoints, dict[str, Any]]:
    """Points, mostly on one part of the surface, and the other arguments of the request."""
    closed = bool(generator.random() < 0.6)
    fewest = 3 if closed else 2
    count = _count(generator, fewest, MOST_POINTS)
    faces = np.arange(len(mesh.faces))
    if generator.random() < 0.85:
        part = edge_connected_parts(mesh)
        faces = np.flatnonzero(part == part[generator.integers(len(faces))])
    if generator.random() < 0.8:
        vertices, first = np.unique(mesh.faces[faces], return_index=True)
        count = min(count, len(vertices))
        chosen = generator.choice(len(vertices), count, replace=False)
        face, corner = np.divmod(first[chosen], 3)
        points = nicmm.SurfacePoints(faces[face], np.eye(3)[corner])
    else:
        chosen = generator.choice(faces, count)
        points = nicmm.SurfacePoints(chosen, generator.dirichlet(np.ones(3), size=count))
    arguments: dict[str, Any] = {
        "closed": closed,
        "order": str(generator.choice(["given", "shortest"])),
    }
    if generator.random() < 0.25:
        arguments["obstacles"] = _obstacles(generator, mesh)
    return points, arguments


def _obstacles(generator: np.random.Generator, mesh: nicmm.Mesh) -> FloatArray:
    """One or two balls of weight 1 or of a lower weight."""
    weights = np.zeros(len(mesh.vertices))
    for _ in range(_count(generator, 1, 2)):
        centre = mesh.vertices[generator.choice(np.unique(mesh.faces))]
        radius = mesh.diagonal * generator.uniform(0.05, 0.35)
        inside = np.linalg.norm(mesh.vertices - centre, axis=1) < radius
        weights[inside] = generator.choice([1.0, 1.0, 1.0, 0.6])
    return weights


def _count(generator: np.random.Generator, least: int, most: int) -> int:
    """Random integer whose logarithm is about uniformly distributed."""
    if most <= least:
        return least
    drawn = np.exp(generator.uniform(np.log(least), np.log(most + 1)))
    return int(min(most, max(least, np.floor(drawn))))


def _merged(size: int, faces: IntArray, pairs: IntArray) -> IntArray:
    """Faces after each pair of vertices is welded, without those that become degenerate."""
    number = np.arange(size)
    for one, other in pairs.tolist():
        number[number == number[other]] = number[one]
    return _without_repetition(number[faces])


def _without_repetition(faces: IntArray) -> IntArray:
    """Faces with three different vertices."""
    return faces[(faces != np.roll(faces, 1, axis=1)).all(axis=1)]
