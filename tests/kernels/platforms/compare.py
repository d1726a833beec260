# SPDX-License-Identifier: GPL-3.0-or-later
"""Shows that the kernels give the same bits on every platform that can be run here.

    python -m tests.kernels.platforms.compare

Designs are computed, and some of their calls of kernels are recorded: all memory that a call reads,
and what it changes there. `replay.c` is compiled for each platform. It repeats the calls with the
library of that platform, in an emulator unless it is this one. Exit status 1 if any bit differs.
"""

from __future__ import annotations

import contextlib
import os
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Callable, Iterator
from pathlib import Path

import compile_library
import numpy as np

import nicmm_core as nicmm
from nicmm_core import shapes
from tests.kernels.platforms.recording import Recording, record

PROGRAM = Path(__file__).resolve().with_name("replay.c")

EMULATORS = {
    "linux-arm64": ("qemu-aarch64", "-L", "/usr/aarch64-linux-gnu"),
    "windows-x64": ("wine",),
}
"""Commands that run programs of other platforms; on Debian those of the packages qemu-user with
libc6-arm64-cross, and wine64."""


class CannotRunError(Exception):
    """Programs for a platform cannot be run here; the message says why."""


class ReplayError(Exception):
    """Calls could not be repeated; the message says why."""


def designs() -> Iterator[Callable[[], object]]:
    """Short designs on small meshes: closed and open, with maps, on folds, and from a start."""
    ball, ring = shapes.sphere(2), shapes.torus(around=24, across=12)
    body = shapes.creature(5, subdivisions=0)
    noise = np.random.default_rng(0).normal(scale=0.07, size=ball.vertices.shape)
    folded = nicmm.Mesh(ball.vertices + noise, ball.faces)
    height = ring.vertices[:, 2] / ring.vertices[:, 2].max()
    yield lambda: nicmm.design_curve(body, [3, 50, 200, 133], order="shortest", alternatives=2)
    yield lambda: nicmm.design_curve(ring, [5, 90, 200], closed=False, alignment=height.clip(0))
    yield lambda: nicmm.design_curve(ring, [5, 90, 200], obstacles=(height > 0.9).astype(float))
    yield lambda: nicmm.design_curve(folded, [12, 80, 41, 150])
    yield lambda: nicmm.design_curve(shapes.sphere(1), [0, 5, 9], method="nicmm")
    yield lambda: _drag_a_point(body)


def _drag_a_point(body: nicmm.Mesh) -> None:
    """Move a control point to vertices around it, far enough for the curve to cross itself."""
    designer = nicmm.Designer(body)
    start = designer.design([3, 50, 200, 133], order="shortest")
    for vertex in (75, 93, 94, 98, 99, 111, 116, 139, 140, 185, 210, 214, 219, 220, 221, 229):
        with contextlib.suppress(nicmm.CurveError):
            designer.design([3, 50, vertex, 133], order="shortest", start=start)


def replay(name: str, recording: Recording, folder: Path) -> bytes:
    """Repeat recorded calls on a platform, and return their results.

    Parameters
    ----------
    name : str
        One of `compile_library.PLATFORMS`.
    recording : Recording
    folder : Path
        A new folder for the library, the program and its files.

    Raises
    ------
    CannotRunError
        If programs for the platform cannot be run here.
    ReplayError
        If the program stops with an error.
    """
    emulator = _emulator(name)
    folder.mkdir()
    library = compile_library.compile_library(name, folder)
    recording.write(folder / "recording")
    recording.write_declarations(folder / "kernels.h")
    is_windows = library.suffix == ".dll"
    program = folder / ("replay.exe" if is_windows else "replay")
    target = compile_library.PLATFORMS[name][0]
    command = [sys.executable, "-m", "ziglang", "cc", "-target", target, "-std=c99", f"-I{folder}"]
    command += [*compile_library.WARNINGS, str(PROGRAM), "-o", str(program)]
    subprocess.run([*command, *(() if is_windows else ("-ldl",))], check=True)
    trial = _run([*emulator, program], folder)
    if trial.returncode:
        reason = trial.stderr.strip().splitlines()[-1:]
        raise CannotRunError(f"a program fails: {''.join(reason) or trial.returncode}")
    beside = os.path.join(".", library.name)
    ran = _run([*emulator, program, beside, "recording", "results"], folder)
    if ran.returncode:
        raise ReplayError(f"the program stops with status {ran.returncode}: {ran.stderr.strip()}")
    return (folder / "results").read_bytes()


def _emulator(name: str) -> tuple[str, ...]:
    if name == compile_library.this_platform():
        return ()
    if name not in EMULATORS:
        raise CannotRunError("no emulator is known")
    if shutil.which(EMULATORS[name][0]) is None:
        raise CannotRunError(f"{EMULATORS[name][0]} is not installed")
    return EMULATORS[name]


def _run(command: list[str | Path], folder: Path) -> subprocess.CompletedProcess[str]:
    environment = {**os.environ, "WINEPREFIX": str(folder / "wine"), "WINEDEBUG": "-all"}
    return subprocess.run(
        command, cwd=folder, env=environment, capture_output=True, text=True, check=False
    )


def main() -> int:
    """Record, repeat on every platform and compare; returns the exit status."""
    recording = record(designs())
    calls, size = len(recording.called), sum(map(len, recording.results))
    print(f"{calls} calls of {len(recording.kernels)} kernels are recorded")
    if recording.unused:
        print(f"The designs call no {', '.join(recording.unused)}")
    status = 0
    with tempfile.TemporaryDirectory(ignore_cleanup_errors=True) as temporary:
        for name in compile_library.PLATFORMS:
            try:
                results = replay(name, recording, Path(temporary) / name)
                fault = recording.first_difference(results)
            except CannotRunError as error:
                print(f"{name}: could not be run, because {error}", flush=True)
                continue
            except ReplayError as error:
                fault = str(error)
            same = f"{calls} calls, {size:,} bytes of results, all the same"
            print(f"{name}: {fault or same}", flush=True)
            status |= fault is not None
    return status


if __name__ == "__main__":
    sys.exit(main())
