"""Run a measurement: ``python -m benchmarks NAME [--quick]``, or ``all`` of them.

Each prints its result with seed, meshes and machine, and full runs put it into RESULTS.md.
"""

from __future__ import annotations

import argparse
import importlib
import time

from .scale import Scale

MEASUREMENTS = (
    "one_loop",
    "guarantee",
    "corpus",
    "fuzz",
    "messes",
    "cuts",
    "pretraining",
    "transfer",
    "pretrained_start",
    "convergence",
    "ablation",
    "ninth_channel",
    "parameters",
    "initial",
    "curvature",
    "runtime",
    "dragging",
    "stages",
    "cancellation",
    "obstacles",
    "lanes",
    "sharp_edges",
    "peers",
    "degraded",
    "degraded_start",
    "courses",
    "resolution",
    "gallery",
    "variational_order",
)
"""Modules of this package with a ``run(scale)``, in the order of the paper."""


def main() -> None:
    """Parse the command line and run."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks", description=__doc__)
    parser.add_argument("name", choices=(*MEASUREMENTS, "all"))
    how_much = parser.add_mutually_exclusive_group()
    how_much.add_argument("--quick", action="store_true", help="fewer meshes and points: minutes")
    how_much.add_argument("--smoke", action="store_true", help="generated meshes: seconds")
    options = parser.parse_args()
    scale = Scale.QUICK if options.quick else Scale.SMOKE if options.smoke else Scale.FULL
    for name in MEASUREMENTS if options.name == "all" else (options.name,):
        started = time.perf_counter()
        importlib.import_module(f".{name}", __package__).run(scale)
        print(f"-- {name}: {time.perf_counter() - started:.0f} s\n", flush=True)


if __name__ == "__main__":
    main()
