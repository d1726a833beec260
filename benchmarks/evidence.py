"""Data files: the results of each measurement, and the code and the machine they come from.

`benchmarks/data/NAME.json` contains the results of a measurement and a digest of the code that they
depend on. RESULTS.md and the figures in other documents are generated from these files.
`python -m benchmarks stale` lists the measurements whose code has changed since.
"""

from __future__ import annotations

import ast
import datetime
import hashlib
import importlib
import importlib.util
import json
import os
import platform
from collections.abc import Iterable
from functools import cache
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy
import scipy

from .scale import Scale

Results = dict[str, Any]
"""Results of a measurement, in JSON types."""

Record = dict[str, Any]
"""Content of a data file."""

ROOT = Path(__file__).resolve().parents[1]
DATA = ROOT / "benchmarks" / "data"
QUICK_OUTPUT = ROOT / "benchmarks" / "quick"
"""Output folder of quick and smoke runs; not under version control."""

NETWORK = ("geometry", "maps", "paper", "path", "repair")
DESIGN = (
    *("avoidance", "coarsening", "courses", "geometry", "maps"),
    *("path", "relaxation", "repair", "symmetry"),
)
EVERY_METHOD = (*DESIGN, "paper")
"""Folders of the core that a measurement may name as its `ROOMS`; those of the methods of the
paper, of the default method, and of both."""

PRESENTATION = ("__main__", "documents", "evidence", "plots", "progress", "report", "scale")
"""Modules of this package that only run measurements and keep or present their results."""

SOURCES = (".py", ".c", ".h", ".npz")
"""Endings of the files that count."""

LINE = 100
"""Number of characters up to which a value in a data file is written on one line."""


def folder_of(scale: Scale) -> Path:
    """Folder of the data files of runs at a scale."""
    return DATA if scale is Scale.FULL else QUICK_OUTPUT / "data"


def save(name: str, code: str, results: Results, seconds: float, scale: Scale) -> Record:
    """Write the data file of a measurement and return its content as read back.

    `code` is `code_behind` when the measurement began; the files may have changed since.
    """
    record = {
        "command": f"python -m benchmarks {name}"
        + ("" if scale is Scale.FULL else f" --{scale.value}"),
        "date": datetime.date.today().isoformat(),
        "machine": machine(),
        "seconds": round(seconds),
        "code": code,
        "results": results,
    }
    path = folder_of(scale) / f"{name}.json"
    path.parent.mkdir(parents=True, exist_ok=True)
    unfinished = path.with_suffix(".part")
    unfinished.write_text(_as_json(record) + "\n", encoding="utf-8")
    unfinished.replace(path)  # other processes may be reading it
    return load(name, scale)


def _as_json(value: Any, indent: str = "") -> str:
    """JSON text with short values and lists of scalars on one line, for readable changes."""
    line = json.dumps(value, allow_nan=False)
    is_flat = isinstance(value, list) and not any(isinstance(each, dict | list) for each in value)
    if len(line) <= LINE or is_flat or not isinstance(value, dict | list):
        return line
    inner = indent + " "
    if isinstance(value, dict):
        parts = [f"{json.dumps(key)}: {_as_json(each, inner)}" for key, each in value.items()]
        begin, end = "{}"
    else:
        parts = [_as_json(each, inner) for each in value]
        begin, end = "[]"
    return f"{begin}\n{inner}" + f",\n{inner}".join(parts) + f"\n{indent}{end}"


def load(name: str, scale: Scale = Scale.FULL) -> Record:
    """Read the data file of a measurement; raise FileNotFoundError if it was never run."""
    text = (folder_of(scale) / f"{name}.json").read_text(encoding="utf-8")
    record: Record = json.loads(text)
    return record


def is_kept(name: str) -> bool:
    """Whether a full run has left a data file."""
    return (DATA / f"{name}.json").exists()


def is_current(name: str) -> bool:
    """Whether the data file of a full run is that of the present code, as far as that is known."""
    return is_kept(name) and load(name)["code"] == code_behind(name)


