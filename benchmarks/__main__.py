"""Measure, and write down what was measured.

python -m benchmarks NAME [--quick]    one measurement
python -m benchmarks all [--hours H]   all that are stale, timed ones first; run again to go on
python -m benchmarks stale             what was measured on other code, with what changed
python -m benchmarks write             RESULTS.md and the figures in other documents, from the data
"""

from __future__ import annotations

import argparse
import importlib
import sys
import time

from tqdm import tqdm

from . import documents, evidence, report
from .scale import Scale

MEASUREMENTS = (
    "one_loop",
    "pretraining",
    "transfer",
    "pretrained_start",
    "convergence",
    "ablation",
    "ninth_channel",
    "parameters",
    "initial",
    "curvature",
    "variational_order",
    "runtime",
    "dragging",
    "stages",
    "cancellation",
    "peers",
    "degraded",
    "degraded_start",
    "courses",
    "resolution",
    "gallery",
    "obstacles",
    "lanes",
    "sharp_edges",
    "guarantee",
    "corpus",
    "messes",
    "fuzz",
    "cuts",
)
"""Modules of this package, in the order of RESULTS.md; `report` says what is in them."""

UNKNOWN = 600.0
"""Seconds that a measurement is expected to take which was never timed."""

BAR = "{desc}: {percentage:.0f} % |{bar}| {elapsed} passed, {remaining} left"


def main() -> int:
    """Parse the command line and run."""
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
        "--hours", type=float, help="with `all`: begin nothing that would end later"
    )
    options = parser.parse_args()
    scale = Scale.QUICK if options.quick else Scale.SMOKE if options.smoke else Scale.FULL
    if options.name == "stale":
        return list_stale()
    if options.name == "write":
        write()
    elif options.name == "all":
        measure_all(scale, options.hours)
    else:
        measure_one(options.name, scale)
    return 0


def measure_one(name: str, scale: Scale) -> None:
    """Run a measurement, keep its data, draw its plots and print its section."""
    started = time.perf_counter()
    results = importlib.import_module(f"benchmarks.{name}").measure(scale)
    record = evidence.save(name, results, time.perf_counter() - started, scale)
    report.draw(name, record, scale)
    print(report.section_text(name, record), flush=True)
    if scale is Scale.FULL:
        write()


def measure_all(scale: Scale, hours: float | None) -> None:
    """Run what is stale, timed measurements first while the machine is quiet.

    Each keeps its data when it ends, so an interrupted run goes on where it was.
    """
    full = scale is Scale.FULL
    names = [name for name in MEASUREMENTS if not full or evidence.what_changed(name)]
    names.sort(
        key=lambda name: not getattr(importlib.import_module(f"benchmarks.{name}"), "TIMED", False)
    )
    expected = {name: _expected(name) for name in names}
    started = time.perf_counter()
    with tqdm(total=round(sum(expected.values())), bar_format=BAR) as bar:
        for name in names:
            passed = time.perf_counter() - started
            bar.set_description(f"{name} ({_in_words(expected[name])})")
            if hours is None or passed + expected[name] <= 3600.0 * hours:
                measure_one(name, scale)
            else:
                tqdm.write(f"{name} would end after the hours given: not begun")
            bar.update(round(expected[name]))


def list_stale() -> int:
    """Print measurements on other code, with what changed; return whether there are any."""
    stale = False
    for name in MEASUREMENTS:
        if changed := evidence.what_changed(name):
            stale = True
            print(f"{name}: {report.listed(changed)}")
    return int(stale)


def write() -> None:
    """Generate RESULTS.md, and the figures in other documents."""
    records = report.kept_records(MEASUREMENTS)
    for name, record in records.items():
        report.draw(name, record, Scale.FULL)
    for path, text in documents.generated(records).items():
        path.write_text(text, encoding="utf-8")


def _is_timed(name: str) -> bool:
    return getattr(importlib.import_module(f"benchmarks.{name}"), "TIMED", False)


def _expected(name: str) -> float:
    """Seconds that a full run took last time."""
    return float(evidence.load(name)["seconds"] or UNKNOWN) if evidence.is_kept(name) else UNKNOWN


def _in_words(seconds: float) -> str:
    minutes = round(seconds / 60.0)
    return f"{minutes // 60} h {minutes % 60} min" if minutes >= 60 else f"{minutes} min"


if __name__ == "__main__":
    sys.exit(main())
