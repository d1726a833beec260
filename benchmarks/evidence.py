"""Data files: the results of each measurement, and the code, meshes and machine they come from.

`benchmarks/data/NAME.json` contains the results of a measurement and a fingerprint of every
statement that they depend on. RESULTS.md and the figures in other documents are generated from
these files. `python -m benchmarks stale` lists the measurements whose code has changed since.
"""

from __future__ import annotations

import ast
import datetime
import hashlib
import importlib
import json
import os
import platform
from collections.abc import Callable, Iterable, Sequence
from functools import cache
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy
import scipy

from tests.oracles.mesh_files import INDEX

from .scale import Scale

Results = dict[str, Any]
"""Results of a measurement, in JSON types."""

Record = dict[str, Any]
"""Content of a data file."""

ROOT = Path(__file__).resolve().parents[1]
DATA = ROOT / "benchmarks" / "data"
QUICK_OUTPUT = ROOT / "benchmarks" / "quick"
"""Output folder of quick and smoke runs; not under version control."""

WEIGHTS = "nicmm_core/paper/weights"
KERNELS = ROOT / "kernels"
"""Compiled kernels: all files of the C sources, and of the package that passes arrays to them."""

PRESENTATION = tuple(
    f"benchmarks/{name}.py" for name in ("__init__", "evidence", "progress", "report", "scale")
)
"""Modules that only keep or present results; they are left out of the fingerprints."""

LINE = 100
"""Number of characters up to which a value in a data file is written on one line."""

Read = Callable[[Path], bytes]


def folder_of(scale: Scale) -> Path:
    """Folder of the data files of runs at a scale."""
    return DATA if scale is Scale.FULL else QUICK_OUTPUT / "data"


def save(name: str, code: dict[str, str], results: Results, seconds: float, scale: Scale) -> Record:
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
        "meshes": meshes_behind(name),
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


def machine() -> str:
    """One-line description of the machine and of the library versions."""
    return (
        f"{os.cpu_count()} cores {platform.machine()}, "
        f"Python {platform.python_version()}, NumPy {numpy.__version__}, "
        f"SciPy {scipy.__version__}, PyTorch {version('torch').split('+')[0]}"
    )


def what_changed(name: str, read: Read = Path.read_bytes) -> list[str]:
    """What has changed since a measurement: file names, or a reason in words; empty if nothing."""
    if not is_kept(name):
        return ["never measured"]
    record = load(name)
    if record["code"] is None:
        return ["measured before the code was recorded"]
    now, before = code_behind(name, read), record["code"]
    changed = sorted(path for path in now | before if now.get(path) != before.get(path))
    if INDEX.exists() and meshes_behind(name) != record["meshes"]:
        changed.append("the list of meshes")
    return changed


def code_behind(name: str, read: Read = Path.read_bytes) -> dict[str, str]:
    """Digest of each file whose statements determine the results of a measurement.

    In the measurement's own module, only the statements that `measure` reaches count, so changing
    the wording of a section does not make the measurement stale. In the modules imported from
    there, directly or indirectly, all statements count. Comments and docstrings never do, nor do
    the folders of the core that the measurement lists in `WITHOUT`.

    Parameters
    ----------
    name : str
        Name of the measurement.
    read : callable
        Function that returns the content of a file.

    Returns
    -------
    dict of str to str
        Digest by path relative to the repository.
    """
    own = ROOT / "benchmarks" / f"{name}.py"
    statements, imports = _reached(_parsed(read(own)), "measure")
    excluded = getattr(importlib.import_module(f"benchmarks.{name}"), "WITHOUT", ())
    digests = {_relative(own): _digest(statements)}
    waiting = list(_files(imports, own))
    while waiting:
        path = waiting.pop()
        relative = _relative(path)
        room = relative.split("/")[1] if relative.startswith("nicmm_core/") else ""
        if relative in digests or relative in PRESENTATION or room in excluded:
            continue
        digests[relative], imported = _whole(read(path), path)
        waiting += imported
    if "nicmm_core/geometry/mesh.py" in digests:  # the first module that uses the kernels
        for path in sorted([*KERNELS.glob("source/*.[ch]"), *KERNELS.glob("nicmm_kernels/*.py")]):
            digests[_relative(path)] = hashlib.sha256(read(path)).hexdigest()[:16]
    if "paper" not in excluded:
        for path in sorted((ROOT / WEIGHTS).iterdir()):
            if path.is_file() and path.suffix != ".py":
                digests[_relative(path)] = hashlib.sha256(read(path)).hexdigest()[:16]
    return dict(sorted(digests.items()))


