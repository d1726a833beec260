"""Tests the public interface and the file readers with hostile input.

A case is identified by a number: `hostile_input.answer` generates it and judges the answer. It runs
in a separate process, so that crashes, hangs and output from below Python are found as well.
"""

from __future__ import annotations

import re
from collections import Counter, defaultdict

from tests.oracles.hostile_input import SEED, Answer, answer
from tests.oracles.isolation import Isolated, isolated

from . import report
from .evidence import Results
from .progress import resumed
from .scale import Scale

SLOW = 10.0
"""Greatest CPU time of a case in seconds; more is a finding."""

PATIENCE = 60.0
"""Wall-clock time in seconds after which a case counts as hanging."""

MEMORY = 8 * 2**30
"""Limit on the address space in bytes.

A case that needs more has trusted a count in its input.
"""

LISTED = 40

TOLD = 500
"""Number of cases between two progress messages."""


TITLE = "Hostile input"


def measure(scale: Scale) -> Results:
    """Run all cases, and list the findings."""
    cases = scale.choose(10_500, 1_050, 14)
    outcomes: Counter[tuple[str, str]] = Counter()
    findings: list[str] = []
    slowest = 0.0
    for done in resumed(
        "fuzz", scale, range(cases), lambda rest: isolated(answer, rest, PATIENCE, MEMORY)
    ):
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
    """Outcomes by kind of input, and the findings."""
    rows = [
        (kind, sum(of_kind.values()), report.listed(f"{o} {n}" for o, n in of_kind.items()))
        for kind, of_kind in results["outcomes"].items()
    ]
    return (
        f"{results['cases']} cases of hostile input, such as wrong types, extreme numbers and "
        "corrupt files, were passed to the public interface and to the file readers. Each row is a "
        "kind of input with the numbers of its outcomes: the status of a design, *read* files, "
        "*refused* input (an error of the package), the error of the caller's own function, or "
        "*lost* cases (a crash or a hang). A finding is any other exception, any printed output, a "
        "curve that the independent checker faults, a modified input mesh, a crash, or more than "
        f"{SLOW:g} s of CPU time; the slowest case took {results['slowest']:.1f} s "
        f"(`tests/oracles/hostile_input.py`, seed {results['seed']}). The paper has no "
        "corresponding measurement.\n\n"
        f"**{len(results['findings'])} findings.**\n\n"
        + "".join(f"- {finding}\n" for finding in results["findings"][:LISTED])
        + "\n"
        + report.table(("input", "cases", "outcomes"), rows)
    )


def summary(results: Results) -> str:
    """What the documents say of it."""
    is_slow = [re.search(r": took \d+ s$", each) is not None for each in results["findings"]]
    number_of = [each.split()[0] for each in results["findings"]]
    others = {number for number, slow in zip(number_of, is_slow, strict=True) if not slow}
    slow = sum(is_slow)
    text = (
        f"`python -m benchmarks fuzz`, hostile input: of {results['cases']:,} cases "
        f"{report.none_or(len(others), be='')} ended with a crash, a hang, a faulty curve, printed "
        "output or an error of another package."
    )
    if slow:
        text += (
            f" {slow} took more than {SLOW:g} seconds of CPU time, at most "
            f"{results['slowest']:.1f}."
        )
    return report.item(text)


def _faults(done: Isolated[int, Answer]) -> list[str]:
    if done.result is None:
        return [done.failure]
    faults = list(done.result.faults)
    if done.output.strip():
        faults.append(f"printed {done.output.strip()[-300:]!r}")
    if done.seconds > SLOW:
        faults.append(f"took {done.seconds:.0f} s")
    return faults
