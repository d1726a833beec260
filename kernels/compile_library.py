# SPDX-License-Identifier: GPL-3.0-or-later
"""Compiles the kernels to a shared library, for this platform or another one.

    python kernels/compile_library.py            into the package, unless it is there and current
    python kernels/compile_library.py sanitized  with gcc and its sanitizers, into the package

The compiler is that of the PyPI package `ziglang`; it compiles for every platform on any of them.
"""

from __future__ import annotations

import hashlib
import os
import platform
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

FOLDER = Path(__file__).resolve().parent
PACKAGE = FOLDER / "nicmm_kernels"
STAMP = PACKAGE / "compiled.sha256"

# For each platform: the compiler's target, the tag of its wheel, and the name of the library.
PLATFORMS = {
    "linux-x64": (
        "x86_64-linux-gnu.2.28",
        "manylinux_2_28_x86_64",
        "libnicmm_kernels.so",
    ),
    "linux-arm64": (
        "aarch64-linux-gnu.2.28",
        "manylinux_2_28_aarch64",
        "libnicmm_kernels.so",
    ),
    "windows-x64": ("x86_64-windows-gnu", "win_amd64", "nicmm_kernels.dll"),
    "macos-arm64": ("aarch64-macos.12.0", "macosx_12_0_arm64", "libnicmm_kernels.dylib"),
    "macos-x64": ("x86_64-macos.12.0", "macosx_12_0_x86_64", "libnicmm_kernels.dylib"),
}

# Results must be the same bits on every platform: no fused multiplication and addition, and none of
# the freedoms of -ffast-math.
FLAGS = ("-std=c99", "-ffp-contract=off", "-fno-math-errno", "-fvisibility=hidden", "-shared")
WARNINGS = ("-Wall", "-Wextra", "-Werror")
OPTIMISED = ("-O2", "-s", "-fno-sanitize=undefined")
SANITIZED = ("-O1", "-g", "-fPIC", "-fsanitize=address,undefined", "-fno-sanitize-recover=all")


class CompileError(Exception):
    """The library could not be compiled; the message says why and what to do."""


def this_platform() -> str:
    """The name of the platform on which this script runs."""
    system = {"Linux": "linux", "Windows": "windows", "Darwin": "macos"}.get(platform.system())
    machine = {"x86_64": "x64", "amd64": "x64", "arm64": "arm64", "aarch64": "arm64"}
    name = f"{system}-{machine.get(platform.machine().lower())}"
    if name not in PLATFORMS:
        raise CompileError(
            f"The kernels are not compiled for {platform.system()} on {platform.machine()}; there "
            f"are {', '.join(PLATFORMS)}"
        )
    return name


def compile_library(name: str, folder: Path) -> Path:
    """Compile for a platform into a folder, and return the path of the library."""
    target, _, file = PLATFORMS[name]
    compiler = [sys.executable, "-m", "ziglang", "cc", "-target", target, *OPTIMISED]
    return _compiled(compiler, folder / file)


def compile_sanitized() -> Path:
    """Compile for this platform with checks of memory accesses and of undefined behaviour."""
    return _compiled(["gcc", *SANITIZED], PACKAGE / "libnicmm_kernels_sanitized.so")


def compile_if_changed() -> None:
    """Compile for this platform into the package, unless that was done with the same sources."""
    name = this_platform()
    digest = fingerprint(name)
    library = PACKAGE / PLATFORMS[name][2]
    if library.is_file() and STAMP.is_file() and STAMP.read_text() == digest:
        return
    print("-- Compiling the kernels", flush=True)
    compile_library(name, PACKAGE)
    STAMP.write_text(digest)


def fingerprint(name: str) -> str:
    """A hash of the platform and of everything that determines its library."""
    digest = hashlib.sha256(name.encode())
    for path in (Path(__file__), FOLDER / "pyproject.toml", *_sources("*.[ch]")):
        digest.update(path.read_bytes())
    return digest.hexdigest()


def _sources(pattern: str) -> list[Path]:
    return sorted((FOLDER / "source").glob(pattern))


def _compiled(compiler: list[str], library: Path) -> Path:
    # In a folder of its own, as the linker leaves other files beside the library. It replaces the
    # former library at once, so that processes that use it keep theirs.
    with tempfile.TemporaryDirectory() as temporary:
        made = Path(temporary) / library.name
        sources = [str(path) for path in _sources("*.c")]
        libraries = [] if library.suffix == ".dll" else ["-lm"]
        command = [*compiler, *FLAGS, *WARNINGS, *sources, "-o", str(made), *libraries]
        if subprocess.run(command, cwd=temporary, check=False).returncode != 0:
            raise CompileError("The kernels could not be compiled; see the output above")
        library.parent.mkdir(parents=True, exist_ok=True)
        beside = library.with_name(f"{library.name}.{os.getpid()}")
        shutil.copy(made, beside)
        os.replace(beside, library)
    return library


if __name__ == "__main__":
    try:
        if sys.argv[1:] == ["sanitized"]:
            compile_sanitized()
        else:
            compile_if_changed()
    except CompileError as error:
        sys.exit(f"compile_library.py: {error}")
