"""How much fairer curves become with more searches for their courses, and what that takes."""

from __future__ import annotations

import contextlib
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from functools import partial
from itertools import chain
from typing import Any
from unittest import mock

import numpy as np

import nicmm_core as nicmm
from nicmm_core import improvement
from nicmm_core.courses import course_search, uncrossing
from nicmm_core.courses.course_search import COMBINED
from nicmm_core.courses.recombination import recombined
from nicmm_core.geometry.array_types import IntArray
from nicmm_core.geometry.mesh import Mesh
from nicmm_core.relaxation.curve_energies import energies_of
from nicmm_core.relaxation.curve_nodes import Nodes, curve_surface

from . import collections, report
from .evidence import DESIGN, Results
from .samples import random_sets
from .scale import Scale

TITLE = "Searching longer"
ROOMS = DESIGN
TIMED = True

SEED = 31

VARIATIONAL = "variational"

MOST = 4
"""Greatest effort, relative to the default."""

EFFORTS: Mapping[str, tuple[int, int, int]] = {
    "one search": (0, 0, 1),
    "repeated searches": (improvement.FURTHER_SEARCHES, 0, 1),
    "default": (improvement.FURTHER_SEARCHES, improvement.SEARCHES_FOR_PARTS, 1),
    f"{MOST} times the default": (
        MOST * improvement.FURTHER_SEARCHES,
        MOST * improvement.SEARCHES_FOR_PARTS,
        MOST,
    ),
}
"""Numbers of repeated searches and of searches for parts, and a factor for the bound on work."""


def measure(scale: Scale) -> Results:
    """Design every request with every effort, and by the variational method."""
    surfaces = collections.surfaces(scale, scale.choose(24, 4, 1))
    if scale is not Scale.SMOKE:
        others = (collections.clean(scale.choose(6, 1)), collections.bodies(scale.choose(6, 1)))
        surfaces = chain(surfaces, *others)
    requests = []
    for name, mesh, points in random_sets(surfaces, 1, SEED):
        if not requests:
            _timed(mesh, points, VARIATIONAL)  # warm-up: imports and caches
        with contextlib.suppress(nicmm.UnreachableError):
            requests.append({"mesh": name, **_compared(mesh, points)})
            print(f"  {name}: {requests[-1]}", flush=True)
    return {
        "seed": SEED,
        "meshes": collections.label(scale),
        "efforts": list(EFFORTS),
        "left out": list(LEFT_OUT),
        "requests": requests,
    }


def section(results: Results) -> str:
    """Energies and times by effort and by the part left out."""
    requests = results["requests"]
    energies = np.array([each["energies"] for each in requests])
    seconds = np.array([each["seconds"] for each in requests])
    default = results["efforts"].index("default")
    rows = []
    for number, name in enumerate(results["efforts"]):
        energy, spent = energies[:, number], seconds[:, number]
        ratio = np.median(spent / np.array([each["variational"] for each in requests]))
        rows.append(
            (
                name,
                f"{np.exp(np.log(energy).mean()):.3f}",
                *(f"{value:.2f}" for value in np.percentile(energy, [50, 90, 100])),
                f"{spent.mean():.2f}",
                *(f"{value:.2f}" for value in np.percentile(spent, [50, 100])),
                f"{ratio:.2f}",
            )
        )
    parts = []
    for number, name in enumerate(results["left out"], len(results["efforts"])):
        ratio = energies[:, number] / energies[:, default]
        parts.append(
            (
                name,
                f"{np.exp(np.log(ratio).mean()):.3f}",
                *(int(count) for count in ((ratio > 1.02).sum(), (ratio < 0.98).sum())),
                f"{seconds[:, number].mean() / seconds[:, default].mean():.2f}",
            )
        )
    header = (
        "effort", "energy: geometric mean", "median", "90 %", "greatest",
        "seconds: mean", "median", "greatest", "relative to variational",
    )  # fmt: skip
    return (
        "The table shows how the energy of a curve and the time of its design depend on how "
        "long courses are searched for. Each row is an effort: a single search; repeated "
        f"searches (up to {improvement.FURTHER_SEARCHES}) if the curve bends, and combinations of "
        "their courses; these and searches for parts (the default); and "
        f"{MOST} times as many further searches with {MOST} times the bound on work. The "
        f"statistics are over closed curves on {len(requests)} meshes ({results['meshes']}, and "
        "closed manifold meshes, people and animals as they are; one set of 3–5 random vertices "
        f"per mesh, shortest order, seed {results['seed']}). An energy is divided by the least one "
        "of the request, on a common length scale. The last column is the median of the time "
        "divided by that of `variational`. The paper has no corresponding measurement.\n\n"
        + report.table(header, rows)
        + "\n\nIn the next table each row leaves out one part of the search. Energies and the mean "
        "time are divided by those of the default.\n\n"
        + report.table(
            ("left out", "energy: geometric mean", "above 1.02", "below 0.98", "time"), parts
        )
    )


def _compared(mesh: Mesh, points: IntArray) -> Results:
    """Energies, relative to the least one, and seconds; by effort and by the part left out.

    Also the seconds of `variational`.
    """
    designs, seconds = [], []
    every = [_effort(*effort) for effort in EFFORTS.values()]
    for variant in chain(every, map(_without, LEFT_OUT)):
        with variant:
            design, spent = _timed(mesh, points, "elastic")
        designs.append(design)
        seconds.append(round(spent, 3))
    found = [design.resumable for design in designs]
    curves = [each.curve for each in found if each is not None]
    assert found[0] is not None and len(curves) == len(found)
    request = found[0].request
    energies = np.array(energies_of(curve_surface(found[0].mesh), curves, request.smoothness))
    return {
        "energies": [round(float(value), 5) for value in energies / energies.min()],
        "seconds": seconds,
        "variational": round(_timed(mesh, points, VARIATIONAL)[1], 3),
    }


def _timed(mesh: Mesh, points: IntArray, method: str) -> tuple[nicmm.Design, float]:
    """Design a closed curve; return it with the time it takes, including the work on the mesh."""
    started = time.perf_counter()
    design = nicmm.design_curve(mesh, points, order="shortest", method=method)
    return design, time.perf_counter() - started


@contextmanager
def _effort(repeated: int, parts: int, work: int) -> Iterator[None]:
    """Design with other numbers of searches and another bound on work."""
    with (
        mock.patch.object(improvement, "FURTHER_SEEDS", range(1, 1 + repeated)),
        mock.patch.object(improvement, "SEARCHES_FOR_PARTS", parts),
        mock.patch.object(improvement, "MOST_WORK", work * improvement.MOST_WORK),
    ):
        yield


@contextmanager
def _without(name: str) -> Iterator[None]:
    """Design without a part of the search."""
    with LEFT_OUT[name]():
        yield


def _recombined_across(*given: Any) -> tuple[Nodes, IntArray] | None:
    """`recombined` for the courses of several searches only."""
    return recombined(*given) if given[-1] == COMBINED.recombined else None


LEFT_OUT: Mapping[str, Callable[[], Any]] = {
    "combinations within a search": partial(
        mock.patch.object, course_search, "recombined", _recombined_across
    ),
    "combinations across searches": partial(mock.patch.object, improvement, "COMBINED_COURSES", 0),
    "removal of crossings": partial(mock.patch.object, uncrossing, "ROUNDS", 0),
    "repeated searches": partial(mock.patch.object, improvement, "FURTHER_SEEDS", ()),
    "searches for parts": partial(mock.patch.object, improvement, "SEARCHES_FOR_PARTS", 0),
}
"""Parts of the search and what leaves each of them out."""