def meshes_behind(name: str) -> str | None:
    """Digest of the list of third-party meshes; None if a measurement uses no such mesh."""
    modules = {"tests/oracles/mesh_files.py", "benchmarks/collections.py"}
    if not INDEX.exists() or not modules & set(code_behind(name)):
        return None
    return hashlib.sha256(INDEX.read_bytes()).hexdigest()[:16]


IMPORTS = (ast.Import, ast.ImportFrom)


@cache
def _whole(content: bytes, path: Path) -> tuple[str, list[Path]]:
    """Digest of all statements of a file, and the files of the project that it imports."""
    tree = _parsed(content)
    imports = [node for node in ast.walk(tree) if isinstance(node, IMPORTS)]
    return _digest([tree]), _files(imports, path)


def _parsed(content: bytes) -> ast.Module:
    """Syntax tree of a file without docstrings; it has no comments anyway."""
    tree = ast.parse(content)
    for node in ast.walk(tree):
        body = getattr(node, "body", None)
        if isinstance(body, list):
            node.body = [each for each in body if not _is_text(each)]  # type: ignore[attr-defined]
    return tree


def _is_text(node: ast.stmt) -> bool:
    return (
        isinstance(node, ast.Expr)
        and isinstance(node.value, ast.Constant)
        and isinstance(node.value.value, str)
    )


def _digest(statements: Sequence[ast.AST]) -> str:
    text = "\n".join(ast.dump(statement) for statement in statements)
    return hashlib.sha256(text.encode()).hexdigest()[:16]


def _reached(tree: ast.Module, start: str) -> tuple[list[ast.stmt], list[ast.stmt]]:
    """Statements that a function of a module uses, in file order, and the imports they need."""
    defined: dict[str, list[ast.stmt]] = {}
    for statement in tree.body:
        for name in _names_defined(statement):
            defined.setdefault(name, []).append(statement)
    found: set[ast.stmt] = set()
    waiting = [start]
    seen = set()
    while waiting:
        name = waiting.pop()
        if name in seen:
            continue
        seen.add(name)
        for statement in defined.get(name, ()):
            found.add(statement)
            waiting += [node.id for node in ast.walk(statement) if isinstance(node, ast.Name)]
    statements = [each for each in tree.body if each in found and not isinstance(each, IMPORTS)]
    inner = [n for each in statements for n in ast.walk(each) if isinstance(n, IMPORTS)]
    outer = [each for each in tree.body if each in found and isinstance(each, IMPORTS)]
    used = [_only(node, seen) for node in outer]
    return statements, [*used, *inner]


def _only(node: ast.stmt, names: set[str]) -> ast.stmt:
    """Copy of an import statement with only the names that are used."""
    assert isinstance(node, IMPORTS)
    kept = [each for each in node.names if (each.asname or each.name).split(".")[0] in names]
    if isinstance(node, ast.Import):
        return ast.Import(kept)
    return ast.ImportFrom(node.module, kept, node.level)


def _names_defined(statement: ast.stmt) -> list[str]:
    if isinstance(statement, ast.FunctionDef | ast.ClassDef):
        return [statement.name]
    if isinstance(statement, IMPORTS):
        return [(each.asname or each.name).split(".")[0] for each in statement.names]
    nodes = [node for node in ast.walk(statement) if isinstance(node, ast.Name)]
    return [node.id for node in nodes if isinstance(node.ctx, ast.Store)]


def _files(imports: Iterable[ast.stmt], importer: Path) -> list[Path]:
    """Files of the project that import statements load, including the enclosing packages."""
    found = []
    package = _relative(importer).split("/")[:-1]
    for node in imports:
        if isinstance(node, ast.Import):
            wanted = [each.name.split(".") for each in node.names]
        else:
            assert isinstance(node, ast.ImportFrom)
            base = package[: len(package) - node.level + 1] if node.level else []
            base = base + (node.module.split(".") if node.module else [])
            wanted = [base, *([*base, each.name] for each in node.names)]
        for parts in wanted:
            for count in range(1, len(parts) + 1):
                place = ROOT.joinpath(*parts[:count])
                found += [
                    p for p in (place / "__init__.py", place.with_suffix(".py")) if p.exists()
                ]
    return found


def _relative(path: Path) -> str:
    return path.relative_to(ROOT).as_posix()
