"""The command line: ``nicmm design | offset | batch | plot | pretrain | shapes``.

Each module defines one command: `add` describes its arguments, `run` does its work.
"""

from __future__ import annotations

import argparse
import sys

from ..errors import NicmmError
from . import batch, design, offset, plot, pretrain, shapes

COMMANDS = (design, offset, batch, plot, pretrain, shapes)


def main(arguments: list[str] | None = None) -> int:
    """Run a command and return the exit status: 0, or 2 after a message on standard error."""
    given = parser().parse_args(arguments)
    try:
        given.run(given)
    except NicmmError as error:
        print(f"nicmm: {error}", file=sys.stderr)
        return 2
    except KeyboardInterrupt:
        print("nicmm: interrupted", file=sys.stderr)
        return 130
    return 0


def parser() -> argparse.ArgumentParser:
    """The parser of all commands."""
    whole = argparse.ArgumentParser(
        prog="nicmm",
        description="Smooth curves on triangle meshes.",
        epilog="nicmm COMMAND --help describes a command and gives examples.",
    )
    commands = whole.add_subparsers(required=True, metavar="COMMAND")
    for command in COMMANDS:
        name = command.__name__.rpartition(".")[2]
        summary, _, examples = (command.__doc__ or "").partition("\n\n")
        each = commands.add_parser(
            name,
            help=summary[:1].lower() + summary[1:].rstrip("."),
            description=summary,
            epilog=examples.rstrip(),
            formatter_class=argparse.RawDescriptionHelpFormatter,
        )
        command.add(each)
        each.set_defaults(run=command.run)
    return whole
