"""Measures how soon a design stops after it is cancelled: the time between two checkpoints."""

from __future__ import annotations

import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import Any

import igl
import numpy as np

import nicmm_core as nicmm
from nicmm_core import progress, shapes
from nicmm_core.geometry.array_types import FloatArray, IntArray
from tests.oracles.defects import defective_meshes

from . import report
from .evidence import DESIGN, Results
from .scale import Scale

SOUP = "the same, a soup of triangles"

TITLE = "Cancelling"
TIMED = True
ROOMS = DESIGN

SEED = 0

LONG = 0.1
"""Time between two checkpoints, in seconds, above which a gap is counted."""


@dataclass
class Gaps:
    """Progress function that records CPU time, place and fraction at every checkpoint."""

    seconds: list[float] = field(default_factory=list)
    places: list[str] = field(default_factory=list)
    fractions: list[float] = field(default_factory=list)

    def __call__(self, done: float, _: FloatArray) -> None:
        """Record a checkpoint; the design always continues."""
        self.note(_asking())
        self.fractions.append(done)

    def note(self, place: str) -> None:
        """Record the CPU time now, under the name of a place."""
        self.seconds.append(time.thread_time())
        self.places.append(place)

    @property
    def longest(self) -> tuple[float, str]:
        """Longest time between two checkpoints in seconds, and the places of both."""
        gaps = np.diff(self.seconds)
        place = int(gaps.argmax())
        return float(gaps[place]), f"{self.places[place]} to {self.places[place + 1]}"


def measure(scale: Scale) -> Results:
    """Design curves on large and on difficult meshes, and record every checkpoint."""
    return {
        "seed": SEED,
        "long": LONG,
        "interval": progress.INTERVAL,
        "designs": [_designed(*request) for request in _requests(scale)],
    }


def section(results: Results) -> str:
    """Longest times between two checkpoints, and their places."""
    header = (
        "mesh", "faces", "status", "CPU time (s)", "checkpoints",
        f"gaps longer than {results['long']:g} s", "longest gap (s)", "its two checkpoints",
        "decreases of the fraction",
    )  # fmt: skip
    rows = [
        (
            each["mesh"],
            each["faces"],
            each["status"],
            f"{each['seconds']:.1f}",
            each["questions"],
            each["long"],
            f"{each['longest']:.2f}",
            each["where"],
            each["backwards"],
        )
        for each in results["designs"]
    ]
    return (
        "A design can be cancelled at its checkpoints, and the table shows how far apart they are "
        "on large and on difficult meshes. Each row is one design through random vertices (seed "
        f"{results['seed']}). A gap is the CPU time between two consecutive checkpoints; the "
        "longest one is how long a design may continue after it is cancelled, in addition to the "
        f"{results['interval']:g} s between two calls of the progress function. The places are the "
        "modules of `nicmm_core` that ask. On large meshes the longest gaps are single operations "
        "on arrays of the size of the mesh. The last column counts how often the reported fraction "
        "of the work decreased. The paper has no corresponding measurement.\n\n"
        + report.table(header, rows)
    )


def summary(results: Results) -> str:
    """What the documents say of it."""
    designs = results["designs"]
    small = max(each["longest"] for each in designs if each["faces"] <= 100_000)
    large = max(each["faces"] for each in designs)
    longest = max(d["longest"] for d in designs if d["faces"] == large and d["mesh"] != SOUP)
    soup = next(each["longest"] for each in designs if each["mesh"] == SOUP)
    return report.item(
        f"A design checks for cancellation at least every {small:.2f} seconds of processor time on "
        f"meshes of up to 100,000 faces, every {longest:.2f} seconds at {large / 1e6:.1f} million "
        f"faces, and every {soup:.2f} seconds on a soup of as many triangles "
        "([measured](../benchmarks/RESULTS.md#cancelling))."
    )


def _designed(
    name: str, mesh: nicmm.Mesh, points: IntArray | FloatArray, arguments: dict[str, Any]
) -> Results:
    """One design, with the times between its checkpoints."""
    gaps, designer = Gaps(), nicmm.Designer  # the attribute access loads the core
    with _always_asked():
        gaps.note("start")
        design = designer(mesh).design(points, progress=gaps, **arguments)
        gaps.note("end")
    longest, where = gaps.longest
    return {
        "mesh": name,
        "faces": len(mesh.faces),
        "status": design.status.name.lower(),
        "seconds": round(gaps.seconds[-1] - gaps.seconds[0], 4),
        "questions": len(gaps.fractions),
        "long": int((np.diff(gaps.seconds) > LONG).sum()),
        "longest": round(longest, 4),
        "where": where,
        "backwards": int((np.diff(gaps.fractions) < 0.0).sum()),
    }


@contextmanager
def _always_asked() -> Iterator[None]:
    """Make progress functions be called at every checkpoint."""
    interval = progress.INTERVAL
    progress.INTERVAL = 0.0
    try:
        yield
    finally:
        progress.INTERVAL = interval


def _asking() -> str:
    """Module of the core that called the progress function."""
    frame = sys._getframe(2)
    while frame.f_back is not None:
        name = str(frame.f_globals["__name__"])
        if name.startswith("nicmm_core") and name != "nicmm_core.progress":
            return f"`{name.removeprefix('nicmm_core.')}`"
        frame = frame.f_back
    raise AssertionError("nobody but the core asks")


def _requests(
    scale: Scale,
) -> Iterator[tuple[str, nicmm.Mesh, IntArray | FloatArray, dict[str, Any]]]:
    """Name, mesh, points and arguments of every design."""
    creature = shapes.creature(1, faces=1_300, subdivisions=0)
    for subdivisions in range(scale.choose(2, 2, 1), scale.choose(6, 4, 2)):
        mesh = nicmm.Mesh(*igl.loop(creature.vertices, creature.faces, subdivisions))
        yield f"{subdivisions} Loop subdivisions", mesh, _drawn(mesh, 5), {"order": "shortest"}
    positions = mesh.vertices[_drawn(mesh, 5)]
    yield "the same, points in space", mesh, positions, {"order": "shortest"}
    far = np.linalg.norm(mesh.vertices - mesh.vertices[0], axis=1)
    obstacles = (far < 0.05 * mesh.diagonal).astype(np.float64)
    maps = {"order": "shortest", "obstacles": obstacles, "clearance": 0.01 * mesh.diagonal}
    yield "the same, an obstacle", mesh, _drawn(mesh, 5), maps
    corners = mesh.vertices[mesh.faces].reshape(-1, 3)
    soup = nicmm.Mesh(corners, np.arange(len(corners)).reshape(-1, 3))
    yield SOUP, soup, _drawn(soup, 5), {"order": "shortest"}
    ball = shapes.sphere(scale.choose(6, 5, 3))
    needles = nicmm.Mesh(ball.vertices * [1.0, 1.0, 1e-7], ball.faces)
    yield "needles", needles, _drawn(needles, 5), {"order": "shortest"}
    fins = dict(defective_meshes())["fins"]
    yield "fins", fins, _drawn(fins, 5), {"order": "shortest"}
    ball = shapes.sphere(scale.choose(4, 4, 3))
    many = scale.choose(30, 20, 8)
    yield f"{many} points back and forth", ball, _drawn(ball, many), {}
    yield "variational", ball, _drawn(ball, 5), {"order": "shortest", "method": "variational"}


def _drawn(mesh: nicmm.Mesh, count: int) -> IntArray:
    return np.random.default_rng(SEED).choice(len(mesh.vertices), count, replace=False)
