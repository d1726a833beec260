"""Run a measurement: ``python -m benchmarks one_loop [--quick]``.

Every measurement prints its seed, its meshes and the machine, and a table that goes into
RESULTS.md.
"""

from __future__ import annotations

import argparse

from . import one_loop

MEASUREMENTS = {"one_loop": one_loop.run}


def main() -> None:
    """Parse the command line and run one measurement."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks", description=__doc__)
    parser.add_argument("name", choices=MEASUREMENTS)
    parser.add_argument("--quick", action="store_true", help="a few meshes only")
    options = parser.parse_args()
    MEASUREMENTS[options.name](quick=options.quick)


if __name__ == "__main__":
    main()
