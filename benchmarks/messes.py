"""Tests requests on random non-manifold meshes ("messes"), made by welding vertices and worse.

A mess is identified by a number: `tests.oracles.messes` generates it and judges the answer.
"""

from __future__ import annotations

import os
from collections import Counter

import numpy as np

from tests.oracles.isolation import isolated_beside
from tests.oracles.messes import MOST_POINTS, MOST_WELDED, SEED, WRONG, answer, most_faces

from . import report
from .evidence import DESIGN, Results
from .progress import resumed
from .scale import Scale

PATIENCE = 60.0
"""Wall-clock time in seconds after which a request counts as hanging."""

WORKERS = max(1, (os.cpu_count() or 1) - 1)
"""Number of processes; a mess is measured by one of them, so results do not depend on it."""

TOLD = 500
"""Number of messes between two progress messages."""

LISTED = 40


OUTCOMES = {
    "good curve": "good curves",
    "error where due": "correct refusals, since no curve exists",
    "another order named": "refusals that name an order that works",
}
"""Outcomes that are right, in words."""

TITLE = "Random non-manifold meshes"
ROOMS = DESIGN


def measure(scale: Scale) -> Results:
    """Request curves on many messes, and list the findings."""
    count = scale.choose(600, 300, 2)
    outcomes: Counter[str] = Counter()
    findings: list[str] = []
    seconds = []
    for done in resumed(
        "messes",
        scale,
        range(count),
        lambda rest: isolated_beside(answer, rest, PATIENCE, WORKERS),
    ):
        outcomes[done.result.outcome if done.result else WRONG] += 1
        seconds.append(done.seconds)
        faults = done.result.faults if done.result else [done.failure]
        if done.output.strip():
            faults = [*faults, f"printed {done.output.strip()[-300:]!r}"]
        if faults:
            kind = done.result.kind if done.result else "?"
            findings.append(f"{done.item} ({kind}): {'; '.join(faults)}")
            print(f"  {findings[-1]}", flush=True)
        if done.item and done.item % TOLD == 0:
            print(f"  {done.item} messes, {len(findings)} findings", flush=True)
    return {
        "seed": SEED,
        "most_faces": most_faces(),
        "most_welded": MOST_WELDED,
        "most_points": MOST_POINTS,
        "outcomes": dict(sorted(outcomes.items())),
        "findings": findings,
        "seconds": [round(value, 2) for value in seconds],
    }


def section(results: Results) -> str:
    """Counts of the outcomes, and the findings."""
    outcomes, seconds = results["outcomes"], results["seconds"]
    count = len(seconds)
    rows = [(outcome, n, f"{100 * n / count:.2f} %") for outcome, n in outcomes.items()]
    return (
        f"One curve was requested on each of {count} random non-manifold meshes, and the table "
        "counts the outcomes. A *good curve* is one simple curve through all points according to "
        "the independent checker. An *error where due* is an error on a request for which no curve "
        "exists, which is decided from the arrays of the mesh alone (`feasibility.py`). If more "
        "than three points lie on boundaries or at non-manifold vertices or edges, an order of the "
        "points may be impossible; then the error must name another order, which must give a good "
        "curve (*another order named*). *Work limit* counts errors because a path winds around "
        "itself too often. All other answers are findings. The meshes are made from "
        f"closed and open surfaces of up to {results['most_faces']} faces: up to "
        f"{results['most_welded']} pairs of vertices are welded, and faces are added, duplicated, "
        "reversed and removed, in chains of these operations (`tests/oracles/messes.py`, seed "
        f"{results['seed']}). The curves are closed and open, through 2–{results['most_points']} "
        "points in both kinds of order, a quarter of them with obstacles. The paper has no "
        f"corresponding measurement.\n\n**{len(results['findings'])} findings.** CPU time per "
        f"mesh: median {np.median(seconds):.1f} s, 99 % quantile "
        f"{np.percentile(seconds, 99):.1f} s, slowest {max(seconds):.1f} s.\n\n"
        + "".join(f"- {finding}\n" for finding in results["findings"][:LISTED])
        + "\n"
        + report.table(("outcome", "meshes", "share"), rows)
    )


def summary(results: Results) -> str:
    """What the documents say of it."""
    outcomes, seconds = results["outcomes"], results["seconds"]
    counted = report.listed(
        f"{outcomes.get(name, 0):,} {words}" for name, words in OUTCOMES.items()
    )
    wrong = report.none_or(len(results["findings"]))
    return report.item(
        "`python -m benchmarks messes`, surfaces whose vertices are welded at random, with faces "
        f"added, duplicated, reversed and removed: of {len(seconds):,} requests {counted}; "
        f"{wrong} wrong. The slowest takes {max(seconds):.1f} seconds."
    )
