"""Figures in README.md and docs/, generated from the data files.

They stand between `<!-- figures: NAME -->` and `<!-- /figures -->`.
"""

from __future__ import annotations

import textwrap
from collections import Counter, defaultdict
from collections.abc import Callable, Iterable, Mapping
from pathlib import Path

import numpy as np

from tests.oracles.corpus import DECLINED, DUE, GOOD, WRONG

from . import courses, report
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


def _guarantee(results: Results) -> str:
    rows = []
    for label, meshes in _by(results["meshes"], "collection").items():
        curves = [curve for each in meshes for curve in each["curves"]]
        good = sum("error" not in curve and "faults" not in curve for curve in curves)
        share = f"{good} ({100 * good / len(curves):.4g} %)"
        rows.append((f"{len(meshes)}: {label}", len(curves), share, len(curves) - good))
    header = ("meshes", "curves", "one simple curve through all points, in order", "anything else")
    return report.table(header, rows)


def _courses(results: Results) -> str:
    ratios: dict[bool, list[float]] = defaultdict(list)
    moved: dict[str, list[float]] = defaultdict(list)
    for request in results["requests"]:
        best = min(min(values) for values in request["energies"].values())
        ratios[request["closed"]].append(min(request["energies"][courses.DEFAULT]) / best)
        for change, away in request["moved"].items():
            moved[change].append(away)
    closed, open_ = (np.exp(np.log(ratios[kind]).mean()) for kind in (True, False))
    every = [away for several in moved.values() for away in several]
    far = report.listed(
        f"{change} {sum(away > courses.MOVED for away in several)} of {len(several)}"
        for change, several in moved.items()
    )
    return (
        _item(
            "Relative to the least energy of all starts of `python -m benchmarks courses`, the "
            f"default has {closed:.2f} times as much for closed curves and {open_:.2f} times for "
            f"open ones (geometric means of {len(ratios[True])} each; at most "
            f"{max(ratios[True]):.2f} and {max(ratios[False]):.2f} times)."
        )
        + "\n"
        + _item(
            "The surface decides and not its description: the search runs on a copy in the "
            "surface's own frame. Curves that a change of the description moved by more than "
            f"{100 * courses.MOVED:g} % of the diagonal: {far}. Within 1e-6 stay "
            f"{sum(away < 1e-6 for away in every)} of all {len(every)}; rounding decides in the "
            "others."
        )
    )


def _runtime(results: Results) -> str:
    sets = results["sets"]
    methods = list(sets[0]["answers"])
    mean = {
        method: np.array([np.mean(each["answers"][method]["seconds"]) for each in sets])
        for method in methods
    }
    ratio = float(np.median(mean["nicmm"] / mean["variational"]))
    seconds = report.listed(f"`{method}` {mean[method].mean():.2f} s" for method in methods)
    return textwrap.fill(
        f"A first curve takes {seconds} on average over {len(sets)} meshes of some 4,000 vertices "
        f"(`python -m benchmarks runtime`); `nicmm` takes {ratio:.2f} of the time of "
        "`variational`, median of the sets.",
        118,
    )


def _by(items: Iterable[Results], key: str) -> dict[str, list[Results]]:
    groups: dict[str, list[Results]] = defaultdict(list)
    for item in items:
        groups[item[key]].append(item)
    return groups


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
    "guarantee": _guarantee,
    "courses": _courses,
    "runtime": _runtime,
    "corpus": _corpus,
    "messes": _messes,
    "fuzz": _fuzz,
}
"""The part of a document that a measurement decides, by the name of the measurement."""
