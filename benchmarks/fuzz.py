"""Hostile input for the public interface and the readers; whatever is not typed is a finding.

A case is a number: `hostile_input.answer` draws it and says what was wrong. It runs in a process
of its own, so that crashes, hangs and what is printed below Python are found too.
"""

from __future__ import annotations

from collections import Counter, defaultdict

from tests.oracles.hostile_input import SEED, Answer, answer
from tests.oracles.isolation import Isolated, isolated

from . import report
from .evidence import Results
from .scale import Scale

SLOW = 10.0
"""Seconds of CPU time that no case may take."""

PATIENCE = 60.0
"""Seconds by the wall clock after which a case has hung."""

MEMORY = 8 * 2**30
"""Bytes of address space; a case that asks for more follows some count that it was told."""

LISTED = 40

TOLD = 500
"""Cases after which a run says how far it is."""


TITLE = "Hostile input"


def measure(scale: Scale) -> Results:
    """Ask, and list what is wrong."""
    cases = scale.choose(10_500, 1_050, 42)
    outcomes: Counter[tuple[str, str]] = Counter()
    findings: list[str] = []
    slowest = 0.0
    for done in isolated(answer, range(cases), PATIENCE, MEMORY):
        kind = done.result.kind if done.result else "?"
        outcomes[kind, done.result.outcome if done.result else "lost"] += 1
        slowest = max(slowest, done.seconds)
        if done.item and done.item % TOLD == 0:
            print(f"  {done.item} cases, {len(findings)} findings", flush=True)
        for fault in _faults(done):
            findings.append(f"{done.item} ({kind}): {fault}")
            print(f"  {findings[-1]}", flush=True)
    by_kind: dict[str, dict[str, int]] = defaultdict(dict)
    for (kind, outcome), count in sorted(outcomes.items()):
        by_kind[kind][outcome] = count
    return {
        "seed": SEED,
        "cases": cases,
        "outcomes": by_kind,
        "findings": findings,
        "slowest": round(slowest, 1),
    }


def section(results: Results) -> str:
    """The outcomes of each kind of input, and what is wrong."""
    rows = [
        (kind, sum(of_kind.values()), report.listed(f"{o} {n}" for o, n in of_kind.items()))
        for kind, of_kind in results["outcomes"].items()
    ]
    return (
        f"Seed {results['seed']}, {results['cases']} cases of hostile input, see "
        "`tests/oracles/hostile_input.py`. A finding is an error not the package's own, anything "
        "printed, a curve that `checker.py` faults, a changed mesh, a crash, or more than "
        f"{SLOW:g} s of CPU time; the slowest took {results['slowest']:.1f} s.\n\n"
        f"**{len(results['findings'])} findings.**\n\n"
        + "".join(f"- {finding}\n" for finding in results["findings"][:LISTED])
        + "\n"
        + report.table(("input", "cases", "outcomes"), rows)
    )


def _faults(done: Isolated[int, Answer]) -> list[str]:
    if done.result is None:
        return [done.failure]
    faults = list(done.result.faults)
    if done.output.strip():
        faults.append(f"printed {done.output.strip()[-300:]!r}")
    if done.seconds > SLOW:
        faults.append(f"took {done.seconds:.0f} s")
    return faults
