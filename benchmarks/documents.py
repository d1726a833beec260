"""Figures in README.md and docs/, generated from the data files.

They stand between `<!-- figures: NAME -->` and `<!-- /figures -->`.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path

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


FIGURES: dict[str, Callable[[Results], str]] = {}
"""The part of a document that a measurement decides, by the name of the measurement."""
