"""Generates RESULTS.md, and the figures in other documents, from the data files.

A measurement is a module of this package that defines

- `TITLE`, which names the corresponding table or figure of the paper,
- `measure(scale)`, which returns the results in JSON types,
- `section(results)`, which returns them as Markdown,
- `summary(results)`, if a page of docs/ quotes it: it returns that block of Markdown,
- `draw(results, folder)`, if there are plots: it writes the PNG files that `section` shows,
- `ROOMS`, the folders of the core that its results depend on, by default all; None if they stay
  true when the code changes,
- `TIMED`, true if other work on the machine would change the results.
"""

from __future__ import annotations

import importlib
import re
import textwrap
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path

from . import evidence
from .evidence import QUICK_OUTPUT, ROOT, Record
from .scale import Scale

RESULTS = ROOT / "benchmarks" / "RESULTS.md"
FIGURES = ROOT / "benchmarks" / "figures"
"""Folder of the pictures that RESULTS.md shows."""

INTRODUCTION = """# Results

The tables and figures of the paper, measured again with this implementation, and further
measurements of the package. Each section is one measurement: it says what was measured and on what,
how to read the table and, where the paper has a corresponding table or figure, whether the result
agrees with it.

- **Methods.** `elastic`, the default of this package, searches for a course and relaxes it as an
  elastic curve; `nicmm` is the network of the paper, fitted to each curve; and `variational`
  minimises the same energy as `nicmm` without a network ([the method](../docs/method.md)).
- **Bending.** L ∮ κ_g² ds is the scale-free bending of a curve: its length times the integral of
  its squared geodesic curvature. A circle in the plane has 4π² ≈ 39; less is fairer.
- **Times and losses** of the paper were measured on other hardware and with weights in other units,
  so only ratios can be compared.
- **The line below each title** gives the command of the measurement and the machine it ran on.

This file is generated from `benchmarks/data/` by `python -m benchmarks write`; do not edit it.
`python -m benchmarks stale` lists the measurements that were made with other code.
"""


def figures_folder(scale: Scale) -> Path:
    """Folder for the pictures of a run; created if it does not exist."""
    folder = FIGURES if scale is Scale.FULL else QUICK_OUTPUT / "figures"
    folder.mkdir(parents=True, exist_ok=True)
    return folder


def results_text(records: Mapping[str, Record]) -> str:
    """Content of RESULTS.md."""
    return "\n".join([INTRODUCTION, *(section_text(name, r) for name, r in records.items())])


def section_text(name: str, record: Record) -> str:
    """Section of a measurement, generated from its data."""
    module = importlib.import_module(f"benchmarks.{name}")
    results = record["results"]
    body = module.section(results)
    origin = f"`{record['command']}` · {record['machine']}"
    return f"<!-- {name} -->\n## {module.TITLE}\n\n{origin}\n\n{body.strip()}\n<!-- /{name} -->\n"


def draw(name: str, record: Record, scale: Scale) -> None:
    """Draw the plots of a measurement from its data."""
    module = importlib.import_module(f"benchmarks.{name}")
    if hasattr(module, "draw"):
        module.draw(record["results"], figures_folder(scale))


def with_figures(document: str, blocks: Mapping[str, str]) -> str:
    """Document in which every part between `<!-- figures: NAME -->` marks is regenerated."""

    def generated(found: re.Match[str]) -> str:
        name = found[1]
        if name not in blocks:
            return found[0]
        return f"<!-- figures: {name} -->\n{blocks[name].strip()}\n<!-- /figures -->"

    marks = r"<!-- figures: (\w+) -->\n.*?<!-- /figures -->"
    return re.sub(marks, generated, document, flags=re.S)


def table(header: Sequence[str], rows: Iterable[Sequence[object]]) -> str:
    """Markdown table."""
    lines = [list(map(str, header)), ["---"] * len(header), *(list(map(str, r)) for r in rows)]
    return "\n".join("| " + " | ".join(line) + " |" for line in lines)


def link_to(title: str) -> str:
    """Link from a page of docs/ to the section with a title."""
    anchor = re.sub(r"[^\w\- ]", "", title.lower()).replace(" ", "-")
    return f"[{title}](../benchmarks/RESULTS.md#{anchor})"


HARDLY = 0.25
"""Share of an effect in the paper below which an effect contradicts it in its size."""


def verdict(ratio: float, paper: float, less: str = "lower", more: str = "higher") -> str:
    """Whether a change has the effect that it has in the paper.

    Both are ratios of values with and without the change, so 1 means no effect.
    """
    wanted, opposite = (less, more) if paper < 1.0 else (more, less)
    effect = (ratio - 1.0) / (paper - 1.0)
    if effect < 0.0:
        return f"{opposite}, which contradicts the paper"
    if effect < HARDLY:
        return f"hardly {wanted}, which contradicts the paper in the size of the effect"
    return f"{wanted}, which agrees with the paper"


VERDICTS = {
    "agrees with the paper only": "agrees in part",
    "agrees with the paper": "agrees",
    "contradicts the paper": "contradicts",
    "neither confirmed nor contradicted": "not tested",
}
"""Words with which sections compare with the paper, and the verdict that they mean."""


def verdicts(section: str) -> dict[str, list[str]]:
    """Sentences of a section that say whether the results agree with the paper, by verdict."""
    prose = [part for part in section.split("\n\n") if not part.startswith(("|", "!", "*"))]
    found: dict[str, list[str]] = {}
    for sentence in re.split(r"(?<=[.”)]) (?=[A-Z“`])", " ".join(" ".join(prose).split())):
        verdict = next((VERDICTS[words] for words in VERDICTS if words in sentence), None)
        if verdict:
            found.setdefault(verdict, []).append(sentence)
    return found


def figure(file_name: str, caption: str) -> str:
    """Markdown picture with its caption."""
    return f"![{caption}](figures/{file_name})\n\n*{caption}*"


def item(text: str) -> str:
    """Item of a list, in lines of a document."""
    return _wrapped(text, "- ", "  ")


def paragraph(text: str) -> str:
    """Paragraph, in lines of a document."""
    return _wrapped(text)


def _wrapped(text: str, first: str = "", others: str = "") -> str:
    """Text in lines of 118 characters, without breaks inside of code."""
    whole = re.sub(r"`[^`]*`", lambda code: code[0].replace(" ", "\0"), text)
    lines = textwrap.fill(
        whole, 118, initial_indent=first, subsequent_indent=others, break_on_hyphens=False
    )
    return lines.replace("\0", " ")


def none_or(count: int, be: str = " was") -> str:
    """A number with its verb: "none was", "1 was", "2 were"."""
    return f"{count or 'none'}{be if count < 2 else be.replace('was', 'were')}"


def listed(names: Iterable[str]) -> str:
    """Names in one line, separated by commas."""
    return ", ".join(names)


def kept_records(names: Iterable[str]) -> dict[str, Record]:
    """Contents of the data files of full runs, by measurement."""
    return {name: evidence.load(name) for name in names if evidence.is_kept(name)}
