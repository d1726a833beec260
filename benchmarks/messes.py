"""Non-manifold messes: surfaces whose vertices have been welded, and worse, and curves on them.

A mess is a number: `tests.oracles.messes` draws it and says what was wrong with what came.
"""

from __future__ import annotations

from collections import Counter

import numpy as np

from tests.oracles.isolation import isolated_beside
from tests.oracles.messes import MOST_POINTS, MOST_WELDED, SEED, WRONG, answer, most_faces

from . import report
from .scale import Scale

PATIENCE = 60.0
"""Seconds by the wall clock after which a mess hangs."""

WORKERS = 2

TOLD = 500
"""Messes after which a run says how far it is."""

LISTED = 40


def run(scale: Scale) -> None:
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
    rows = [(outcome, n, f"{100 * n / count:.2f} %") for outcome, n in sorted(outcomes.items())]
    slowest = np.sort(seconds)[::-1]
    body = (
        f"Seed {SEED}, {count} meshes of up to {most_faces()} faces, closed and open, on which up "
        f"to {MOST_WELDED} pairs of vertices were welded, faces added, doubled, turned and "
        f"dropped, in chains of these; closed and open curves, 2–{MOST_POINTS} points, both "
        "orders, a quarter with obstacles (`tests/oracles/messes.py`). A good curve is one simple "
        "curve through all points by `checker.py`; whether an error is due is decided from the "
        "arrays alone (`feasibility.py`). Where more than three points lie on boundaries or "
        "non-manifold places an order may be impossible; then the error has to name another one, "
        "and that one has to give a good curve.\n\n"
        f"**{len(findings)} findings.** CPU seconds a mess: median {np.median(seconds):.1f}, 99 % "
        f"{np.percentile(seconds, 99):.1f}, slowest {slowest[0]:.1f}.\n\n"
        + "".join(f"- {finding}\n" for finding in findings[:LISTED])
        + report.table(("outcome", "messes", "share"), rows)
    )
    report.write_section("messes", "Non-manifold messes", body, scale)
