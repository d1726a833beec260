"""Run measurements, save their data and generate the documents that present them.

python -m benchmarks NAME [--quick]    run one measurement
python -m benchmarks all [--hours H] [--jobs N]
                                       run all stale measurements: timed ones first, one at a time,
                                       then the others, N at a time; after an interruption, run
                                       the same command again
python -m benchmarks stale             list the measurements of other code, and what has changed
python -m benchmarks write             regenerate RESULTS.md and the figures in other documents
"""

from __future__ import annotations

import argparse
import importlib
import subprocess
import sys
import time
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

from tqdm import tqdm

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
    "courses",
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

UNKNOWN = 600.0
"""Expected duration, in seconds, of a measurement that has never been run."""

BAR = "{desc}: {percentage:.0f} % |{bar}| {elapsed} passed, {remaining} left"


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
        "--hours",
        type=float,
        help="with `all`: do not start a measurement that would end after this time",
    )
    parser.add_argument(
        "--jobs",
        type=int,
        default=1,
        help="with `all`: number of untimed measurements to run in parallel",
    )
    options = parser.parse_args()
    scale = Scale.QUICK if options.quick else Scale.SMOKE if options.smoke else Scale.FULL
    if options.name == "stale":
        return list_stale()
    if options.name == "write":
        write()
    elif options.name == "all":
        failed = measure_all(scale, options.hours, options.jobs)
        return int(bool(failed))
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


def measure_all(scale: Scale, hours: float | None, jobs: int) -> list[str]:
    """Run all stale measurements and return the names of those that failed.

    Timed measurements run first, one at a time, while the machine is otherwise idle. The others
    follow, `jobs` at a time. Each measurement saves its data when it ends, and the long ones keep
    what they have measured so far (`progress`), so a second call continues where an interrupted
    one stopped.
    """
    full = scale is Scale.FULL
    stale = [name for name in MEASUREMENTS if not full or evidence.what_changed(name)]
    expected = {name: _expected(name) for name in stale}
    timed = [name for name in stale if _is_timed(name)]
    others = [name for name in stale if name not in timed]
    others.sort(key=lambda name: -expected[name])  # the longest first, so that all end together
    failed: list[str] = []
    started = time.perf_counter()

    def run(name: str) -> None:
        passed = time.perf_counter() - started
        if hours is not None and passed + expected[name] > 3600.0 * hours:
            tqdm.write(f"{name} not started: it would end after the given time")
        else:
            tqdm.write(f"{name} begun, {_in_words(expected[name])} expected")
            if not run_apart(name, scale):
                failed.append(name)
                tqdm.write(f"{name} failed, see {_log_of(name)}")
        bar.update(round(expected[name]))

    with tqdm(total=round(sum(expected.values())), bar_format=BAR) as bar:
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


def list_stale() -> int:
    """Print the stale measurements and what has changed; return 1 if there are any, else 0."""
    stale = False
    for name in MEASUREMENTS:
        if changed := evidence.what_changed(name):
            stale = True
            print(f"{name}: {report.listed(changed)}")
    return int(stale)


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


def _expected(name: str) -> float:
    """Duration of the last full run in seconds, or `UNKNOWN`."""
    return float(evidence.load(name)["seconds"] or UNKNOWN) if evidence.is_kept(name) else UNKNOWN


def _in_words(seconds: float) -> str:
    minutes = round(seconds / 60.0)
    return f"{minutes // 60} h {minutes % 60} min" if minutes >= 60 else f"{minutes} min"


if __name__ == "__main__":
    sys.exit(main())
