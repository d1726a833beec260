# SPDX-License-Identifier: GPL-3.0-or-later
"""Builds and checks everything that a release consists of, and lists what was checked."""

from __future__ import annotations

import hashlib
import json
import os
import re
import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

from . import checks, extension, reviewed
from .environment import ROOT, VENV_PYTHON, BuildError, manifest, run, say

CHECKED = "CHECKED.md"
"""Name of the list of what was checked, beside the files of the release."""

SUMS = "SHA256SUMS"

FIRST_CURVE = """
import nicmm_core as nicmm
from nicmm_core import shapes
design = nicmm.design_curve(shapes.torus(), [0, 900, 2400, 3600], order="shortest")
assert design.status is nicmm.Status.CONVERGED, design.status
"""
"""A program that uses an installed wheel."""


@dataclass
class Release:
    """Files of a release, and a row for each thing that was checked.

    Attributes
    ----------
    folder : Path
        Where the files are written.
    rows : list of (str, bool, str)
        What was checked, whether it is right, and details.
    """

    folder: Path
    rows: list[tuple[str, bool, str]]

    def check(self, what: str, step: Callable[[], str]) -> None:
        """Take a step; it returns details, or raises BuildError."""
        say(what)
        begun = time.monotonic()
        try:
            details, right = step(), True
        except BuildError as error:
            details, right = str(error), False
        seconds = time.monotonic() - begun
        self.rows.append((what, right, f"{details} ({seconds:.0f} s)"))


def release(folder: Path, tests: bool) -> int:
    """Build a release in a folder; returns 0 if everything is right.

    Parameters
    ----------
    folder : Path
        It is emptied first.
    tests : bool
        Whether to run all tests too.
    """
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir(parents=True)
    made = Release(folder, [])
    made.check("the version has a section in the changelog", changelog)
    made.check("the sources are those of a commit", _commit)
    if tests:
        made.check("lint, types and all tests", _tests)
    made.check("wheels and source distribution", lambda: _wheels(folder))
    made.check("the wheels work in an empty environment", lambda: _installed(folder))
    for platform in extension.PLATFORMS:
        made.check(
            f"zip for {platform}: Blender's validation and our list",
            lambda platform=platform: _zip(folder, platform),  # type: ignore[misc]
        )
    made.check("the zip for this platform works in bpy", lambda: _tried(folder))
    made.check("the scripts of the gallery draw their pictures", _gallery)
    made.check("the site is built without warnings", lambda: _site(folder))
    made.check("checksums", lambda: _checksums(folder))
    (folder / CHECKED).write_text(report(made.rows), encoding="utf-8")
    print((folder / CHECKED).read_text(encoding="utf-8"))
    return 0 if all(right for _, right, _ in made.rows) else 1


def report(rows: Sequence[tuple[str, bool, str]]) -> str:
    """The list of what was checked, as Markdown."""
    lines = [f"# NICMM Curves {manifest()['version']}: what was checked", ""]
    lines += ["| checked | result | details |", "|---|---|---|"]
    for what, right, details in rows:
        shown = details.replace("\n", " ").replace("|", "\\|")
        lines.append(f"| {what} | {'passed' if right else '**failed**'} | {shown} |")
    failed = sum(not right for _, right, _ in rows)
    lines += ["", f"{len(rows) - failed} of {len(rows)} passed."]
    return "\n".join(lines) + "\n"


def changelog() -> str:
    version = manifest()["version"]
    text = (ROOT / "CHANGELOG.md").read_text(encoding="utf-8")
    if not re.search(rf"^## {re.escape(version)} – \d{{4}}-\d\d-\d\d$", text, re.MULTILINE):
        raise BuildError(f"CHANGELOG.md has no section “## {version} – DATE”")
    return version


def _commit() -> str:
    changed = _output(["git", "status", "--porcelain"])
    if changed:
        raise BuildError(f"these files are not committed: {changed}")
    return _output(["git", "rev-parse", "--short", "HEAD"])


def _tests() -> str:
    if checks.run_checks(quick=False, pytest_arguments=()) != 0:
        raise BuildError("a check failed; see the output above")
    return "build.py test"


