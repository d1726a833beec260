# SPDX-License-Identifier: GPL-3.0-or-later
"""The virtual environment `.venv/`, and what every step of the build uses."""

from __future__ import annotations

import hashlib
import os
import platform
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import IO

ROOT = Path(__file__).resolve().parents[1]
KERNELS = ROOT / "kernels"
VENV = ROOT / ".venv"
VENV_PYTHON = VENV / ("Scripts/python.exe" if os.name == "nt" else "bin/python")
DIST = ROOT / "dist"
REQUIREMENTS = ROOT / "requirements.txt"
MANIFEST = "blender_manifest.toml"

PYTHON = (3, 11)  # the Python of Blender 4.5 and its bpy module

ONE_THREAD = {
    **{f"{library}_NUM_THREADS": "1" for library in ("OMP", "OPENBLAS", "MKL")},
    "NICMM_THREADS": "1",
}
"""Environment of the tests: there is a process per core, and more threads only slow them down."""


class BuildError(Exception):
    """A step has failed; the message says why and what to do."""


def say(text: str) -> None:
    print(f"-- {text}", flush=True)


def run(
    arguments: Sequence[str | Path],
    environment: dict[str, str] | None = None,
    folder: Path = ROOT,
    errors: IO[bytes] | None = None,
) -> int:
    """Run a command in a folder, show its output and return its exit status.

    What it writes to its standard error is shown too, or goes to a file.
    """
    return subprocess.run(
        [str(argument) for argument in arguments],
        cwd=folder,
        env={**os.environ, **(environment or {})},
        stderr=errors,
        check=False,
    ).returncode


def pinned(name: str) -> str:
    """The pin of a package in requirements.txt, such as "scipy==1.17.1"."""
    for line in REQUIREMENTS.read_text(encoding="utf-8").splitlines():
        requirement = line.split("#")[0].strip()
        if requirement.startswith(f"{name}=="):
            return requirement
    raise BuildError(f"{REQUIREMENTS.name} has no pin of {name}. Add a line {name}==VERSION")


def check_python() -> None:
    needed = ".".join(map(str, PYTHON))
    if sys.version_info[:2] != PYTHON:
        raise BuildError(
            f"Python {needed} is needed, as Blender 4.5 is built with it; this is Python "
            f"{platform.python_version()}. Install Python {needed} and run: "
            f"python{needed} build.py {' '.join(sys.argv[1:])}"
        )
    for module in ("venv", "ensurepip"):
        try:
            __import__(module)
        except ImportError:
            raise BuildError(
                f"This Python lacks its module {module}. On Debian and Ubuntu run: "
                f"apt install python{needed}-venv; elsewhere install Python {needed} in full"
            ) from None


def ensure_environment() -> None:
    """Create `.venv/` with the pinned packages, unless it already contains them."""
    check_python()
    fingerprint = hashlib.sha256(REQUIREMENTS.read_bytes()).hexdigest()
    stamp = VENV / "installed.sha256"
    if VENV_PYTHON.exists() and stamp.is_file() and stamp.read_text() == fingerprint:
        compile_kernels()
        return
    if VENV.is_symlink():
        raise BuildError(
            f"{VENV.name}/ is a symbolic link without the packages in {REQUIREMENTS.name}. It is "
            "not overwritten, since another project may use it: remove the link, or update its "
            "target"
        )
    say(f"Making {VENV.name}/ and installing {REQUIREMENTS.name} (some minutes, once)")
    if run([sys.executable, "-m", "venv", "--clear", VENV]) != 0:
        raise BuildError(f"{VENV.name}/ could not be created; see the output above")
    if run([VENV_PYTHON, "-m", "pip", "install", "-r", REQUIREMENTS]) != 0:
        raise BuildError(
            "A package could not be installed; see pip's output above, check the network "
            "connection and run the same command again"
        )
    stamp.write_text(fingerprint)
    compile_kernels()


def compile_kernels() -> None:
    """Compile the kernels unless their sources are unchanged, and let `.venv/` import them."""
    if run([VENV_PYTHON, KERNELS / "compile_library.py"]) != 0:
        raise BuildError("The kernels could not be compiled; see the output above")
    if VENV.is_symlink():
        return  # the environment of another copy of the sources, which has its own kernels
    pattern = "Lib/site-packages" if os.name == "nt" else "lib/python*/site-packages"
    for packages in VENV.glob(pattern):
        (packages / "nicmm_kernels.pth").write_text(f"{KERNELS}\n", encoding="utf-8")


def manifest() -> dict:
    import tomllib  # imported here, so that an older Python gets as far as check_python

    return tomllib.loads((ROOT / MANIFEST).read_text(encoding="utf-8"))
