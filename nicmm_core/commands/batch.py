"""Design curves on many meshes, in parallel processes. Run it again to continue.

JOBS.csv has a line for each curve, with the columns mesh (a path relative to the
file), points (vertex indices separated by spaces) and, if a mesh has several
curves, name (of the file to write). The options apply to all curves.

Examples
--------
  nicmm batch jobs.csv --output curves
  nicmm batch jobs.csv --output curves --format obj --open --smoothness 2
  with this jobs.csv:
    mesh,points,name
    scans/a.ply,12 80 41,a-collar
    scans/a.ply,7 300 19 44,a-belt
    scans/b.ply,5 9 300,b-collar
"""

from __future__ import annotations

import argparse
import csv
import multiprocessing
import os
import sys
from collections.abc import Iterable
from concurrent.futures import ProcessPoolExecutor, as_completed
from dataclasses import dataclass
from pathlib import Path

from ..design import design_curve
from ..errors import ArgumentError, MissingPackageError, NicmmError
from ..io.files import CURVE_FORMATS, read_mesh, write_curve
from ..status import Status
from .option_flags import add_options, indices, option_values

FAILURES = "failures.csv"
"""Name of the file, beside the curves, that lists the curves that could not be designed."""

ONE_THREAD = ("NICMM_THREADS", "OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")
"""Environment variables that limit each process to one thread, since there is one per core."""


@dataclass(frozen=True)
class Job:
    """A curve to design.

    Attributes
    ----------
    mesh : Path
    points : str
        Vertex indices separated by commas.
    output : Path
        File of the curve.
    """

    mesh: Path
    points: str
    output: Path


def add(parser: argparse.ArgumentParser) -> None:
    """Describe the arguments."""
    parser.add_argument("jobs", metavar="JOBS.csv")
    parser.add_argument("-o", "--output", required=True, metavar="FOLDER", help="of the curves")
    formats = [suffix.removeprefix(".") for suffix in CURVE_FORMATS]
    parser.add_argument("--format", choices=formats, default="json", help="default: json")
    parser.add_argument(
        "--processes", type=int, default=os.cpu_count() or 1, help="default: one per core"
    )
    parser.add_argument(
        "--again", action="store_true", help="also design curves whose files exist already"
    )
    add_options(parser, without=("avoid", "alternatives"))  # they belong to a single mesh


def run(given: argparse.Namespace) -> None:
    """Design all curves whose files do not exist yet, and list those that failed."""
    progress_bar = _progress_bar()
    if given.processes < 1:
        raise ArgumentError(f"--processes is {given.processes}; give at least 1")
    folder = Path(given.output)
    jobs = read_jobs(Path(given.jobs), folder, given.format)
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise ArgumentError(f"--output is {given.output!r}, which cannot be made ({error}); choose "
                            "another folder") from error  # fmt: skip
    open_jobs = [job for job in jobs if given.again or not job.output.exists()]
    failures: list[tuple[Job, str]] = []
    for name in ONE_THREAD:  # processes inherit them
        os.environ.setdefault(name, "1")
    # A forked process would inherit locks that threads of libraries hold.
    context = multiprocessing.get_context("spawn")
    with (
        ProcessPoolExecutor(given.processes, mp_context=context) as pool,
        progress_bar(total=len(jobs), initial=len(jobs) - len(open_jobs), unit="curve") as bar,
    ):
        running = {pool.submit(designed, job, given): job for job in open_jobs}
        for done in as_completed(running):
            message = done.result()
            if message:
                failures.append((running[done], message))
            bar.update()
    _write_failures(folder / FAILURES, failures)
    print(f"{len(jobs) - len(failures)} curves in {folder}", file=sys.stderr)
    if failures:
        raise NicmmError(
            f"{len(failures)} of {len(jobs)} curves could not be designed; {folder / FAILURES} "
            "says why"
        )


def read_jobs(path: Path, folder: Path, suffix: str) -> list[Job]:
    """The jobs in a CSV file.

    Raises
    ------
    ArgumentError
        If the file cannot be read, lacks a column or a value, or two curves would have one file.
    """
    try:
        with path.open(encoding="utf-8-sig", newline="") as file:
            rows = list(csv.DictReader(file))
    except (OSError, UnicodeDecodeError, csv.Error) as error:
        raise ArgumentError(f"{path} cannot be read ({error}); check the path") from error
    jobs: dict[Path, Job] = {}
    for line, row in enumerate(rows, start=2):
        mesh, points = (row.get("mesh") or "").strip(), (row.get("points") or "").split()
        if not mesh or not points:
            raise ArgumentError(
                f"{path}, line {line}: mesh or points is missing; begin the file with the line "
                "'mesh,points', and separate the points by spaces"
            )
        name = (row.get("name") or "").strip() or Path(mesh).stem
        output = folder / f"{name}.{suffix}"
        if output in jobs:
            raise ArgumentError(
                f"{path}, line {line}: another line also writes {output.name}; add a column "
                "'name' with different names"
            )
        jobs[output] = Job(path.parent / mesh, ",".join(points), output)
    return list(jobs.values())


def designed(job: Job, given: argparse.Namespace) -> str:
    """Design and write one curve; returns the message of an error, or an empty text."""
    try:
        mesh = read_mesh(job.mesh)
        points = indices("points", job.points, "vertex indices", "12 80 41")
        design = design_curve(mesh, points, **option_values(given, mesh))
        if design.status is Status.NOT_ONE_CURVE:
            return str(design.status)
        # The file appears as a whole, so that an interrupted run never leaves half of one.
        unfinished = job.output.with_stem(f"{job.output.stem}.unfinished")
        write_curve(unfinished, design.curves[0])
        os.replace(unfinished, job.output)
    except NicmmError as error:
        return str(error)
    return ""


def _progress_bar() -> type:
    try:
        from tqdm import tqdm
    except ImportError as error:
        raise MissingPackageError(
            f"batch needs tqdm, which cannot be imported ({error}); install it into this Python "
            "with 'pip install tqdm'"
        ) from error
    return tqdm


def _write_failures(path: Path, failures: Iterable[tuple[Job, str]]) -> None:
    """Write the list of failures, or remove that of an earlier run."""
    rows = [(job.mesh, job.points.replace(",", " "), message) for job, message in failures]
    if not rows:
        path.unlink(missing_ok=True)
        return
    with path.open("w", encoding="utf-8", newline="") as file:
        csv.writer(file).writerows([("mesh", "points", "message"), *rows])
