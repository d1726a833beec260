# SPDX-License-Identifier: GPL-3.0-or-later
"""What a zip of the extension must fulfil beyond Blender's own validation.

The list follows the terms of extensions.blender.org and what its reviewers ask for.
"""

from __future__ import annotations

import ast
import re
import tomllib
import zipfile
from pathlib import Path, PurePosixPath

from .environment import MANIFEST
from .extension import LARGEST_ZIP

LOOSE = (".so", ".dll", ".dylib", ".pyd", ".exe")
"""Endings of compiled files, which only wheels may contain."""

NETWORK = {"ftplib", "http", "requests", "smtplib", "socket", "urllib"}
"""Modules whose use would need the permission "network"."""


def faults(archive: Path) -> list[str]:
    """What is wrong with a zip, in words; empty if it is ready for the platform."""
    found = []
    with zipfile.ZipFile(archive) as opened:
        names = opened.namelist()
        manifest = tomllib.loads(opened.read(MANIFEST).decode("utf-8"))
        sources = {name: opened.read(name).decode() for name in names if name.endswith(".py")}
    if archive.stat().st_size > LARGEST_ZIP:
        found.append(f"it is larger than {LARGEST_ZIP / 1e6:.0f} MB")
    for key in ("website", "copyright", "tags", "permissions", "platforms", "wheels"):
        if not manifest.get(key):
            found.append(f"the manifest lacks {key}")
    if "LICENSE" not in names:
        found.append("the licence is missing")
    found += [f"{name} is outside a wheel" for name in names if name.endswith(LOOSE)]
    found += [f"{name} is no part of an extension" for name in names if _is_left_over(name)]
    listed = sorted(name.removeprefix("./") for name in manifest.get("wheels", ()))
    if listed != sorted(name for name in names if name.endswith(".whl")):
        found.append("the wheels are not those of the manifest")
    for name, source in sources.items():
        for module in sorted(_imported(source) & NETWORK):
            found.append(f"{name} imports {module}, which needs the permission network")
        if re.search(r"\b(os\.system|eval|exec)\(", source):
            found.append(f"{name} runs code from text")
    return found


def _is_left_over(name: str) -> bool:
    parts = PurePosixPath(name).parts
    return any(part.startswith(".") or part in ("__pycache__", "tests") for part in parts)


def _imported(source: str) -> set[str]:
    """The top-level names of the modules that a source imports."""
    found = set()
    for statement in ast.walk(ast.parse(source)):
        if isinstance(statement, ast.Import):
            found |= {alias.name.partition(".")[0] for alias in statement.names}
        elif isinstance(statement, ast.ImportFrom) and not statement.level:
            found.add((statement.module or "").partition(".")[0])
    return found
