"""Documents generated from the data files: RESULTS.md, and figures in other documents.

A measurement is a module of this package with

- `TITLE`, with the paper's table or figure,
- `measure(scale)`, which returns its results in types of JSON,
- `section(results)`, the Markdown that says them,
- `draw(results, folder)`, if it has plots: PNG files that `section` shows,
- `WITHOUT`, rooms of the core that it does not run, if there are any,
- `TIMED`, true if other work on the machine would change its results.
"""

from __future__ import annotations

import importlib
import re
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path

from . import evidence
from .evidence import QUICK_OUTPUT, ROOT, Record
from .scale import Scale

RESULTS = ROOT / "benchmarks" / "RESULTS.md"
FIGURES = ROOT / "benchmarks" / "figures"
"""Pictures that RESULTS.md shows."""

INTRODUCTION = """# Results

The paper's tables and figures measured again, and more: one section for each measurement. Only
ratios can be compared with the paper's times and losses: the machine is another, and so are the
units of its weights. Where a result contradicts the paper, its section says so. This file is
generated from `benchmarks/data/` by `python -m benchmarks write`; `python -m benchmarks stale`
lists what was measured on other code.
"""


def figures_folder(scale: Scale) -> Path:
    """Folder for the pictures of a run, made when it is missing."""
    folder = FIGURES if scale is Scale.FULL else QUICK_OUTPUT / "figures"
    folder.mkdir(parents=True, exist_ok=True)
    return folder


def results_text(records: Mapping[str, Record]) -> str:
    """The content of RESULTS.md."""
    return "\n".join([INTRODUCTION, *(section_text(name, r) for name, r in records.items())])


def section_text(name: str, record: Record) -> str:
    """The section of a measurement, generated from its data."""
    module = importlib.import_module(f"benchmarks.{name}")
    results = record["results"]
    body = results["text"] if record["code"] is None else module.section(results)
    origin = f"`{record['command']}` · {record['machine']}"
    return f"<!-- {name} -->\n## {module.TITLE}\n\n{origin}\n\n{body.strip()}\n<!-- /{name} -->\n"


def draw(name: str, record: Record, scale: Scale) -> None:
    """Draw the plots of a measurement from its data."""
    module = importlib.import_module(f"benchmarks.{name}")
    if record["code"] is not None and hasattr(module, "draw"):
        module.draw(record["results"], figures_folder(scale))


def with_figures(document: str, blocks: Mapping[str, str]) -> str:
    """A document with each part between `<!-- figures: NAME -->` marks generated anew."""

    def generated(found: re.Match[str]) -> str:
        name = found[1]
        if name not in blocks:
            return found[0]
        return f"<!-- figures: {name} -->\n{blocks[name].strip()}\n<!-- /figures -->"

    marks = r"<!-- figures: (\w+) -->\n.*?<!-- /figures -->"
    return re.sub(marks, generated, document, flags=re.S)


def table(header: Sequence[str], rows: Iterable[Sequence[object]]) -> str:
    """A Markdown table."""
    lines = [list(map(str, header)), ["---"] * len(header), *(list(map(str, r)) for r in rows)]
    return "\n".join("| " + " | ".join(line) + " |" for line in lines)


def figure(file_name: str, caption: str) -> str:
    """A Markdown picture with its caption."""
    return f"![{caption}](figures/{file_name})\n\n*{caption}*"


def listed(names: Iterable[str]) -> str:
    """Names in one line."""
    return ", ".join(names)


def kept_records(names: Iterable[str]) -> dict[str, Record]:
    """Data files of full runs."""
    return {name: evidence.load(name) for name in names if evidence.is_kept(name)}
