"""Non-manifold messes: surfaces whose vertices have been welded, and worse, and curves on them.

A mess is a number: `tests.oracles.messes` draws it and says what was wrong with what came.
"""

from __future__ import annotations

from collections import Counter

import numpy as np

from tests.oracles.isolation import isolated_beside
from tests.oracles.messes import MOST_POINTS, MOST_WELDED, SEED, WRONG, answer, most_faces

from . import report
from .evidence import Results
from .scale import Scale

PATIENCE = 60.0
"""Seconds by the wall clock after which a mess hangs."""

WORKERS = 2

TOLD = 500
"""Messes after which a run says how far it is."""

LISTED = 40


TITLE = "Non-manifold messes"


def measure(scale: Scale) -> Results:
    """Ask for curves on many messes, and list what is wrong."""
    count = scale.choose(10_000, 500, 6)
    outcomes: Counter[str] = Counter()
    findings: list[str] = []
    seconds = []
    for done in isolated_beside(answer, range(count), PATIENCE, WORKERS):
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
    """The outcomes, and what is wrong."""
    outcomes, seconds = results["outcomes"], results["seconds"]
    count = len(seconds)
    rows = [(outcome, n, f"{100 * n / count:.2f} %") for outcome, n in outcomes.items()]
    return (
        f"Seed {results['seed']}, {count} meshes of up to {results['most_faces']} faces, closed "
        f"and open, on which up to {results['most_welded']} pairs of vertices were welded, faces "
        "added, doubled, turned and dropped, in chains of these; closed and open curves, "
        f"2–{results['most_points']} points, both orders, a quarter with obstacles "
        "(`tests/oracles/messes.py`). A good curve is one simple curve through all points by "
        "`checker.py`; whether an error is due is decided from the arrays alone "
        "(`feasibility.py`). Where more than three points lie on boundaries or non-manifold "
        "places an order may be impossible; then the error has to name another one, and that one "
        f"has to give a good curve.\n\n**{len(results['findings'])} findings.** CPU seconds a "
        f"mess: median {np.median(seconds):.1f}, 99 % {np.percentile(seconds, 99):.1f}, slowest "
        f"{max(seconds):.1f}.\n\n"
        + "".join(f"- {finding}\n" for finding in results["findings"][:LISTED])
        + report.table(("outcome", "messes", "share"), rows)
    )