def machine() -> str:
    """One-line description of the machine and of the library versions."""
    return (
        f"{os.cpu_count()} cores {platform.machine()}, "
        f"Python {platform.python_version()}, NumPy {numpy.__version__}, "
        f"SciPy {scipy.__version__}, PyTorch {version('torch').split('+')[0]}"
    )


def missing_packages(packages: Iterable[str], scale: Scale) -> list[str]:
    """Those of some packages that are not installed; a full run ends with a message then."""
    missing = [name for name in packages if importlib.util.find_spec(name) is None]
    if missing and scale is Scale.FULL:
        raise SystemExit(f"Packages are missing. Run: .venv/bin/pip install {' '.join(missing)}")
    return missing


def code_behind(name: str) -> str:
    """Digest of the code that determines the results of a measurement.

    It covers the statements of the measurement's module that `measure` uses, so that wording does
    not count; the modules that measurements share; the compiled kernels; and of the core the
    modules at its top and the folders that the measurement names as its `ROOMS`, by default all.
    If these are None, its results stay true when other code changes, and only its own statements
    count. Comments and docstrings do not count.
    """
    own = ROOT / "benchmarks" / f"{name}.py"
    rooms = getattr(importlib.import_module(f"benchmarks.{name}"), "ROOMS", ("*",))
    if rooms is None:
        return _shortened(_statements_of_measure(own.read_bytes()))
    patterns = (
        *("nicmm_core/*", *(f"nicmm_core/{room}/**/*" for room in rooms)),
        *("kernels/source/*", "kernels/nicmm_kernels/*", "tests/oracles/*"),
    )
    files = {file for pattern in patterns for file in ROOT.glob(pattern)}
    files.update(
        file
        for file in own.parent.glob("*.py")
        if file.stem not in PRESENTATION and b"\ndef measure(" not in file.read_bytes()
    )
    counted = sorted(file for file in files if file.suffix in SOURCES)
    digests = [_statements_of_measure(own.read_bytes()), *map(_digest, counted)]
    return _shortened("".join(digests))


def _shortened(text: str) -> str:
    return hashlib.sha256(text.encode()).hexdigest()[:16]


@cache
def _digest(file: Path) -> str:
    """Digest of a file; that of a module is one of its statements."""
    content = file.read_bytes()
    if file.suffix == ".py":
        content = ast.dump(_parsed(content)).encode()
    return hashlib.sha256(content).hexdigest()


def _parsed(content: bytes) -> ast.Module:
    """A module without docstrings."""
    tree = ast.parse(content)
    for node in ast.walk(tree):
        if isinstance(node, ast.Module | ast.ClassDef | ast.FunctionDef):
            node.body = [each for each in node.body if not _is_text(each)]
    return tree


def _is_text(node: ast.stmt) -> bool:
    return (
        isinstance(node, ast.Expr)
        and isinstance(node.value, ast.Constant)
        and isinstance(node.value.value, str)
    )


@cache
def _statements_of_measure(content: bytes) -> str:
    """The statements that the function `measure` of a module uses, except imports."""
    defined: dict[str, list[ast.stmt]] = {}
    for statement in _parsed(content).body:
        for name in _names_defined(statement):
            defined.setdefault(name, []).append(statement)
    found, waiting = {}, ["measure"]
    while waiting:
        name = waiting.pop()
        if name in defined and name not in found:
            found[name] = defined[name]
            used = (node for each in defined[name] for node in ast.walk(each))
            waiting += [node.id for node in used if isinstance(node, ast.Name)]
    return "".join(ast.dump(each) for name in sorted(found) for each in found[name])


def _names_defined(statement: ast.stmt) -> list[str]:
    if isinstance(statement, ast.FunctionDef | ast.ClassDef):
        return [statement.name]
    nodes = [node for node in ast.walk(statement) if isinstance(node, ast.Name)]
    return [node.id for node in nodes if isinstance(node.ctx, ast.Store)]
