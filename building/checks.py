# SPDX-License-Identifier: GPL-3.0-or-later
"""The checks of `build.py test`."""

from __future__ import annotations

import shutil
import subprocess
import tempfile
from collections.abc import Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

from .environment import (
    DIST,
    KERNELS,
    ONE_THREAD,
    ROOT,
    VENV_PYTHON,
    BuildError,
    manifest,
    run,
    say,
)
from .extension import stage

APART = ("tests/blender", "tests/benchmarks", "tests/core/paper")
"""Folders of the tests that import Blender's module or PyTorch; the benchmarks render with Blender.

Processes have crashed, rarely, after about a thousand tests. All of them had imported PyTorch, and
most of them Blender's module. The cause is not known.
"""


def run_checks(quick: bool, pytest_arguments: Sequence[str]) -> int:
    """Lint, format, types and tests; returns 0 if all of them pass.

    Types are checked while the tests run, since processes of the tests sometimes wait for others.
    """
    extension = DIST / "checked" / manifest()["id"]  # in the zip's layout, its imports are valid
    shutil.rmtree(extension, ignore_errors=True)
    stage(extension)
    typed = ("mypy", "--config-file", ROOT / "pyproject.toml", "--cache-dir", ROOT / ".mypy_cache")
    of_types: dict[str, tuple[Path, Sequence[str | Path]]] = {
        "mypy": (ROOT, ("mypy",)),
        "mypy of the extension": (extension, (*typed, "__init__.py", "nicmm_blender")),
    }
    others = {
        "ruff check": ("ruff", "check"),
        "ruff format": ("ruff", "format", "--check"),
        **dict(_pytest_commands(quick, pytest_arguments)),
    }
    failed = []
    with ThreadPoolExecutor(1) as meanwhile:
        begun = {name: meanwhile.submit(_said, *check) for name, check in of_types.items()}
        for name, command in others.items():
            say(name)
            if not _passes(command):
                failed.append(name)
        for name, check in begun.items():
            say(name)
            code, output = check.result()
            print(output, end="", flush=True)
            if code:
                failed.append(name)
    if failed:
        say(f"Failed: {', '.join(failed)}")
    return 1 if failed else 0


def _said(folder: Path, command: Sequence[str | Path]) -> tuple[int, str]:
    """Run a check in a folder; its exit status and its output."""
    done = subprocess.run(
        [VENV_PYTHON, "-m", *command],
        cwd=folder,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        encoding="utf-8",
        check=False,
    )
    return done.returncode, done.stdout


def _passes(command: Sequence[str | Path]) -> bool:
    """Run a check; where a test process has crashed, its stack then stands at the end."""
    with tempfile.TemporaryFile() as errors:
        passed = run([VENV_PYTHON, "-m", *command], ONE_THREAD, errors=errors) == 0
        errors.seek(0)
        for line in errors.read().decode("utf-8", "replace").splitlines():
            if not line.startswith("Extension modules:"):
                print(line, flush=True)
    return passed


def _pytest_commands(
    quick: bool, given: Sequence[str]
) -> Iterator[tuple[str, Sequence[str | Path]]]:
    """Names and arguments of the runs of pytest.

    Each folder whose tests import Blender's module or PyTorch has processes of its own, and the
    other tests run without them, as users of the package do.
    """
    command = ["pytest", "--durations=10", "--numprocesses=auto", "--dist=worksteal"]
    command += ["-m", "not slow"] if quick else []
    if given:
        yield "pytest", [*command, *given]
        return
    for folder in APART:
        yield f"pytest of {folder}", [*command, folder]
    yield "pytest of the others", [*command, *(f"--ignore={path}" for path in APART)]


def run_sanitized(arguments: Sequence[str]) -> int:
    """Run the quick tests of the core with kernels that check themselves, compiled by gcc."""
    if run([VENV_PYTHON, KERNELS / "compile_library.py", "sanitized"]) != 0:
        raise BuildError("gcc with its sanitizers is needed; see the output above")
    # Without the library of C++, the runtime aborts where a library throws an exception.
    runtime = [
        subprocess.run(
            ["gcc", f"-print-file-name={name}"], capture_output=True, text=True, check=True
        ).stdout.strip()
        for name in ("libasan.so", "libstdc++.so")
    ]
    environment = {
        **ONE_THREAD,
        "NICMM_KERNELS_LIBRARY": str(KERNELS / "nicmm_kernels/libnicmm_kernels_sanitized.so"),
        "LD_PRELOAD": " ".join(runtime),
        # Python itself frees little at its end, and tests ask for more memory than there is.
        "ASAN_OPTIONS": "detect_leaks=0:allocator_may_return_null=1",
    }
    options = ["--numprocesses=auto", "--dist=worksteal", "-m", "not slow"]
    where = arguments or ["tests/core", "tests/kernels"]
    return run([VENV_PYTHON, "-m", "pytest", *options, *where], environment)


def compare_platforms() -> int:
    """Compare the results of the kernels of all platforms, bit by bit."""
    return run([VENV_PYTHON, "-m", "tests.kernels.platforms.compare"], ONE_THREAD)
