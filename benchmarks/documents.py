"""Figures in README.md and docs/, generated from the data files.

They stand between `<!-- figures: NAME -->` and `<!-- /figures -->`.
"""

from __future__ import annotations

import textwrap
from collections import Counter
from collections.abc import Callable, Mapping
from pathlib import Path

from tests.oracles.corpus import DECLINED, DUE, GOOD, WRONG

from . import report
from .evidence import ROOT, Record, Results

DOCUMENTS = (ROOT / "README.md", *sorted((ROOT / "docs").glob("*.md")))


def generated(records: Mapping[str, Record]) -> dict[Path, str]:
    """The documents with everything in them that data files decide."""
    blocks = {
        name: write(records[name]["results"])
        for name, write in FIGURES.items()
        if name in records and records[name]["code"] is not None
    }
    found = {report.RESULTS: report.results_text(records)}
    for path in DOCUMENTS:
        found[path] = report.with_figures(path.read_text(encoding="utf-8"), blocks)
    return found


def _corpus(results: Results) -> str:
    answers = results["answers"]
    meshes = len({(each["folder"], each["mesh"]) for each in answers})
    counts = Counter(each["verdict"] for each in answers)
    slowest = max(each["seconds"] for each in answers if each["faces"] < SMALL)
    return _item(
        "`python -m benchmarks corpus`, every kind of broken mesh (self-crossing, branching, "
        "flipped, degenerate, in pieces, huge): "
        f"of {len(answers):,} requests on {meshes} meshes {counts[GOOD]:,} curves are good, "
        f"{counts[DUE]} are impossible and answered with an error that says why, "
        f"{_no(counts[DECLINED])} declined though possible, {_no(counts[WRONG])} wrong. Below "
        f"{SMALL:,} faces the slowest takes {slowest:.1f} seconds."
    )


def _messes(results: Results) -> str:
    outcomes, seconds = results["outcomes"], results["seconds"]
    counted = ", ".join(f"{count:,} times {outcome}" for outcome, count in outcomes.items())
    return _item(
        "`python -m benchmarks messes`, surfaces whose vertices are welded at random, with faces "
        f"added, doubled, turned and dropped: of {len(seconds):,} requests {counted}; "
        f"{_no(len(results['findings']))} wrong. The slowest takes {max(seconds):.1f} seconds."
    )


def _fuzz(results: Results) -> str:
    return _item(
        f"`python -m benchmarks fuzz`, hostile input: of {results['cases']:,} cases "
        f"{_no(len(results['findings']), be='')} caused a crash, a hang, several curves or an "
        "error that is not the package's own."
    )


def _no(count: int, be: str = " is") -> str:
    return f"{count or 'none'}{be if count < 2 else be.replace('is', 'are')}"


def _item(text: str) -> str:
    return textwrap.fill(text, 118, initial_indent="- ", subsequent_indent="  ")


SMALL = 20_000
"""Faces of a mesh on which no curve takes long."""

FIGURES: dict[str, Callable[[Results], str]] = {
    "corpus": _corpus,
    "messes": _messes,
    "fuzz": _fuzz,
}
"""The part of a document that a measurement decides, by the name of the measurement."""
