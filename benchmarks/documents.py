"""Generates the measured figures in README.md and docs/ from the data files.

Each block of figures is enclosed by `<!-- figures: NAME -->` and `<!-- /figures -->`. It is the
`summary` of the measurement of that name, or one that several measurements give together.
"""

from __future__ import annotations

import importlib
from collections.abc import Mapping
from pathlib import Path

import numpy as np

from . import guarantee, report
from .evidence import ROOT, Record, Results

DOCUMENTS = (ROOT / "README.md", *sorted((ROOT / "docs").glob("*.md")))

METHODS = ("elastic", "nicmm", "variational")

PAPER = (
    "pretraining",
    "transfer",
    "convergence",
    "ablation",
    "parameters",
    "initial",
    "curvature",
    "runtime",
    "peers",
    "degraded",
    "resolution",
    "gallery",
    "obstacles",
    "one_loop",
)
"""Measurements of the tables and figures of the paper."""


def generated(records: Mapping[str, Record]) -> dict[Path, str]:
    """Text of every document, with all parts that depend on data files regenerated, by path."""
    measured = {name: record["results"] for name, record in records.items()}
    blocks = {}
    for name, results in measured.items():
        module = importlib.import_module(f"benchmarks.{name}")
        if hasattr(module, "summary"):
            blocks[name] = module.summary(results)
    if measured.keys() >= {*PAPER, "guarantee"}:
        blocks["fairness"] = guarantee.fairness(measured["guarantee"])
        blocks["methods"] = _methods(measured)
        blocks["beside_paper"] = _beside_paper(measured)
    found = {report.RESULTS: report.results_text(records)}
    for path in DOCUMENTS:
        found[path] = report.with_figures(path.read_text(encoding="utf-8"), blocks)
    return found


def _methods(measured: Mapping[str, Results]) -> str:
    """The three methods beside each other, with the paper's words."""
    degraded, of_runtime = measured["degraded"], measured["runtime"]["sets"]
    sets = [each["bending"] for each in measured["curvature"]["sets"]]
    bends = [
        f"{np.median([bend[method][0] / bend['reference curve'][0] for bend in sets]):.2f}"
        for method in METHODS
    ]
    worst = [each for each in degraded["sets"] if each["n"] == degraded["severities"][-1]]
    found = [sum(s["answers"][m]["bending"] is not None for s in worst) for m in METHODS]
    iterations = [
        f"{np.median([each['answers'][method]['iterations'] for each in of_runtime]):.0f}"
        for method in METHODS
    ]
    rows = [
        (
            "L ∮ κ_g² ds at 128 points relative to an explicit elastic curve, median of "
            f"{len(sets)}",
            *bends,
            "“comparable distributions”",
        ),
        (
            "one finite curve on a mesh with every face degraded",
            *(f"{count} of {len(worst)}" for count in found),
            "NICMM yes, variational no",
        ),
        (
            f"iterations, median of {len(of_runtime)}",
            f"{iterations[0]}, after the search",
            *iterations[1:],
            "NICMM about 32",
        ),
    ]
    return report.table(("", *(f"`{method}`" for method in METHODS), "in the paper"), rows)


def _beside_paper(measured: Mapping[str, Results]) -> str:
    """What the measurements of its tables and figures say about the paper."""
    rows = []
    for name in PAPER:
        module = importlib.import_module(f"benchmarks.{name}")
        for verdict, sentences in report.verdicts(module.section(measured[name])).items():
            rows.append((report.link_to(module.TITLE), verdict, " ".join(sentences)))
    return report.table(("in the paper", "our result", "what was measured"), rows)
