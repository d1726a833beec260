"""RESULTS.md: one section a measurement, replaced when it is measured again."""

from __future__ import annotations

import os
import platform
import re
from collections.abc import Iterable, Sequence
from pathlib import Path

import numpy
import scipy
import torch

from .scale import Scale

RESULTS = Path(__file__).resolve().parent / "RESULTS.md"
FIGURES = RESULTS.parent / "figures"
"""Pictures that RESULTS.md shows."""

QUICK_OUTPUT = RESULTS.parent / "quick"
"""Where quick and smoke runs write instead; not under version control."""


INTRODUCTION = """# Results

The paper's tables and figures measured again, and more: one section for each
`python -m benchmarks NAME`, which writes it. Only ratios can be compared with the paper's times
and losses: the machine is another, and so are the units of its weights. Where a result
contradicts the paper, its section says so.
"""


def output_folder(scale: Scale) -> Path:
    """Folder for the figures of a run, made when it is missing."""
    folder = FIGURES if scale is Scale.FULL else QUICK_OUTPUT / "figures"
    folder.mkdir(parents=True, exist_ok=True)
    return folder


def write_section(name: str, title: str, body: str, scale: Scale) -> None:
    """Print a section and put it into RESULTS.md (into ``quick/RESULTS.md`` unless full).

    Parameters
    ----------
    name : str
        Of the measurement; marks its place in the file.
    title : str
        Heading, with the paper's table or figure.
    body : str
        Markdown.
    scale : Scale
    """
    path = RESULTS if scale is Scale.FULL else QUICK_OUTPUT / "RESULTS.md"
    path.parent.mkdir(parents=True, exist_ok=True)
    text = path.read_text() if path.exists() else INTRODUCTION
    section = f"## {title}\n\n{environment(name, scale)}\n\n{body.strip()}\n"
    begin, end = f"<!-- {name} -->\n", f"<!-- /{name} -->\n"
    block = begin + section + end
    if begin in text:
        text = re.sub(re.escape(begin) + ".*?" + re.escape(end), lambda _: block, text, flags=re.S)
    else:
        text = text.rstrip() + "\n\n" + block
    path.write_text(text)
    print(section)


def environment(name: str, scale: Scale) -> str:
    """The command and the machine, in one line."""
    option = "" if scale is Scale.FULL else f" --{scale.value}"
    return (
        f"`python -m benchmarks {name}{option}` · {os.cpu_count()} cores {platform.machine()}, "
        f"Python {platform.python_version()}, NumPy {numpy.__version__}, "
        f"SciPy {scipy.__version__}, PyTorch {torch.__version__.split('+')[0]}"
    )


def table(header: Sequence[str], rows: Iterable[Sequence[object]]) -> str:
    """A Markdown table."""
    lines = [list(map(str, header)), ["---"] * len(header), *(list(map(str, r)) for r in rows)]
    return "\n".join("| " + " | ".join(line) + " |" for line in lines)


def figure(path: Path, caption: str) -> str:
    """A Markdown picture with its caption."""
    return f"![{caption}](figures/{path.name})\n\n*{caption}*"


def listed(names: Iterable[str]) -> str:
    """Names in one line."""
    return ", ".join(names)
