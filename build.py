#!/usr/bin/env python3
# SPDX-License-Identifier: GPL-3.0-or-later
"""Runs the demo and the tests of NICMM Curves and builds its packages; needs only Python 3.11.

    python3 build.py demo      draw curves on Suzanne in headless Blender and render them
    python3 build.py test      run every check; --quick leaves out the slow tests
    python3 build.py docs      build the site of the documentation in dist/site/
    python3 build.py package   build the installable zips
    python3 build.py release   build and check everything that a release consists of

Each command makes `.venv/` on its first run and installs requirements.txt into it. The modules in
`building/` do the work.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
from collections.abc import Sequence
from pathlib import Path

from building import checks, extension, release
from building.environment import (
    DIST,
    ROOT,
    VENV_PYTHON,
    BuildError,
    ensure_environment,
    manifest,
    run,
    say,
)


def command_demo(arguments: argparse.Namespace) -> int:
    script = "close_ups.py" if arguments.close_ups else "suzanne.py"
    with tempfile.TemporaryDirectory() as user_folder:
        # Blender finds the extension where it installs extensions; its wheels are in .venv.
        extension.stage(Path(user_folder) / "extensions" / "user_default" / manifest()["id"])
        return run([VENV_PYTHON, ROOT / "demo" / script], {"BLENDER_USER_RESOURCES": user_folder})


def command_test(arguments: argparse.Namespace) -> int:
    if arguments.sanitize:
        return checks.run_sanitized(arguments.pytest_arguments)
    if arguments.platforms:
        return checks.compare_platforms()
    return checks.run_checks(arguments.quick, arguments.pytest_arguments)


def command_docs(arguments: argparse.Namespace) -> int:
    return run([VENV_PYTHON, "-m", "docs.build_site", arguments.output.resolve()])


def command_package(arguments: argparse.Namespace) -> int:
    for platform in arguments.platform or extension.PLATFORMS:
        pythons = arguments.python or extension.BLENDER_PYTHONS
        archive = extension.package(platform, pythons, arguments.output.resolve())
        say(f"{archive} ({archive.stat().st_size / 1e6:.0f} MB)")
    return 0


def command_release(arguments: argparse.Namespace) -> int:
    return release.release(arguments.output.resolve(), tests=not arguments.without_tests)


def parse(arguments: Sequence[str]) -> argparse.Namespace:
    parser = argparse.ArgumentParser(
        prog="build.py", description="Demo, tests and packages of NICMM Curves."
    )
    commands = parser.add_subparsers(title="commands", metavar="COMMAND")

    demo = commands.add_parser("demo", help="draw curves on Suzanne in headless Blender")
    demo.add_argument("--close-ups", action="store_true", help="render tubes close up instead")
    demo.set_defaults(command=command_demo)

    test = commands.add_parser("test", help="run every check")
    test.add_argument("--quick", action="store_true", help="leave out the slow tests")
    test.add_argument(
        "--sanitize",
        action="store_true",
        help="run the quick tests of the core with memory checks of the kernels (Linux, gcc)",
    )
    test.add_argument(
        "--platforms",
        action="store_true",
        help="compare the results of the kernels of all platforms, bit by bit (qemu-user, wine)",
    )
    test.add_argument(
        "pytest_arguments", nargs=argparse.REMAINDER, help="passed to pytest, such as tests/blender"
    )
    test.set_defaults(command=command_test)

    pack = commands.add_parser("package", help="build the installable zips in dist/")
    pack.add_argument(
        "--platform",
        action="append",
        choices=extension.PLATFORMS,
        help="default: every platform; repeatable",
    )
    pack.add_argument(
        "--python",
        action="append",
        metavar="X.Y",
        help=f"Python of Blender; default: {' and '.join(extension.BLENDER_PYTHONS)}; repeatable",
    )
    pack.add_argument("--output", type=Path, default=DIST, help="folder of the zips; default: dist")
    pack.set_defaults(command=command_package)

    docs = commands.add_parser("docs", help="build the site of the documentation")
    docs.add_argument("--output", type=Path, default=DIST / "site", help="default: dist/site")
    docs.set_defaults(command=command_docs)

    whole = commands.add_parser("release", help="build and check everything of a release")
    whole.add_argument(
        "--output", type=Path, default=DIST / "release", help="default: dist/release"
    )
    whole.add_argument(
        "--without-tests", action="store_true", help="leave out `build.py test`, which has been run"
    )
    whole.set_defaults(command=command_release)

    parsed = parser.parse_args(arguments)
    if "command" not in parsed:
        parser.print_help()
        parser.exit()
    return parsed


def main() -> int:
    arguments = parse(sys.argv[1:])
    try:
        ensure_environment()
        return arguments.command(arguments)
    except BuildError as error:
        print(f"build.py: {error}", file=sys.stderr)
        return 2


if __name__ == "__main__":
    sys.exit(main())