def _wheels(folder: Path) -> str:
    """Build the wheel of every platform's kernels, that of the core, and its sources."""
    environment = {"NICMM_RELEASE": "1"}
    pip: list[str | Path] = [VENV_PYTHON, "-m", "pip", "wheel", "--quiet", "--no-deps"]
    pip += ["--no-build-isolation", "--wheel-dir", folder]
    if run([*pip, ROOT], environment) != 0:
        raise BuildError("the wheel of nicmm-curves could not be built")
    for platform in extension.KERNEL_PLATFORMS:
        extension.kernel_wheel(platform, folder)
    sources: list[str | Path] = [
        VENV_PYTHON,
        "-m",
        "hatchling",
        "build",
        "--target",
        "sdist",
        "--directory",
        folder,
    ]
    if run(sources) != 0:
        raise BuildError("the source distribution could not be built")
    return f"{len(list(folder.glob('*.whl')))} wheels"


def _installed(folder: Path) -> str:
    """Install the wheels as a newcomer does, and design a curve with the command and in Python."""
    with tempfile.TemporaryDirectory() as temporary:
        venv = Path(temporary) / "venv"
        scripts = venv / ("Scripts" if os.name == "nt" else "bin")
        found: list[str | Path] = ["--find-links", folder, f"nicmm-curves=={manifest()['version']}"]
        shapes, curve = Path(temporary) / "shapes", Path(temporary) / "curve.json"
        design: list[str | Path] = [
            "design",
            shapes / "creature-000.obj",
            "--points",
            "3,60,100",
            "-o",
            curve,
        ]
        commands: tuple[list[str | Path], ...] = (
            [sys.executable, "-m", "venv", venv],
            [scripts / "python", "-m", "pip", "install", "--quiet", *found],
            [scripts / "nicmm", "shapes", shapes, "--count", "1"],
            [scripts / "nicmm", *design, "--order", "shortest"],
            [scripts / "python", "-c", FIRST_CURVE],
        )
        for command in commands:
            if run(command, folder=Path(temporary)) != 0:
                raise BuildError(f"this failed: {' '.join(map(str, command))}")
        count = len(json.loads(curve.read_text(encoding="utf-8"))["faces"])
        return f"nicmm design gave {count} points"


def _zip(folder: Path, platform: str) -> str:
    archive = extension.package(platform, output=folder)
    faults = reviewed.faults(archive)
    if faults:
        raise BuildError("; ".join(faults))
    return f"{archive.stat().st_size / 1e6:.0f} MB"


def _tried(folder: Path) -> str:
    name = extension.this_platform().replace("-", "_")
    (archive,) = folder.glob(f"*-{name}.zip")
    with tempfile.TemporaryDirectory() as user_folder:
        ran = subprocess.run(
            [VENV_PYTHON, ROOT / "building" / "try_extension.py", archive],
            env={**os.environ, "BLENDER_USER_RESOURCES": user_folder},
            capture_output=True,
            text=True,
            check=False,
        )
    if ran.returncode != 0:
        raise BuildError(f"{ran.stdout[-500:]} {ran.stderr[-500:]}")
    return next(line for line in ran.stdout.splitlines() if line.startswith("Blender "))


def _gallery() -> str:
    with tempfile.TemporaryDirectory() as temporary:
        if run([VENV_PYTHON, "-m", "docs.gallery", temporary]) != 0:
            raise BuildError("a script of the gallery failed; see the output above")
        return f"{len(list(Path(temporary).glob('*.webp')))} pictures"


def _site(folder: Path) -> str:
    if run([VENV_PYTHON, "-m", "docs.build_site", folder / "site"]) != 0:
        raise BuildError("the site could not be built; see the output above")
    return f"{len(list((folder / 'site').rglob('*.html')))} pages"


def _checksums(folder: Path) -> str:
    files = sorted(path for path in folder.iterdir() if path.is_file())
    lines = [f"{hashlib.sha256(path.read_bytes()).hexdigest()}  {path.name}" for path in files]
    (folder / SUMS).write_text("\n".join(lines) + "\n", encoding="utf-8")
    return f"{len(files)} files"


def _output(command: Sequence[str]) -> str:
    ran = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False)
    if ran.returncode != 0:
        raise BuildError(f"{' '.join(command)} failed: {ran.stderr.strip()}")
    return ran.stdout.strip()
