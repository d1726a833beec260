"""Tests that imports between the packages of the core have no cycles."""

import ast
import graphlib
from pathlib import Path

import nicmm_core

ROOT = Path(nicmm_core.__file__).parent


def room(path):
    """Package of a module, or the name of a module that is in no package."""
    return path.relative_to(ROOT).parts[0].removesuffix(".py")


def imported_rooms(path):
    """Packages, and modules outside packages, that a module imports relatively."""
    for statement in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(statement, ast.ImportFrom) and statement.level:
            here = path.parents[statement.level - 1]
            names = [statement.module] if statement.module else [a.name for a in statement.names]
            for name in names:
                yield room(here.joinpath(*name.split(".")))


def test_no_package_imports_one_that_imports_it():
    rooms = {}
    for path in ROOT.rglob("*.py"):
        if path != ROOT / "__init__.py":  # it imports every name on first use
            rooms.setdefault(room(path), set()).update(imported_rooms(path))
    assert {"geometry", "path", "paper", "outputs"} < rooms.keys()
    assert "geometry" in rooms["path"]
    for name, below in rooms.items():
        below.discard(name)
    tuple(graphlib.TopologicalSorter(rooms).static_order())  # raises CycleError
