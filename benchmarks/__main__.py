"""Run measurements, save their data and generate the documents that present them.

python -m benchmarks NAME [--quick]    run one measurement
python -m benchmarks all [--jobs N]    run all stale measurements: timed ones first, one at a time,
                                       then the others, N at a time; after an interruption, run the
                                       same command again
python -m benchmarks stale             list the measurements that were made with other code
python -m benchmarks write             regenerate RESULTS.md and the figures in other documents
"""

from __future__ import annotations

import argparse
import importlib
import os
import subprocess
import sys
import time
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

from . import documents, evidence, progress, report
from .scale import Scale

MEASUREMENTS = (
    "one_loop",
    "pretraining",
    "transfer",
    "convergence",
    "ablation",
    "ninth_channel",
    "parameters",
    "initial",
    "curvature",
    "variational_order",
    "solvers",
    "runtime",
    "dragging",
    "stages",
    "cancellation",
    "peers",
    "degraded",
    "degraded_start",
    "search_effort",
    "portfolio",
    "courses",
    "dense_points",
    "course_pictures",
    "prompts",
    "symmetry",
    "dabs",
    "resolution",
    "defects",
    "gallery",
    "obstacles",
    "several_curves",
    "option_costs",
    "lanes",
    "sharp_edges",
    "guarantee",
    "corpus",
    "messes",
    "fuzz",
    "cuts",
    "offsets",
    "strokes",
)
"""Modules of this package, in the order of RESULTS.md; see `report` for what each one defines."""


def main() -> int:
    """Parse the command line, run the command and return the exit status."""
    parser = argparse.ArgumentParser(
        prog="python -m benchmarks",
        description=__doc__,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("name", choices=(*MEASUREMENTS, "all", "stale", "write"))
    how_much = parser.add_mutually_exclusive_group()
    how_much.add_argument("--quick", action="store_true", help="fewer meshes and points: minutes")
    how_much.add_argument("--smoke", action="store_true", help="generated meshes: seconds")
    parser.add_argument(
        "--jobs",
        type=int,
        default=os.cpu_count() or 1,
        help="with `all`: number of untimed measurements to run in parallel",
    )
    options = parser.parse_args()
    scale = Scale.QUICK if options.quick else Scale.SMOKE if options.smoke else Scale.FULL
    if options.name == "stale":
        stale = [name for name in MEASUREMENTS if not evidence.is_current(name)]
        if stale:
            count = f"{len(stale)} of {len(MEASUREMENTS)} measurements are stale"
            print("\n".join([*stale, count]))
        return int(bool(stale))
    if options.name == "write":
        write()
    elif options.name == "all":
        return int(bool(measure_all(scale, options.jobs)))
    else:
        measure_one(options.name, scale)
    return 0


def measure_one(name: str, scale: Scale) -> None:
    """Run a measurement, save its data, draw its plots and print its section."""
    code = evidence.code_behind(name)
    before, started = progress.seconds_before(name, scale), time.perf_counter()
    results = importlib.import_module(f"benchmarks.{name}").measure(scale)
    seconds = time.perf_counter() - started + before
    record = evidence.save(name, code, results, seconds, scale)
    progress.forget(name, scale)
    report.draw(name, record, scale)
    print(report.section_text(name, record), flush=True)
    if scale is Scale.FULL:
        write()


def measure_all(scale: Scale, jobs: int) -> list[str]:
    """Run all stale measurements and return the names of those that failed.

    Timed measurements run first, one at a time, while the machine is otherwise idle. The others
    follow, `jobs` at a time. Each measurement saves its data when it ends, and the long ones keep
    what they have measured so far (`progress`), so a second call continues where an interrupted
    one stopped.
    """
    full = scale is Scale.FULL
    stale = [name for name in MEASUREMENTS if not (full and evidence.is_current(name))]
    # The longest first, so that all end together.
    stale.sort(key=lambda name: -evidence.load(name)["seconds"] if evidence.is_kept(name) else 0)
    timed = [name for name in stale if _is_timed(name)]
    others = [name for name in stale if name not in timed]
    failed: list[str] = []
    started = time.perf_counter()

    def run(name: str) -> None:
        begun = time.perf_counter()
        succeeded = run_apart(name, scale)
        if not succeeded:
            failed.append(name)
        now = time.perf_counter()
        words = "ended" if succeeded else f"failed, see {_log_of(name)},"
        print(f"{name} {words} after {now - begun:.0f} s; {now - started:.0f} s in all", flush=True)

    for names, at_once in ((timed, 1), (others, jobs)):
        threads = ThreadPoolExecutor(at_once)
        try:
            list(threads.map(run, names))
        finally:
            threads.shutdown(cancel_futures=True)
    return failed


def run_apart(name: str, scale: Scale) -> bool:
    """Run a measurement in a separate process; return whether it succeeded."""
    log = _log_of(name)
    log.parent.mkdir(parents=True, exist_ok=True)
    flags = [] if scale is Scale.FULL else [f"--{scale.value}"]
    with log.open("w", encoding="utf-8") as output:
        done = subprocess.run(
            [sys.executable, "-m", "benchmarks", name, *flags],
            cwd=evidence.ROOT,
            stdout=output,
            stderr=subprocess.STDOUT,
            check=False,
        )
    return done.returncode == 0


def write() -> None:
    """Generate RESULTS.md and the figures in other documents."""
    records = report.kept_records(MEASUREMENTS)
    for name, record in records.items():
        report.draw(name, record, Scale.FULL)
    for path, text in documents.generated(records).items():
        path.write_text(text, encoding="utf-8")


def _log_of(name: str) -> Path:
    return evidence.QUICK_OUTPUT / "logs" / f"{name}.txt"


def _is_timed(name: str) -> bool:
    return getattr(importlib.import_module(f"benchmarks.{name}"), "TIMED", False)


if __name__ == "__main__":
    sys.exit(main())
